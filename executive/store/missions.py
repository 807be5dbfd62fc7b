"""Stores missions: requests, states and progress, and the assignment of missions to the robots of a fleet."""

import enum
import sqlite3
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from pydantic import Json

from executive.mission.request import Request
from executive.store.database import STORE_FILE, Database, form
from executive.store.journal import StoreJournal, robot_condition, robot_prefix
from executive.store.recollection import Memory, StepRecord
from executive.tree.board import LastKnown
from executive.words.json_values import from_text
from skills.inputs.errors import InputError, listing
from skills.robot import Pose2D

STORE: Final = Path(".errand") / "missions.sqlite"
"""File of a store in the folder for logs, unless another is given; its folder is hidden."""


def store_in(folder: Path) -> Path:
    """Returns the path of the store in a folder; a store that an earlier version kept beside the logs is found too."""
    former = folder / STORE.name
    return former if former.is_file() else folder / STORE


def utc_now() -> datetime:
    """Time of the wall clock, in UTC."""
    return datetime.now(UTC)


class MissionState(enum.Enum):
    """State of a mission. A mission that is RUNNING although no process runs it was interrupted.

    A STANDING mission never runs itself: each time its trigger fires, a queued copy is added.
    """

    STANDING = "standing"
    QUEUED = "queued"
    RUNNING = "running"
    SUCCESS = "success"
    FAILURE = "failure"
    CANCELLED = "cancelled"
    ERROR = "error"


@dataclass(frozen=True)
class StoredMission:
    """Mission in the store. `starts` counts how often it was started; `clock_s` is the robot's clock at the last note.

    `poses` has each robot's last pose (world frame), `instead` has the corrected requests, both by the robot's name. In
    a copy of a standing mission, `standing` is the standing mission's number, and `why` is what triggered the copy.
    """

    id: int
    state: MissionState
    request: Json[Request]
    queued: bool
    starts: int
    message: str
    clock_s: float | None
    poses: Json[dict[str, Pose2D]]
    instead: Json[dict[str, Request]]
    standing: int | None = None
    why: str = ""


class MissionStore(Database):
    """Open store that holds the missions."""

    kind = STORE_FILE

    def __init__(self, path: Path, *, create: bool = True, now: Callable[[], datetime] = utc_now) -> None:
        """Opens the file; `now` reads the wall clock. Raises InputError when the file is missing or cannot be used."""
        super().__init__(path, create=create)
        self.now = now

    def add(self, request: Request, *, queued: bool) -> StoredMission:
        """Adds a mission that will be run later; returns the mission. The request must be understood already."""
        with self.writing() as connection:
            number = insert(connection, request, state=MissionState.QUEUED, queued=queued)
        return self.mission(number)

    def mission(self, number: int) -> StoredMission:
        """Returns the mission of this number. Raises InputError when there is none."""
        rows = self.rows("SELECT * FROM mission WHERE id = ?", number)
        if not rows:
            known = [str(mission.id) for mission in self.missions()]
            hint = f"known are {listing(known)}" if known else "the store is empty; queue one first"
            raise InputError(f"there is no mission {number}", hint=hint, file=self.path)
        return self._mission(rows[0])

    def missions(self, *states: MissionState) -> tuple[StoredMission, ...]:
        """Returns all missions, or the missions in the given states, in the order in which they were added."""
        found = map(self._mission, self.rows("SELECT * FROM mission ORDER BY id"))
        return tuple(mission for mission in found if not states or mission.state in states)

    def remove(self, number: int) -> None:
        """Removes a mission. Raises InputError when there is none."""
        self.mission(number)
        with self.writing() as connection:
            connection.execute("DELETE FROM mission WHERE id = ?", (number,))

    def begin(self, number: int, request: Request | None = None) -> None:
        """Stores that the mission was started, perhaps with another request: one with the run's own folder."""
        changed = None if request is None else request.to_json()
        self._change("state = 'running', starts = starts + 1, request = coalesce(?, request)", number, changed)

    def undo_begin(self, before: StoredMission) -> None:
        """Restores the earlier state of a mission that could not begin."""
        values = (before.state.value, before.message, before.starts, before.request.to_json())
        self._change("state = ?, message = ?, starts = ?, request = ?", before.id, *values)

    def finish(self, number: int, state: MissionState, message: str) -> None:
        """Stores how the mission ended."""
        values = (state.value, message, self.now().isoformat())
        self._change("state = ?, message = ?, ended = ?", number, *values)

    def _change(self, columns: str, number: int, *values: object) -> None:
        with self.writing() as connection:
            connection.execute(f"UPDATE mission SET {columns} WHERE id = ?", (*values, number))

    def has_steps(self, number: int) -> bool:
        """Returns whether any step of a mission is stored."""
        return bool(self.rows("SELECT 1 FROM step WHERE mission = ? LIMIT 1", number))

    def memory(self, number: int, robot: str | None = None) -> Memory:
        """Reads the state in which a mission was interrupted; the mission's skills must be loaded.

        `robot` names one of several robots. Raises InputError when the state cannot be read.
        """
        own, mission = robot_prefix(robot), self.mission(number)
        steps = self.rows(f"SELECT * FROM step WHERE mission = ? AND {robot_condition('path_id')}", number, *own)
        values = self.rows(f"SELECT key, text FROM value WHERE mission = ? AND {robot_condition('key')}", number, *own)
        try:
            board = {row["key"]: from_text(row["text"]) for row in values}
            records = {row["path_id"]: form(StepRecord).validate_json(row["record"]) for row in steps}
            return Memory(records, board, mission.poses.get(robot or mission.request.robot))
        except ValueError as error:
            hint = f"`errand queue remove {number}`, and give the mission again"
            raise InputError(f"mission {number} cannot be taken up: {error}", hint=hint, file=self.path) from error

    def journal(self, number: int, robot: str | None = None) -> StoreJournal:
        """Opens the journal for a run of a mission, or for the part that one of several robots has.

        Among several robots, the journal stores only the battery of the request's main robot.
        """
        return StoreJournal(self._connection, number, robot, main=self.mission(number).request.robot)

    def place(self, number: int, poses: Mapping[str, Pose2D]) -> None:
        """Stores the poses of robots at the start of a mission (world frame); does not replace poses stored before."""
        known = {**poses, **self.mission(number).poses}
        self._change("poses = ?", number, form(dict[str, Pose2D]).dump_json(known).decode())

    def _mission(self, row: sqlite3.Row) -> StoredMission:
        try:
            mission: StoredMission = form(StoredMission).validate_python(dict(row))
        except ValueError as error:
            raise STORE_FILE.damage_error(self.path, error) from error
        return mission


