"""Unreachable goals: doors that the robot saw closed, and regions that no gap connects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.api import ClearableCostmap, FreeSpace, SkillContext
from skills.doorway import CLOSED_M, FLATTEST_RAD, REACH_M, DoorState, Doorway, look_at_doors
from skills.footprint import Footprint, clearance_on_grid, with_segments
from skills.quantities import Delay, Length, Margin, Turn
from skills.robot import FloatArray, Pose2D

_CELL_M = 0.05
_AROUND_M = 8.0
"""Margin of the ground that is examined about robot and goals."""
_DOOR_M = 2.0
"""Margin of the examined ground about the doors, for detours."""
_NEAR_M = 0.3
"""Radius within which a blocked robot looks for its region."""
_BESIDE_M = (0.4, 0.55, 0.7, 0.9)
"""Distances from a door at which its two sides are looked up."""
_PANEL_M = 0.05
"""Half the thickness of a closed door."""
_JUDGED_M = 1.5
"""Largest distance at which the obstacles in a doorway are trusted."""
_JAMB_M = 0.3
_THROUGH_M = 0.6
"""Length of free ground to both sides of an open door."""
_PERSON_M = np.stack(np.meshgrid(*2 * [np.arange(-0.5, 0.51, _CELL_M)]), axis=-1).reshape(-1, 2)


@dataclass(frozen=True)
class DoorOptions:
    """Detection of closed doors on the map while the robot drives.

    `reach_m` and `flattest_rad`: largest distance and view angle at which a scan is used. `closed_m`: a door counts as
    closed while all its gaps are narrower. `look_s` and `patience_s`: when closed doors leave no path, how often the
    robot looks again, and for how long. `trust_s`: plans avoid a door seen closed at most this long ago. `sure_s`: if
    no path exists, the robot drives to a door whose state was last seen earlier than this before the trip. `opens_s`:
    how long a door with a plug-in may take to open.
    """

    reach_m: Length = REACH_M
    flattest_rad: Turn = FLATTEST_RAD
    closed_m: Margin = CLOSED_M
    patience_s: Delay = 3.0
    look_s: Delay = 1.0
    trust_s: Delay = 120.0
    sure_s: Delay = 60.0
    opens_s: Delay = 15.0


class DoorWatch:
    """Detects closed doors in view, and remembers which doors count as closed on one trip."""

    def __init__(self, context: SkillContext, options: DoorOptions | None = None) -> None:
        self._context, self.options = context, options or DoorOptions()
        self._sure_since_s = context.clock.now() - self.options.sure_s
        self._doubted: frozenset[Doorway] = frozenset()

    @property
    def closed(self) -> tuple[Doorway, ...]:
        """The doors that the robot saw closed on this trip or shortly before, without those in doubt."""
        return tuple(door for door in self._context.doors if self._counts_as_closed(door))

    def _counts_as_closed(self, door: Doorway) -> bool:
        seen = self._context.door_memory.last_seen(door)
        if seen.state is not DoorState.CLOSED or seen.seen_s >= self._sure_since_s:
            return seen.state is DoorState.CLOSED
        return door not in self._doubted and self._context.clock.now() <= seen.seen_s + self.options.trust_s

    def look(self) -> None:
        """Updates the states of the doors in view from the newest scan."""
        context, options = self._context, self.options
        limits = {"reach_m": options.reach_m, "flattest_rad": options.flattest_rad, "closed_m": options.closed_m}
        look_at_doors(context.doors, context.door_memory, context.robot, context.localiser, **limits)

    def doubt(self, doors: Sequence[Doorway]) -> bool:
        """Lets plans pass through those `doors` that the robot has not seen lately, so that it looks at them again.

        Returns whether there are such doors.
        """
        memory = self._context.door_memory
        old = [door for door in doors if memory.last_seen(door).seen_s < self._sure_since_s]
        self._doubted |= frozenset(old)
        self._clear(old)
        return bool(old)

    def costmap(self, costmap: FreeSpace, doors: Sequence[Doorway] | None = None) -> FreeSpace:
        """The costmap with `doors` as obstacles; None stands for the closed doors."""
        if not (panelled := self.closed if doors is None else doors):
            return costmap
        turns = [(door, door.through_rad) for door in panelled]
        panels = [(np.array(d.middle_W), np.array([-np.sin(a), np.cos(a)]), d.width_m) for d, a in turns]
        return with_segments(costmap, panels, _PANEL_M)

    def forget_distant(self, here: Pose2D) -> bool:
        """Clears the costmap in distant doorways once another door is closed; returns whether a cell was cleared.

        A door seen only in part, through another door, may appear to have too narrow a gap.
        """
        closed, place = self.closed, (here.x_m, here.y_m)
        far = [door for door in self._context.doors if door.distance_m(place) > _JUDGED_M and door not in closed]
        return bool(closed) and self._clear(far)

    def detour_margin_m(self, start: Pose2D, goal: Pose2D) -> float:
        """Margin (m) about start and goal whose box contains all doors, for a plan through other doors."""
        places = np.array([[start.x_m, start.y_m], [goal.x_m, goal.y_m]])
        doors_W = np.array([door.middle_W for door in self._context.doors])
        out_m = np.maximum(places.min(axis=0) - doors_W, doors_W - places.max(axis=0))
        return max(_AROUND_M, float(out_m.max()) + _DOOR_M)

    def _clear(self, doors: Sequence[Doorway]) -> bool:
        """Clears the costmap in doorways; returns whether a cell was cleared."""
        costmap, discs = self._context.costmap, [[*door.middle_W, 0.5 * door.width_m + _JAMB_M] for door in doors]
        if not discs or not isinstance(costmap, ClearableCostmap):
            return False
        return bool(costmap.clear_obstacles(np.array(discs)))

    def regions(
        self, footprint: Footprint, here: Pose2D, goals: Sequence[Pose2D], people_W: Sequence[tuple[float, float]] = ()
    ) -> Regions:
        """The regions in which a disc as wide as the robot can move, without people and with all other doors open."""
        closed = self.closed
        axes = [door.axis(_THROUGH_M, 0.5 * _CELL_M) for door in self._context.doors if door not in closed]
        discs = [np.array(place) + _PERSON_M for place in people_W]
        return Regions(
            self.costmap(self._context.free_space()),
            footprint,
            here,
            goals,
            np.concatenate([np.empty((0, 2)), *axes, *discs]),
            np.array([door.middle_W for door in self._context.doors]).reshape(-1, 2),
        )

    def blocking_doors(
        self, footprint: Footprint, here: Pose2D, goals: Sequence[Pose2D], people_W: Sequence[tuple[float, float]] = ()
    ) -> tuple[Doorway, ...]:
        """The closed doors that block every path to the goals; none when a goal is reachable."""
        if not self.closed:
            return ()
        regions = self.regions(footprint, here, goals, people_W)
        return regions.doors_between(self.closed) if regions.cut_off else ()

    def doors_on_path(self, footprint: Footprint, here: Pose2D, goals: Sequence[Pose2D]) -> tuple[Doorway, ...]:
        """The closed doors on possible paths to the goals, even when other doors lead there too."""
        doors, free = self._context.doors, self._context.free_space()
        doors_W = np.array([door.middle_W for door in doors]).reshape(-1, 2)
        regions = Regions(self.costmap(free, doors), footprint, here, goals, np.empty((0, 2)), doors_W)
        return tuple(door for door in regions.doors_between(doors) if door in self.closed)


class Regions:
    """The connected regions of the ground in which a disc as wide as the robot can move.

    A goal outside the robot's region is unreachable; a goal inside may be unreachable too, since the robot is longer
    than wide. The points `free_W` (N, 2) always count as free. The grid includes the ground about the doors at
    `doors_W` (N, 2).
    """

    def __init__(
        self,
        costmap: FreeSpace,
        footprint: Footprint,
        here: Pose2D,
        goals: Sequence[Pose2D],
        free_W: FloatArray,
        doors_W: FloatArray,
    ) -> None:
        self._here, self._goals = here, goals
        places = np.array([[pose.x_m, pose.y_m] for pose in (here, *goals)])
        low = np.vstack([places - _AROUND_M, doors_W - _DOOR_M]).min(axis=0)
        high = np.vstack([places + _AROUND_M, doors_W + _DOOR_M]).max(axis=0)
        self._corner = low
        columns, rows = np.ceil((high - low) / _CELL_M).astype(int).tolist()
        xs, ys = (self._corner[axis] + _CELL_M * np.arange(n) for axis, n in ((0, columns), (1, rows)))
        free = clearance_on_grid(costmap, xs, ys) > footprint.inscribed_m - _CELL_M
        cells = self._cell(free_W)
        free[tuple(cells[np.all((cells >= 0) & (cells < free.shape), axis=1)].T)] = True
        labels = cv2.connectedComponents(free.astype(np.uint8), connectivity=8)[1]
        self._labels: NDArray[np.int64] = labels.astype(np.int64)

    @property
    def cut_off(self) -> bool:
        """Returns whether the robot's region is known and contains none of the goals."""
        here = self._near((self._here.x_m, self._here.y_m))
        return bool(here) and not any(here & self._at((goal.x_m, goal.y_m)) for goal in self._goals)

    def doors_between(self, doors: Sequence[Doorway]) -> tuple[Doorway, ...]:
        """The doors in `doors` that lie on a path from the robot to a goal; none when no path exists."""
        begin = self._near((self._here.x_m, self._here.y_m))
        ends = set[int]().union(*(self._at((goal.x_m, goal.y_m)) for goal in self._goals))
        joins = {door: sides for door in doors if len(sides := self._sides(door)) == 2}
        reached, grown = set(begin), True
        while grown:
            more = {side for sides in joins.values() if sides & reached for side in sides} - reached
            reached, grown = reached | more, bool(more)
        return tuple(_on_a_path(joins, begin | (ends & reached))) if reached & ends else ()

    def _sides(self, door: Doorway) -> frozenset[int]:
        """The regions on both sides of a door."""
        through = np.array([math.cos(door.through_rad), math.sin(door.through_rad)])
        found: list[int] = []
        for sign in (1.0, -1.0):
            beside = (self._at(tuple(door.middle_W + sign * far_m * through)) for far_m in _BESIDE_M)
            found += next((list(labels) for labels in beside if labels), [])
        return frozenset(found)

    def _at(self, place_W: tuple[float, float], off_m: float = 0.0) -> set[int]:
        """The regions at a point, or within `off_m` of the point."""
        ((y, x),) = self._cell(np.array([place_W])).tolist()
        far = round(off_m / _CELL_M)
        near = self._labels[max(0, y - far) : max(0, y + far + 1), max(0, x - far) : max(0, x + far + 1)]
        return set(np.unique(near).tolist()) - {0}

    def _cell(self, places_W: FloatArray) -> NDArray[np.int64]:
        """The (row, column) of each point."""
        return np.asarray(np.round((places_W - self._corner) / _CELL_M)[:, ::-1].astype(np.int64))

    def _near(self, place_W: tuple[float, float]) -> set[int]:
        return self._at(place_W) or self._at(place_W, _NEAR_M)


def _on_a_path(joins: dict[Doorway, frozenset[int]], ends: set[int]) -> dict[Doorway, frozenset[int]]:
    """The doors that remain after those that lead only to dead ends are removed."""
    left = dict(joins)
    while True:
        sides = [side for each in left.values() for side in each]
        dead = {side for side in sides if sides.count(side) == 1} - ends
        rest = {door: each for door, each in left.items() if not each & dead}
        if len(rest) == len(left):
            return rest
        left = rest


def closed_doors_sentence(doors: Sequence[Doorway], goal: Pose2D) -> str:
    """Sentence: "The doors between the hall and the kitchen, and between the kitchen and the study, are closed ..."."""
    between = [f"between the {one} and the {other}" for one, other in (door.between for door in doors)]
    no_path = f"so no path leads to ({goal.x_m:.2f}, {goal.y_m:.2f})"
    if len(between) == 1:
        return f"The door {between[0]} is closed, {no_path}."
    return f"The doors {', '.join(between[:-1])}, and {between[-1]}, are closed, {no_path}."
