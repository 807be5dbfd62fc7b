"""Writes a mission's notes to the store, one transaction for each tick that brought something new."""

from __future__ import annotations

import json
import math
import sqlite3
from collections.abc import Callable, Mapping
from typing import Any, Final

from executive.mission.request import Request
from executive.run.journal import TickNote
from executive.store.database import transaction
from executive.store.recollection import Recollection
from executive.store.records import pose_text, row_of
from executive.store.values import to_text
from executive.tree.compiler import CompiledTree
from executive.tree.snapshot import Change
from executive.words.slug import slug
from skills.geometry import wrap
from skills.robot import Pose2D

MOVED_M: Final = 0.02
TURNED_RAD: Final = 0.02
_PUT_STEP: Final = "INSERT OR REPLACE INTO step VALUES (?, ?, ?, ?, ?, ?, ?)"
_PUT_VALUE: Final = "INSERT OR REPLACE INTO value VALUES (?, ?, ?)"
_PUT_CHARGE: Final = """
INSERT INTO battery (mission, lowest, last) VALUES (?, ?, ?)
ON CONFLICT (mission) DO UPDATE SET lowest = min(lowest, excluded.lowest), last = excluded.last, ended = NULL
"""
_PUT_POSE: Final = """
INSERT INTO part (mission, robot, pose) VALUES (?, ?, ?) ON CONFLICT (mission, robot) DO UPDATE SET pose = excluded.pose
"""
_PUT_INSTEAD: Final = """
INSERT INTO part (mission, robot, instead) VALUES (?, ?, ?)
ON CONFLICT (mission, robot) DO UPDATE SET instead = excluded.instead
"""
_REPLACED: Final = ("name", "commands", "fingerprint", "sentence", "file", "text")
_REPLACE: Final = f"UPDATE mission SET {', '.join(f'{name} = :{name}' for name in _REPLACED)} WHERE id = :id"


