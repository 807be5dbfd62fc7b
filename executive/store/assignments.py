"""Assignments of a store's missions to the robots of a fleet, with the progress of each and the referee's verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from executive.store.database import form
from executive.store.missions import MissionState, MissionStore
from executive.tree.last_known import LastKnown

_FAILED: Final = (MissionState.FAILURE, MissionState.ERROR, MissionState.CANCELLED)


@dataclass(frozen=True)
class GivenMission:
    """Assignment of a mission to a robot of a fleet.

    `robot` is the present or last robot; the mission was passed to another `reassigned` times. The first `done` of its
    commands are done and are not repeated; `blocked` is the reason why the mission cannot restart from its present
    command. `last_known` is where its robot last knew the object to be. `referee` is the verdict at the end, as JSON
    values.

    A mission that no robot could do alone is split into missions that are `part_of` it; a part that `follows` another
    begins when that one is done.
    """

    robot: str | None = None
    reassigned: int = 0
    done: int = 0
    blocked: str | None = None
    last_known: LastKnown | None = None
    referee: Mapping[str, Any] | None = None
    part_of: int | None = None
    follows: int | None = None


class GivenMissions:
    """Table of the assignments in a store."""

    def __init__(self, store: MissionStore) -> None:
        self._store = store

    def all(self) -> Mapping[int, GivenMission]:
        """Returns all assignments by the numbers of their missions."""
        rows = self._store.rows("SELECT id, given FROM mission WHERE given IS NOT NULL ORDER BY id")
        return {row["id"]: form(GivenMission).validate_json(row["given"]) for row in rows}

    def give(self, mission: int, robot: str) -> None:
        """Assigns the mission to a robot."""
        known = self._of(mission)
        again = known.robot is not None and known.robot != robot
        self._put(mission, replace(known, robot=robot, reassigned=known.reassigned + again, blocked=None))

    def progress(self, mission: int, done: int, blocked: str | None) -> None:
        """Notes how many commands are done, and why the present one cannot be restarted (None: it can)."""
        self._put(mission, replace(self._of(mission), done=done, blocked=blocked))

    def hand_back(self, mission: int, last_known: LastKnown | None = None) -> None:
        """Returns the mission, so that it waits for another robot, with what is newly known of its object."""
        known = self._of(mission)
        self._put(mission, replace(known, blocked=None, last_known=last_known or known.last_known))

    def split(self, mission: int, parts: Sequence[int]) -> None:
        """Notes that the mission is split into parts, which run one after the other."""
        for part, before in zip(parts, (None, *parts), strict=False):
            self._put(part, replace(self._of(part), part_of=mission, follows=before))

    def settle(self) -> None:
        """Ends split missions, and parts that can never begin.

        A part fails when the part before it failed; a mission in parts ends like its last part.
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
