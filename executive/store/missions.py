"""The missions in the store: what was asked for, their states, and how far each has come."""

from __future__ import annotations

import enum
import fcntl
import json
import os
import sqlite3
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Final, TextIO

from py_trees.common import Status

from executive.mission.request import Request
from executive.store.database import connect, told, transaction
from executive.store.journal import StoreJournal, of_robot, prefix_of
from executive.store.records import (
    Memory,
    Replacement,
    StepRecord,
    pose_of_text,
    pose_text,
    request_of,
    row_of,
)
from executive.store.values import from_text
from skills.api import Cause
from skills.files.errors import InputError, listing
from skills.robot import Pose2D

__all__ = ["MissionState", "MissionStore", "StoredMission", "insert", "utc_now"]


def utc_now() -> datetime:
    """The wall's clock, in UTC."""
    return datetime.now(UTC)


class MissionState(enum.Enum):
    """How far a mission is. RUNNING while no process works on it means: broken off, `errand resume` goes on.

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
    """A mission in the store. `starts` counts how often it was started; `clock_s` and `pose` are the last noted.

    `standing` is the number of the standing mission of which it is a copy, `why` what had that fire.
    """

    id: int
    state: MissionState
    request: Request
    queued: bool
    starts: int
    message: str
    clock_s: float | None
    pose: Pose2D | None
    standing: int | None = None
    why: str = ""


class MissionStore:
    """One store file. Use it as a context manager, or close it."""

    def __init__(self, path: Path, *, create: bool = True, now: Callable[[], datetime] = utc_now) -> None:
        """Open it; `now` is the wall's clock. Raises InputError: there is none, it is locked, damaged, or too new."""
        self.path, self.now = path, now
        self._connection = connect(path, create=create)

    def __enter__(self) -> MissionStore:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close it; idempotent."""
        self._connection.close()

    def add(self, request: Request, *, queued: bool) -> StoredMission:
        """Keep a mission that is still to be run, its request understood."""
        with self.writing() as connection:
            number = insert(connection, "mission", {**row_of(request), "queued": queued, "state": "queued"})
        return self.mission(number)

    def mission(self, number: int) -> StoredMission:
        """The mission of this number. Raises InputError when there is none."""
        rows = self.rows(f"{_MISSIONS} WHERE id = ?", number)
        if not rows:
            known = [str(mission.id) for mission in self.missions()]
            hint = f"known are {listing(known)}" if known else "the store is empty; queue one first"
            raise InputError(f"there is no mission {number}", hint=hint, file=self.path)
        return _mission(rows[0])

    def missions(self, *states: MissionState) -> tuple[StoredMission, ...]:
        """All missions in the order in which they came; only those in some states where given."""
        found = map(_mission, self.rows(f"{_MISSIONS} ORDER BY id"))
        return tuple(mission for mission in found if not states or mission.state in states)

    def remove(self, number: int) -> None:
        """Forget a mission. Raises InputError when there is none."""
        self.mission(number)
        with self.writing() as connection:
            connection.execute("DELETE FROM mission WHERE id = ?", (number,))

    def begin(self, number: int) -> None:
        """The mission is started, or started again."""
        with self.writing() as connection:
            connection.execute("UPDATE mission SET state = 'running', starts = starts + 1 WHERE id = ?", (number,))

    def never_began(self, before: StoredMission) -> None:
        """A mission that was started is as it was `before`: it could not begin."""
        with self.writing() as connection:
            values = (before.state.value, before.message, before.starts, before.id)
            connection.execute("UPDATE mission SET state = ?, message = ?, starts = ? WHERE id = ?", values)

    def finish(self, number: int, state: MissionState, message: str) -> None:
        """The mission has come to an end."""
        with self.writing() as connection:
            ended = (state.value, message, number)
            connection.execute("UPDATE mission SET state = ?, message = ? WHERE id = ?", ended)
            connection.execute("UPDATE battery SET ended = ? WHERE mission = ?", (self.now().isoformat(), number))

    def has_steps(self, number: int) -> bool:
        """Whether anything was done of a mission."""
        return bool(self.rows("SELECT 1 FROM step WHERE mission = ? LIMIT 1", number))

    def memory(self, number: int, robot: str | None = None) -> Memory:
        """All that is known of how far a mission has come, once the skills are loaded that it was done with.

        `robot` is the one of several whose part is meant. Raises InputError: it cannot be read.
        """
        own = prefix_of(robot)
        steps = self.rows(f"SELECT * FROM step WHERE mission = ? AND {of_robot('path_id')}", number, *own)
        values = self.rows(f"SELECT key, text FROM value WHERE mission = ? AND {of_robot('key')}", number, *own)
        try:
            board = {row["key"]: from_text(row["text"]) for row in values}
            pose = self.mission(number).pose if robot is None else self.poses(number).get(robot)
            return Memory({row["path_id"]: _step(row) for row in steps}, board, pose)
        except ValueError as error:
            hint = f"`errand queue remove {number}`, and give the mission again"
            raise InputError(f"mission {number} cannot be taken up: {error}", hint=hint, file=self.path) from error

    def journal(self, number: int, robot: str | None = None) -> StoreJournal:
        """Keeps notes of a mission's run; `robot` is the one of several whose part it keeps.

        Of several batteries, that of the robot that stands for all is noted.
        """
        charges = robot is None or robot == self.mission(number).request.robot
        return StoreJournal(self._connection, number, robot, charges=charges)

    def poses(self, number: int) -> Mapping[str, Pose2D]:
        """Where each of several robots was last in a mission's world, by its name (world frame)."""
        rows = self.rows("SELECT robot, pose FROM part WHERE mission = ? AND pose IS NOT NULL", number)
        return {row["robot"]: Pose2D(*json.loads(row["pose"])) for row in rows}

    def place(self, number: int, poses: Mapping[str, Pose2D]) -> None:
        """Note where several robots are when a mission begins; of a robot that was noted already, that stays."""
        with self.writing() as connection:
            put = "INSERT OR IGNORE INTO part (mission, robot, pose) VALUES (?, ?, ?)"
            connection.executemany(put, [(number, robot, pose_text(pose)) for robot, pose in poses.items()])

    def replacements(self, number: int) -> Mapping[str, Replacement]:
        """What some of several robots do in place of their parts, by a correction."""
        rows = self.rows("SELECT robot, instead FROM part WHERE mission = ? AND instead IS NOT NULL", number)
        told = {row["robot"]: json.loads(row["instead"]) for row in rows}
        return {robot: Replacement(name, tuple(commands), print_) for robot, (name, commands, print_) in told.items()}

    @contextmanager
    def claimed(self) -> Iterator[None]:
        """Only one process at a time runs missions of a store; the claim ends with the process, however that ends.

        Raises InputError: another process runs one.
        """
        with ExitStack() as stack:
            with told(self.path):
                file = stack.enter_context(self.path.with_name(f"{self.path.name}-claim").open("a+"))
                self._claim(file)
            yield

    def _claim(self, file: TextIO) -> None:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            file.seek(0)
            hint = "wait until it is done, or give another folder by --out or another --store"
            what = f"process {file.read() or '?'} runs a mission of this store"
            raise InputError(what, hint=hint, file=self.path) from error
        file.truncate(0)
        file.write(str(os.getpid()))
        file.flush()

    @contextmanager
    def writing(self) -> Iterator[sqlite3.Connection]:
        """The database, for changes of which all are kept or none. Raises InputError: it cannot be written."""
        with told(self.path), transaction(self._connection):
            yield self._connection

    def rows(self, query: str, *values: object) -> list[sqlite3.Row]:
        """What a query finds. Raises InputError: the database cannot be read."""
        with told(self.path):
            cursor = self._connection.cursor()
            cursor.row_factory = sqlite3.Row
            return cursor.execute(query, values).fetchall()


_MISSIONS: Final = "SELECT mission.*, standing, why FROM mission LEFT JOIN origin ON origin.mission = id"


def insert(connection: sqlite3.Connection, table: str, values: Mapping[str, object]) -> int:
    """Add a row of these columns; its number."""
    names, marks = ", ".join(values), ", ".join(f":{name}" for name in values)
    cursor = connection.execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", dict(values))
    return cursor.lastrowid or 0


def _mission(row: sqlite3.Row) -> StoredMission:
    return StoredMission(
        id=row["id"],
        state=MissionState(row["state"]),
        request=request_of(dict(row)),
        queued=bool(row["queued"]),
        starts=row["starts"],
        message=row["message"],
        clock_s=row["clock_s"],
        pose=pose_of_text(row["pose"]),
        standing=row["standing"],
        why=row["why"] or "",
    )


def _step(row: sqlite3.Row) -> StepRecord:
    return StepRecord(
        status=Status[row["status"]],
        cause=None if row["cause"] is None else Cause[row["cause"]],
        message=row["message"],
        clock_s=row["clock_s"],
        checkpoint={} if row["checkpoint"] is None else json.loads(row["checkpoint"]),
    )
