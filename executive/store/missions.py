"""The missions in the store: what was asked for, their states, and how far each has come."""

from __future__ import annotations

import enum
import sqlite3
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from pydantic import Json

from executive.mission.request import Request
from executive.store.database import STORE_FILE, Database, form
from executive.store.journal import StoreJournal, of_robot, prefix_of
from executive.store.recollection import Memory, StepRecord
from skills.files.errors import InputError, listing
from skills.files.json_values import from_text
from skills.robot import Pose2D

STORE: Final = "missions.sqlite"
"""The name of a store's file unless another is given."""


def utc_now() -> datetime:
    """The wall's clock, in UTC."""
    return datetime.now(UTC)


class MissionState(enum.Enum):
    """The state of a mission. RUNNING while no process works on it means that it was interrupted.

    A STANDING one is never run itself: each time its trigger fires, a queued copy of it is added.
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
    """A mission in the store. `starts` counts how often it was started; `clock_s` is when a note was last written.

    `poses` is where each robot was last (world frame), `instead` what some of several robots do in place of their parts
    by a correction, both by name. `standing` is the number of the standing mission of which it is a copy, `why` what
    had that fire.
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
    """One store file."""

    kind = STORE_FILE

    def __init__(self, path: Path, *, create: bool = True, now: Callable[[], datetime] = utc_now) -> None:
        """Opens it; `now` is the wall's clock. Raises InputError: there is none, or it cannot be used."""
        super().__init__(path, create=create)
        self.now = now

    def add(self, request: Request, *, queued: bool) -> StoredMission:
        """Adds a mission that is still to be run, its request understood."""
        with self.writing() as connection:
            number = insert(connection, request, state=MissionState.QUEUED, queued=queued)
        return self.mission(number)

    def mission(self, number: int) -> StoredMission:
        """The mission of this number. Raises InputError when there is none."""
        rows = self.rows("SELECT * FROM mission WHERE id = ?", number)
        if not rows:
            known = [str(mission.id) for mission in self.missions()]
            hint = f"known are {listing(known)}" if known else "the store is empty; queue one first"
            raise InputError(f"there is no mission {number}", hint=hint, file=self.path)
        return self._mission(rows[0])

    def missions(self, *states: MissionState) -> tuple[StoredMission, ...]:
        """All missions in the order in which they came; only those in some states where given."""
        found = map(self._mission, self.rows("SELECT * FROM mission ORDER BY id"))
        return tuple(mission for mission in found if not states or mission.state in states)

    def remove(self, number: int) -> None:
        """Removes a mission. Raises InputError when there is none."""
        self.mission(number)
        with self.writing() as connection:
            connection.execute("DELETE FROM mission WHERE id = ?", (number,))

    def begin(self, number: int) -> None:
        """Notes that the mission is started, or started again."""
        self._change("state = 'running', starts = starts + 1", number)

    def never_began(self, before: StoredMission) -> None:
        """Puts a mission that could not begin back into the state that it had `before`."""
        values = (before.state.value, before.message, before.starts)
        self._change("state = ?, message = ?, starts = ?", before.id, *values)

    def finish(self, number: int, state: MissionState, message: str) -> None:
        """Notes how the mission ended."""
        values = (state.value, message, self.now().isoformat())
        self._change("state = ?, message = ?, ended = ?", number, *values)

    def _change(self, columns: str, number: int, *values: object) -> None:
        with self.writing() as connection:
            connection.execute(f"UPDATE mission SET {columns} WHERE id = ?", (*values, number))

    def has_steps(self, number: int) -> bool:
        """Returns whether anything was done of a mission."""
        return bool(self.rows("SELECT 1 FROM step WHERE mission = ? LIMIT 1", number))

    def memory(self, number: int, robot: str | None = None) -> Memory:
        """The state in which a mission was interrupted; the skills that it was done with must be loaded.

        `robot` is the one of several whose part is meant. Raises InputError: it cannot be read.
        """
        own, mission = prefix_of(robot), self.mission(number)
        steps = self.rows(f"SELECT * FROM step WHERE mission = ? AND {of_robot('path_id')}", number, *own)
        values = self.rows(f"SELECT key, text FROM value WHERE mission = ? AND {of_robot('key')}", number, *own)
        try:
            board = {row["key"]: from_text(row["text"]) for row in values}
            records = {row["path_id"]: form(StepRecord).validate_json(row["record"]) for row in steps}
            return Memory(records, board, mission.poses.get(robot or mission.request.robot))
        except ValueError as error:
            hint = f"`errand queue remove {number}`, and give the mission again"
            raise InputError(f"mission {number} cannot be taken up: {error}", hint=hint, file=self.path) from error

    def journal(self, number: int, robot: str | None = None) -> StoreJournal:
        """The journal of a mission's run; `robot` is the one of several whose part it keeps.

        Of several batteries, that of the robot that stands for all is noted.
        """
        return StoreJournal(self._connection, number, robot, main=self.mission(number).request.robot)

    def place(self, number: int, poses: Mapping[str, Pose2D]) -> None:
        """Notes where robots are when a mission begins (world frame); an earlier note of a robot stays."""
        known = {**poses, **self.mission(number).poses}
        self._change("poses = ?", number, form(dict[str, Pose2D]).dump_json(known).decode())

    def _mission(self, row: sqlite3.Row) -> StoredMission:
        try:
            mission: StoredMission = form(StoredMission).validate_python(dict(row))
        except ValueError as error:
            raise STORE_FILE.damaged(self.path, error) from error
        return mission


def insert(connection: sqlite3.Connection, request: Request, *, state: MissionState, **more: object) -> int:
    """Adds a mission with values for more columns; its number."""
    values = {"state": state.value, "request": request.to_json(), **more}
    names, marks = ", ".join(values), ", ".join(f":{name}" for name in values)
    return connection.execute(f"INSERT INTO mission ({names}) VALUES ({marks})", values).lastrowid or 0
