"""Assignments of a store's missions to the robots of a fleet: who has each, how far it is, what a referee saw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from executive.store.database import form
from executive.store.missions import MissionState, MissionStore

_FAILED: Final = (MissionState.FAILURE, MissionState.ERROR, MissionState.CANCELLED)


@dataclass(frozen=True)
class GivenMission:
    """The assignment of a mission to a robot of a fleet.

    `robot` has it, or had it last; it went to another one `reassigned` times. The first `done` of its commands are done
    and not done again; `blocked` is why it cannot begin again where it is interrupted now. `referee` is the verdict at
    the end, as JSON values.

    A mission that no robot could do alone is done in parts, which are missions `part_of` it; a part that `follows`
    another begins when that is done.
    """

    robot: str | None = None
    reassigned: int = 0
    done: int = 0
    blocked: str | None = None
    referee: Mapping[str, Any] | None = None
    part_of: int | None = None
    follows: int | None = None


class GivenMissions:
    """The assignments in a store."""

    def __init__(self, store: MissionStore) -> None:
        self._store = store

    def all(self) -> Mapping[int, GivenMission]:
        """All assignments, by the numbers of their missions."""
        rows = self._store.rows("SELECT id, given FROM mission WHERE given IS NOT NULL ORDER BY id")
        return {row["id"]: form(GivenMission).validate_json(row["given"]) for row in rows}

    def give(self, mission: int, robot: str) -> None:
        """Assigns the mission to a robot."""
        known = self._of(mission)
        again = known.robot is not None and known.robot != robot
        self._put(mission, replace(known, robot=robot, reassigned=known.reassigned + again, blocked=None))

    def progress(self, mission: int, done: int, blocked: str | None) -> None:
        """Notes how many commands are done, and why the one under way cannot begin again (None: it can)."""
        self._put(mission, replace(self._of(mission), done=done, blocked=blocked))

    def hand_back(self, mission: int) -> None:
        """Lets the mission wait for another robot."""
        self._put(mission, replace(self._of(mission), blocked=None))

    def split(self, mission: int, parts: Sequence[int]) -> None:
        """Notes that the mission is done in parts, one after the other."""
        for part, before in zip(parts, (None, *parts), strict=False):
            self._put(part, replace(self._of(part), part_of=mission, follows=before))

    def settle(self) -> None:
        """Ends missions that wait for nothing any more.

        A part ends as a failure where the part before it was not done; a mission in parts ends as its last part did.
        """
        given, states = self.all(), {mission.id: mission for mission in self._store.missions()}
        for number, one in given.items():
            if one.part_of is None or states[one.part_of].state is not MissionState.RUNNING:
                continue
            part, before = states[number], None if one.follows is None else states[one.follows]
            last = not any(other.follows == number for other in given.values())
            if part.state in _FAILED or (last and part.state is MissionState.SUCCESS):
                self._store.finish(one.part_of, part.state, f"mission {number}: {part.message}")
            elif before is not None and before.state in _FAILED:
                message = f"mission {before.id}, which comes before it, was not done"
                self._store.finish(number, MissionState.FAILURE, message)
                self._store.finish(one.part_of, before.state, f"mission {before.id}: {before.message}")

    def judge(self, mission: int, referee: Mapping[str, Any] | None) -> None:
        """Notes the referee's verdict."""
        self._put(mission, replace(self._of(mission), referee=referee))

    def _of(self, mission: int) -> GivenMission:
        return self.all().get(mission, GivenMission())

    def _put(self, mission: int, known: GivenMission) -> None:
        text = form(GivenMission).dump_json(known, exclude_defaults=True).decode()
        with self._store.writing() as connection:
            connection.execute("UPDATE mission SET given = ? WHERE id = ?", (text, mission))
