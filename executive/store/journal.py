"""Journals a mission into the store, with one transaction for each tick that changed something."""

from __future__ import annotations

import json
import math
import sqlite3
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, Final

from py_trees.common import Status

from executive.mission.request import Request
from executive.run.visitor import Progress, RunVisitor, TickNote
from executive.store.database import form, transaction
from executive.store.recollection import Recollection, StepRecord
from executive.tree.compiler import CompiledTree
from executive.words.json_values import to_text
from executive.words.slug import slug
from skills.geometry import wrap
from skills.robot import Pose2D

MOVED_M: Final = 0.02
TURNED_RAD: Final = 0.02
_PUT_STEP: Final = "INSERT OR REPLACE INTO step (mission, path_id, record) VALUES (?, ?, ?)"
_PUT_VALUE: Final = "INSERT OR REPLACE INTO value (mission, key, text) VALUES (?, ?, ?)"
_NOTE: Final = """
UPDATE mission SET clock_s = :clock_s, poses = json_patch(poses, :poses),
lowest_charge = coalesce(min(lowest_charge, :lowest), lowest_charge, :lowest),
last_charge = coalesce(:last, last_charge), ended = NULL WHERE id = :id
"""


class StoreJournal(RunVisitor):
    """Journal that stores the progress of one robot's mission after each tick.

    While another program locks the store, notes wait for a later tick, and the robot continues. `troubles` lists the
    notes that could not be written. The journal calls `keep_world` before each write, because the stored state of a
    simulated world must not be older than the journal.
    """

    def __init__(self, connection: sqlite3.Connection, mission: int, robot: str | None, *, main: str) -> None:
        """`robot` names the robot to store among several (None: all); the battery of the robot `main` is stored."""
        self._connection, self._mission, self._robot, self._main = connection, mission, robot, main
        self._board: Mapping[str, Any] = {}
        self._written: dict[str, Any] = {}
        self._steps: dict[str, StepRecord] = {}
        self._values: dict[str, str] = {}
        self._checkpoints: dict[str, str] = {}
        self._pose: Pose2D | None = None
        self._charges: tuple[float, float] | None = None  # lowest and last
        self._recollection: Recollection | None = None
        self._request_of: Callable[[CompiledTree], Request] | None = None
        self._tree: CompiledTree | None = None
        self.keep_world: Callable[[], None] = lambda: None
        self.troubles: list[str] = []

    def allow_replacement(self, tree: CompiledTree, request_of: Callable[[CompiledTree], Request]) -> StoreJournal:
        """Allows a correction to replace the mission; `request_of` returns the request to store for the new tree."""
        self._tree, self._request_of = tree, request_of
        return self

    def _replace(self, tree: CompiledTree) -> None:
        """Stores the mission that replaced another, and deletes the steps stored before."""
        self._board, self._written, self._steps, self._values, self._checkpoints = {}, {}, {}, {}, {}
        self._pose = self._charges = self._recollection = None
        if self._request_of is None:
            return
        text = self._request_of(tree).to_json()
        try:
            with transaction(self._connection):
                for table, key in (("step", "path_id"), ("value", "key")):
                    delete = f"DELETE FROM {table} WHERE mission = ? AND {robot_condition(key)}"
                    self._connection.execute(delete, (self._mission, *robot_prefix(self._robot)))
                if self._robot is None:
                    self._connection.execute("UPDATE mission SET request = ? WHERE id = ?", (text, self._mission))
                else:
                    put = "UPDATE mission SET instead = json_set(instead, '$.' || ?, json(?)) WHERE id = ?"
                    self._connection.execute(put, (_json(self._robot), text, self._mission))
        except sqlite3.Error as error:
            self._trouble(f"the mission that took this one's place could not be kept ({error})")

    def use_recollection(self, recollection: Recollection, tree: CompiledTree | None = None) -> StoreJournal:
        """Sets the recollection of an interrupted run; its results stay in the store until they have been used."""
        self._recollection, self._tree = recollection, tree
        return self

    def tick(self, progress: Progress) -> None:
        """Writes the notes from a tick."""
        for name, note in progress.notes.items():
            if self._robot in (None, name):
                self.note(note)

    def note(self, note: TickNote) -> None:
        """Writes the changes that a tick made in the mission."""
        if self._tree is not None and note.tree is not self._tree:
            self._replace(note.tree)
        self._tree = note.tree
        self._take_steps(note)
        self._take_values(note.board)
        if note.charge is not None and self._robot in (None, self._main):
            lowest = note.charge if self._charges is None else min(self._charges[0], note.charge)
            self._charges = lowest, note.charge
        news = bool(self._steps or self._values)
        if news:
            self.keep_world()
        if news or (note.pose is not None and _has_moved(self._pose, note.pose)):
            self._write(note)

    def _take_steps(self, note: TickNote) -> None:
        for change in note.changes:
            if self._recollection is None or self._recollection.result(change.path_id) is None:
                after = change.after
                self._checkpoints.pop(change.path_id, None)
                self._steps[change.path_id] = StepRecord(after.status, after.cause, after.message, note.now_s)
        for path_id, checkpoint in note.checkpoints.items():
            step = StepRecord(Status.RUNNING, None, "", note.now_s, dict(checkpoint))
            text = json.dumps(step.checkpoint)
            if self._checkpoints.get(path_id) != text:
                self._checkpoints[path_id], self._steps[path_id] = text, step

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

    def _write(self, note: TickNote) -> None:
        pose = note.pose or self._pose
        dropped = () if self._recollection is None else tuple(self._recollection.dropped)
        steps = [(self._mission, path, form(StepRecord).dump_json(step).decode()) for path, step in self._steps.items()]
        poses = {} if pose is None else {self._robot or self._main: asdict(pose)}
        lowest, last = self._charges or (None, None)
        values = {"id": self._mission, "clock_s": note.now_s, "lowest": lowest, "last": last, "poses": _json(poses)}
        try:
            with transaction(self._connection):
                run = self._connection.executemany
                run("DELETE FROM step WHERE mission = ? AND path_id = ?", [(self._mission, path) for path in dropped])
                run(_PUT_STEP, steps)
                run(_PUT_VALUE, [(self._mission, key, value) for key, value in self._values.items()])
                self._connection.execute(_NOTE, values)
        except sqlite3.Error as error:
            self._trouble(f"the store could not be written ({error})")
            return
        self._steps, self._values, self._pose = {}, {}, pose
        if self._recollection is not None:
            self._recollection.dropped.difference_update(dropped)

    def _trouble(self, sentence: str) -> None:
        if sentence not in self.troubles:
            self.troubles.append(sentence)


def robot_condition(column: str) -> str:
    """Returns the SQL condition that a column belongs to a robot; `robot_prefix` returns the condition's two values."""
    return f"substr({column}, 1, length(?)) = ?"


def robot_prefix(robot: str | None) -> tuple[str, str]:
    """Returns the prefix of a robot's path ids and blackboard keys, twice; empty for the only robot (None)."""
    prefix = "" if robot is None else f"{slug(robot)}/"
    return prefix, prefix


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)


def _has_moved(before: Pose2D | None, now: Pose2D) -> bool:
    if before is None:
        return True
    turned = wrap(now.yaw_rad - before.yaw_rad)
    return math.hypot(now.x_m - before.x_m, now.y_m - before.y_m) > MOVED_M or abs(turned) > TURNED_RAD
