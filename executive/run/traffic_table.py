"""The robots' paths in one place: who is where by its own belief, where it goes, and who goes first."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from skills.robot import FloatArray, Pose2D
from skills.traffic import Neighbour

SILENT_S = 2.0
"""Who was not heard of for so long (s of the run's clock) has no claim and no path any more."""
_ABOUT_M = 0.2
_NOTHING: Final[FloatArray] = np.empty((0, 3))
_TOLD_EVERY_M = 0.25


@dataclass
class _Robot:
    """What is known of one robot, and how it uses the table (`skills.traffic.Traffic`).

    `turn` is its place in the order of claims, None without one. `idle` while it has nothing to do and clears paths
    that others reserve.
    """

    table: TrafficTable
    name: str
    discs: FloatArray
    believed: Pose2D | None = None
    stamp_s: float = -np.inf
    path: FloatArray | None = None
    turn: int | None = None
    told: Mapping[str, Any] | None = None
    idle: bool = False
    _pose: tuple[Pose2D, FloatArray] | None = None
    _covered: tuple[FloatArray, FloatArray, FloatArray] | None = None

    @property
    def pose(self) -> FloatArray | None:
        """Where it believes to be (x, y, yaw in the world), the same array until that changes."""
        if self.believed is None:
            return None
        if self._pose is None or self._pose[0] is not self.believed:
            self._pose = self.believed, np.array([self.believed.x_m, self.believed.y_m, self.believed.yaw_rad])
        return self._pose[1]

    def covered_W(self) -> FloatArray:
        """What it covers where it believes to be: discs (N, 3) of x, y and radius (m, world), a little wider."""
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
        """Returns whether it was not heard of for long."""
        return self.table.now() - self.stamp_s > SILENT_S

    def claim(self) -> None:
        """Sees `Traffic.claim`."""
        if self.turn is None:
            self.turn = self.table.next_turn()
            self.path = None if self.pose is None else self.pose[None, :]

    def announce(self, path: FloatArray, discs: FloatArray) -> None:
        """Sees `Traffic.announce`."""
        self.path, self.discs = path, discs

    def release(self) -> None:
        """Sees `Traffic.release`."""
        self.path = self.turn = None

    def others(self) -> Sequence[Neighbour]:
        """Sees `Traffic.others`."""
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
        """Sees `Traffic.let_pass`."""
        other = self.table.view_of(name)
        if self.turn is not None and other.turn is not None:
            self.turn, other.turn = other.turn, self.turn

    def goes_before(self, other: _Robot) -> bool:
        """Returns whether it has the right of way: it claimed first, and still answers."""
        if self.turn is None or self.silent:
            return False
        return other.turn is None or other.silent or self.turn < other.turn


class TrafficTable:
    """Claims in the order in which they come. Each robot holds one at most, and no two have the same turn.

    Since turns are a strict order, nobody waits for somebody who waits for them.
    """

    def __init__(self, outlines: dict[str, FloatArray], now: Callable[[], float]) -> None:
        """`outlines` are each robot's discs (x, y, radius in the body frame); `now` is the run's clock (s)."""
        self._robots = {name: _Robot(self, name, discs) for name, discs in sorted(outlines.items())}
        self.now, self._turns = now, 0

    def join(self, name: str, discs: FloatArray) -> None:
        """One more robot with its discs (x, y, radius in the body frame); one that is known already stays as it is."""
        self._robots.setdefault(name, _Robot(self, name, discs))

    def heard(self, name: str, pose: Pose2D | None) -> None:
        """A robot still answers, and believes to be at a pose of the world; None: it does not know."""
        robot = self._robots[name]
        robot.stamp_s = self.now()
        robot.believed = pose or robot.believed

    def rest(self, name: str, *, idle: bool) -> None:
        """A robot has nothing to do and clears paths that others reserve, or has work again."""
        self._robots[name].idle = idle

    def view_of(self, name: str) -> _Robot:
        """The table as one robot uses it."""
        return self._robots[name]

    def next_turn(self) -> int:
        """The turn of the next claim."""
        self._turns += 1
        return self._turns

    def others(self, name: str) -> Sequence[_Robot]:
        """The other robots that still answer."""
        return [robot for other, robot in self._robots.items() if other != name and not robot.silent]

    def news(self) -> Iterator[Mapping[str, Any]]:
        """For each robot whose path has changed since the last call: its name, its turn (None: nothing is reserved),
        and the path that lies ahead as points x, y (m in the world), for the log. Of a robot that is alone, nothing.
        """
        if len(self._robots) < 2:
            return
        for name, robot in self._robots.items():
            path = np.empty((0, 2)) if robot.path is None or robot.silent else _thinned(robot.path[:, :2])
            x, y = np.round(path, 2).T.tolist()
            message = {"robot": name, "turn": robot.turn if x else None, "x": x, "y": y}
            if message != (robot.told or {**message, "turn": None, "x": [], "y": []}):
                robot.told = message
                yield message

    def covered_W(self, name: str) -> FloatArray:
        """What the others cover where they believe to be: discs (N, 3) of x, y and radius (m, world), a little wider.

        What a robot sees there is one of them.
        """
        others = self.others(name)
        return np.vstack([_NOTHING, *(robot.covered_W() for robot in others)]) if others else _NOTHING


def _thinned(points: FloatArray) -> FloatArray:
    """Points (N, 2) of a path without those that are nearer than a quarter of a metre to the one before; its end stays.

    Counted from the end, so that a path that grows shorter keeps its points.
    """
    back = points[::-1]
    along_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(back, axis=0), axis=1))])
    cells = (along_m / _TOLD_EVERY_M).astype(int)
    kept: FloatArray = back[np.concatenate([[True], np.diff(cells) > 0])]
    return kept[::-1]