def insert(connection: sqlite3.Connection, request: Request, *, state: MissionState, **more: object) -> int:
    """Inserts a mission, with values for additional columns; returns the mission's number."""
    values = {"state": state.value, "request": request.to_json(), **more}
    names, marks = ", ".join(values), ", ".join(f":{name}" for name in values)
    return connection.execute(f"INSERT INTO mission ({names}) VALUES ({marks})", values).lastrowid or 0


_FAILED: Final = (MissionState.FAILURE, MissionState.ERROR, MissionState.CANCELLED)


@dataclass(frozen=True)
class GivenMission:
    """Assignment of a mission to a robot of a fleet.

    `robot` is the present or last robot; the mission was passed to another robot `reassigned` times. The first `done`
    commands are finished and are not repeated; `blocked` is the reason why the mission cannot restart from the present
    command. `last_known` is where the robot last knew the mission's object. `referee` is the final verdict, as JSON
    values.

    A mission that no robot could do alone is split into parts. In a part, `part_of` is the number of the whole mission,
    and `follows` is the number of the part that must be done first.
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
    """Table of the missions' assignments in a store."""

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
        """Stores the number of finished commands, and why the present command cannot restart (None: it can restart)."""
        self._put(mission, replace(self._of(mission), done=done, blocked=blocked))

    def hand_back(self, mission: int, last_known: LastKnown | None = None) -> None:
        """Returns the mission to the queue for another robot, with the last known place of the mission's object."""
        known = self._of(mission)
        self._put(mission, replace(known, blocked=None, last_known=last_known or known.last_known))

    def split(self, mission: int, parts: Sequence[int]) -> None:
        """Stores that the mission is split into parts, which run one after another."""
        for part, before in zip(parts, (None, *parts), strict=False):
            self._put(part, replace(self._of(part), part_of=mission, follows=before))

    def settle(self) -> None:
        """Ends split missions whose parts have ended, and parts that can never begin.

        A part fails when the part before it failed; a split mission ends as its last part ends.
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
        """Stores the referee's verdict."""
        self._put(mission, replace(self._of(mission), referee=referee))

    def _of(self, mission: int) -> GivenMission:
        return self.all().get(mission, GivenMission())

    def _put(self, mission: int, known: GivenMission) -> None:
        text = form(GivenMission).dump_json(known, exclude_defaults=True).decode()
        with self._store.writing() as connection:
            connection.execute("UPDATE mission SET given = ? WHERE id = ?", (text, mission))
