"""Table of the robots' estimated poses, their reserved paths, and the right of way."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from skills.robot import FloatArray, Pose2D
from skills.world_model import Neighbour

SILENT_S = 2.0
"""A robot that has not reported for so long (s of the run's clock) loses its claim and its path."""
_ABOUT_M = 0.2
_NOTHING: Final[FloatArray] = np.empty((0, 3))
_LOGGED_EVERY_M = 0.25


@dataclass
class _Robot:
    """Row of the table for one robot, and this robot's view of the table (`skills.world_model.Traffic`).

    `turn` is the robot's place in the order of claims (None: it has no claim). An `idle` robot clears reserved paths.
    """

    table: TrafficTable
    name: str
    discs: FloatArray
    believed: Pose2D | None = None
    stamp_s: float = -np.inf
    path: FloatArray | None = None
    turn: int | None = None
    logged: Mapping[str, Any] | None = None
    idle: bool = False
    _pose: tuple[Pose2D, FloatArray] | None = None
    _covered: tuple[FloatArray, FloatArray, FloatArray] | None = None

    @property
    def pose(self) -> FloatArray | None:
        """Estimated pose (x, y, yaw in the world frame); the same array is returned until the pose changes."""
        if self.believed is None:
            return None
        if self._pose is None or self._pose[0] is not self.believed:
            self._pose = self.believed, np.array([self.believed.x_m, self.believed.y_m, self.believed.yaw_rad])
        return self._pose[1]

    def covered_W(self) -> FloatArray:
        """Discs (N, 3) of x, y and radius (m, world frame) that cover the robot with a margin at its pose."""
        if self.pose is None:
            return _NOTHING
        if self._covered is None or self._covered[0] is not self.pose or self._covered[1] is not self.discs:
            c, s = np.cos(self.pose[2]), np.sin(self.pose[2])
            centres = self.pose[:2] + self.discs[:, :2] @ np.array([[c, s], [-s, c]])
            about_W = np.column_stack([centres, self.discs[:, 2] + _ABOUT_M])
            self._covered = self.pose, self.discs, about_W
        return self._covered[2]

    @property
    def silent(self) -> bool:
        """Returns whether the robot has not reported for more than SILENT_S."""
        return self.table.now() - self.stamp_s > SILENT_S

    def claim(self) -> None:
        """Implements `Traffic.claim`."""
        if self.turn is None:
            self.turn = self.table.next_turn()
            self.path = None if self.pose is None else self.pose[None, :]

    def announce(self, path: FloatArray, discs: FloatArray) -> None:
        """Implements `Traffic.announce`."""
        self.path, self.discs = path, discs

    def release(self) -> None:
        """Implements `Traffic.release`."""
        self.path = self.turn = None

    def others(self) -> Sequence[Neighbour]:
        """Implements `Traffic.others`."""
        return tuple(
            Neighbour(
                other.name,
                other.pose,
                other.path,
                other.discs,
                other.stamp_s,
                first=other.goes_before(self),
                yields=self.goes_before(other) and (other.turn is not None or other.idle),
            )
            for other in self.table.others(self.name)
            if other.pose is not None
        )

    def let_pass(self, name: str) -> None:
        """Implements `Traffic.let_pass`."""
        other = self.table.view_of(name)
        if self.turn is not None and other.turn is not None:
            self.turn, other.turn = other.turn, self.turn

    def goes_before(self, other: _Robot) -> bool:
        """Returns whether the robot has the right of way over another: it claimed first, and still reports."""
        if self.turn is None or self.silent:
            return False
        return other.turn is None or other.silent or self.turn < other.turn


class TrafficTable:
    """Table of the robots' claims on paths, in the order of claiming.

    Each robot holds at most one claim. Turns are a strict order, so no two robots wait for each other.
    """

    def __init__(self, outlines: dict[str, FloatArray], now: Callable[[], float]) -> None:
        """`outlines` has each robot's discs (x, y, radius in the body frame); `now` returns the run's clock (s)."""
        self._robots = {name: _Robot(self, name, discs) for name, discs in sorted(outlines.items())}
        self.now, self._turns = now, 0

    def join(self, name: str, discs: FloatArray) -> None:
        """Adds a robot with its discs (x, y, radius in the body frame); does nothing for a robot added before."""
        self._robots.setdefault(name, _Robot(self, name, discs))

    def report(self, name: str, pose: Pose2D | None) -> None:
        """Records that a robot reports, and its estimated pose (world frame; None: not localised)."""
        robot = self._robots[name]
        robot.stamp_s = self.now()
        robot.believed = pose or robot.believed

    def rest(self, name: str, *, idle: bool) -> None:
        """Records whether a robot has no work and thus clears paths that others reserve."""
        self._robots[name].idle = idle

    def view_of(self, name: str) -> _Robot:
        """Returns one robot's view of the table."""
        return self._robots[name]

    def next_turn(self) -> int:
        """Returns the turn of the next claim."""
        self._turns += 1
        return self._turns

    def others(self, name: str) -> Sequence[_Robot]:
        """Returns the other robots that still report."""
        return [robot for other, robot in self._robots.items() if other != name and not robot.silent]

    def news(self) -> Iterator[Mapping[str, Any]]:
        """Yields a log message for each robot whose path has changed since the last call; none for a single robot.

        Each message has the robot's name, turn (None: no path is reserved) and path ahead (x, y in m, world frame).
        """
        if len(self._robots) < 2:
            return
        for name, robot in self._robots.items():
            path = np.empty((0, 2)) if robot.path is None or robot.silent else _thinned(robot.path[:, :2])
            x, y = np.round(path, 2).T.tolist()
            message = {"robot": name, "turn": robot.turn if x else None, "x": x, "y": y}
            if message != (robot.logged or {**message, "turn": None, "x": [], "y": []}):
                robot.logged = message
                yield message

    def covered_W(self, name: str) -> FloatArray:
        """Discs (N, 3) of x, y and radius (m, world frame) that cover the other robots with a margin."""
        others = self.others(name)
        return np.vstack([_NOTHING, *(robot.covered_W() for robot in others)]) if others else _NOTHING


def _thinned(points: FloatArray) -> FloatArray:
    """Thins the points (N, 2) of a path to one every 0.25 m, counted from the end of the path.

    Counted from the end, the points stay the same while the path ahead becomes shorter.
    """
    back = points[::-1]
    along_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(back, axis=0), axis=1))])
    cells = (along_m / _LOGGED_EVERY_M).astype(int)
    kept: FloatArray = back[np.concatenate([[True], np.diff(cells) > 0])]
    return kept[::-1]
