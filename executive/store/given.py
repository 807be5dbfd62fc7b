"""Which robot of a fleet has which mission of a store, how often one was given to another, and what a referee saw."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from executive.store.missions import MissionStore

__all__ = ["GivenMission", "GivenMissions"]

_PUT: Final = "INSERT INTO given (mission) VALUES (?) ON CONFLICT (mission) DO NOTHING"


@dataclass(frozen=True)
class GivenMission:
    """What is known of a mission that was given out.

    `robot` has it, or had it last; it was given to another `reassigned` times. The first `done` of its commands are
    done and not done again; `blocked` is why it cannot begin again where it is broken off now. `referee` is what a
    referee said in the end, as JSON values.
    """

    robot: str | None = None
    reassigned: int = 0
    done: int = 0
    blocked: str | None = None
    referee: Mapping[str, Any] | None = None


class GivenMissions:
    """What a store knows of the missions that were given out."""

    def __init__(self, store: MissionStore) -> None:
        self._store = store

    def all(self) -> Mapping[int, GivenMission]:
        """All of them, by their numbers."""
        rows = self._store.rows("SELECT * FROM given ORDER BY mission")
        return {
            row["mission"]: GivenMission(
                robot=row["robot"],
                reassigned=row["reassigned"],
                done=row["done"],
                blocked=row["blocked"],
                referee=None if row["referee"] is None else json.loads(row["referee"]),
            )
            for row in rows
        }

    def give(self, mission: int, robot: str) -> None:
        """A robot has the mission from now on."""
        again = "reassigned = reassigned + (robot IS NOT NULL AND robot <> ?)"
        self._set(mission, f"{again}, robot = ?, blocked = NULL", robot, robot)

    def progress(self, mission: int, done: int, blocked: str | None) -> None:
        """How many commands are done, and why what is under way cannot begin again (None: it can)."""
        self._set(mission, "done = ?, blocked = ?", done, blocked)

    def hand_back(self, mission: int) -> None:
        """The mission waits for another robot."""
        self._set(mission, "blocked = NULL")

    def judge(self, mission: int, referee: Mapping[str, Any] | None) -> None:
        """What a referee saw."""
        self._set(mission, "referee = ?", None if referee is None else json.dumps(dict(referee)))

    def _set(self, mission: int, change: str, *values: object) -> None:
        with self._store.writing() as connection:
            connection.execute(_PUT, (mission,))
            connection.execute(f"UPDATE given SET {change} WHERE mission = ?", (*values, mission))