class StoreJournal:
    """Implements `executive.run.journal.Journal`.

    What cannot be written now, since another program holds the store, is written with a later tick: the robot's work
    does not wait for it. `troubles` lists what could not be kept.
    `keep_world` is called before what a tick brought is written, for a simulated world must not lag behind it.
    """

    def __init__(
        self, connection: sqlite3.Connection, mission: int, robot: str | None = None, *, charges: bool = True
    ) -> None:
        """`robot` is the one of several whose part it keeps; `charges` tells whether its battery's is noted, too."""
        self._connection, self._mission, self._robot, self._counts = connection, mission, robot, charges
        self._board: Mapping[str, Any] = {}
        self._written: dict[str, Any] = {}
        self._steps: dict[str, tuple[object, ...]] = {}
        self._values: dict[str, str] = {}
        self._checkpoints: dict[str, str] = {}
        self._pose: Pose2D | None = None
        self._charges: tuple[float, float] | None = None  # the lowest so far, and the last
        self._recollection: Recollection | None = None
        self._request_of: Callable[[CompiledTree], Request] | None = None
        self.keep_world: Callable[[], None] = _no_world
        self.troubles: list[str] = []

    def replaceable(self, request_of: Callable[[CompiledTree], Request]) -> StoreJournal:
        """The journal of a mission whose place another may take; `request_of` gives that one's request."""
        self._request_of = request_of
        return self

    def replaced(self, tree: CompiledTree) -> StoreJournal:
        """Keep the mission that takes this one's place in its stead, with nothing done of it yet."""
        journal = StoreJournal(self._connection, self._mission, self._robot, charges=self._counts)
        journal.troubles, journal.keep_world = self.troubles, self.keep_world
        if self._request_of is None:
            return journal
        request = self._request_of(tree)
        journal.replaceable(self._request_of)
        try:
            with transaction(self._connection):
                for table, key in (("step", "path_id"), ("value", "key")):
                    delete = f"DELETE FROM {table} WHERE mission = ? AND {of_robot(key)}"
                    self._connection.execute(delete, (self._mission, *prefix_of(self._robot)))
                if self._robot is None:
                    self._connection.execute(_REPLACE, {**row_of(request), "id": self._mission})
                else:
                    instead = json.dumps((request.name, request.commands, request.fingerprint))
                    self._connection.execute(_PUT_INSTEAD, (self._mission, self._robot, instead))
        except sqlite3.Error as error:
            self._trouble(f"the mission that took this one's place could not be kept ({error})")
        return journal

    def remembering(self, recollection: Recollection) -> StoreJournal:
        """The journal of a run that goes on from an earlier one: what that knew stays until it has been used."""
        self._recollection = recollection
        return self

    def note(self, note: TickNote) -> None:
        """Keep what a tick brought."""
        self._take_steps(note)
        self._take_values(note.board)
        self._take_charge(note.charge)
        news = bool(self._steps or self._values)
        if news:
            self.keep_world()
        if news or (note.pose is not None and _apart(self._pose, note.pose)):
            self._write(note)

    def _take_steps(self, note: TickNote) -> None:
        for change in note.changes:
            if self._recollection is None or not self._recollection.pending(change.path_id):
                self._checkpoints.pop(change.path_id, None)
                self._steps[change.path_id] = self._row(change, note.now_s, None)
        for path_id, checkpoint in note.checkpoints.items():
            text = json.dumps(dict(checkpoint))
            if self._checkpoints.get(path_id) != text:
                self._checkpoints[path_id] = text
                self._steps[path_id] = (self._mission, path_id, "RUNNING", None, "", text, note.now_s)

    def _row(self, change: Change, now_s: float, checkpoint: str | None) -> tuple[object, ...]:
        after = change.after
        cause = None if after.cause is None else after.cause.name
        return (self._mission, change.path_id, after.status.name, cause, after.message, checkpoint, now_s)

    def _take_values(self, board: Mapping[str, Any]) -> None:
        if board is self._board:
            return
        self._board = board
        for key, value in board.items():
            if key in self._written and self._written[key] is value:
                continue
            self._written[key] = value
            try:
                self._values[key] = to_text(value)
            except TypeError as error:
                self._trouble(f"'{key}': {error}")

    def _take_charge(self, charge: float | None) -> None:
        if charge is not None and self._counts:
            self._charges = (charge if self._charges is None else min(self._charges[0], charge), charge)

    def _write(self, note: TickNote) -> None:
        pose = note.pose or self._pose
        text = None if pose is None else pose_text(pose)
        dropped = () if self._recollection is None else tuple(self._recollection.dropped)
        try:
            with transaction(self._connection):
                run = self._connection.executemany
                run("DELETE FROM step WHERE mission = ? AND path_id = ?", [(self._mission, path) for path in dropped])
                run(_PUT_STEP, self._steps.values())
                run(_PUT_VALUE, [(self._mission, key, value) for key, value in self._values.items()])
                run(_PUT_CHARGE, [] if self._charges is None else [(self._mission, *self._charges)])
                own = text if self._robot is None else None
                self._connection.execute(
                    "UPDATE mission SET clock_s = ?, pose = coalesce(?, pose) WHERE id = ?",
                    (note.now_s, own, self._mission),
                )
                if self._robot is not None and text is not None:
                    self._connection.execute(_PUT_POSE, (self._mission, self._robot, text))
        except sqlite3.Error as error:
            self._trouble(f"the store could not be written ({error})")
            return
        self._steps, self._values, self._pose = {}, {}, pose
        if self._recollection is not None:
            self._recollection.dropped.difference_update(dropped)

    def _trouble(self, sentence: str) -> None:
        if sentence not in self.troubles:
            self.troubles.append(sentence)


def of_robot(column: str) -> str:
    """The SQL condition that a path id or a blackboard key is that of a robot; its values are `prefix_of` the robot."""
    return f"substr({column}, 1, length(?)) = ?"


def prefix_of(robot: str | None) -> tuple[str, str]:
    """How a robot's path ids and blackboard keys begin, twice; those of any robot for None."""
    prefix = "" if robot is None else f"{slug(robot)}/"
    return prefix, prefix


def _no_world() -> None:
    """There is no world to keep: it stays by itself."""


def _apart(before: Pose2D | None, now: Pose2D) -> bool:
    if before is None:
        return True
    turned = wrap(now.yaw_rad - before.yaw_rad)
    return math.hypot(now.x_m - before.x_m, now.y_m - before.y_m) > MOVED_M or abs(turned) > TURNED_RAD
