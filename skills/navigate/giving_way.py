"""Right of way among robots: what the others' bodies and ways take up, where to stop short, and where to step aside.

Prioritised planning (Erdmann and Lozano-Perez, "On Multiple Moving Objects", 1987) with the priority that PIBT inherits
(Okumura, Machida, Defago and Tamura, "Priority Inheritance with Backtracking for Iterative Multi-Agent Path Finding",
2022): who goes first reserves a way even where one stands who goes later, who then has to clear it, and where that one
cannot, the two change turns. Waiting places lie off the union of the ways that are reserved.
"""

from __future__ import annotations

import enum
import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skills.api import FreeSpace, SkillContext
from skills.navigate.footprint import SAFE_MARGIN_M, Footprint, clearance_on_grid, footprint_clearance_m, pose_array
from skills.navigate.obstacles import NoObstacles, with_outlines
from skills.navigate.path import progress_m
from skills.quantities import Count, Delay, Length, Margin
from skills.robot import FloatArray, Pose2D
from skills.stack import LocalController
from skills.traffic import Neighbour

_WAY_STEP_M = 0.12
_CELL_M = 0.1
_YAWS = 8
_SLACK_M = 0.03
_UNSURE_M = 0.04
_AT_ONCE = 200
_ANEW_M = 0.6
_ABOUT_M = 1.2
_BODY_M = 0.3


@dataclass(frozen=True)
class GivingWayOptions:
    """Distances are between outlines (m), times on the robot's clock (s).

    A way that comes within `apart_m` of one that is reserved waits for it, `short_m` before. Who goes first waits for
    one who stands within `room_m` of the next `room_look_m` of its way, for `patience_s` at most; then the two change
    turns. A waiting place lies `aside_m` off reserved ways, and within `reach_m`; so many `places` are tried. The way
    on is looked for every `again_s`, and what robots keep from going counts as failed after `blocked_patience_s`.
    """

    apart_m: Margin = 0.15
    short_m: Length = 0.25
    look_m: Length = 3.0
    room_m: Margin = 0.12
    room_look_m: Length = 0.9
    patience_s: Delay = 20.0
    blocked_patience_s: Delay = 60.0
    aside_m: Margin = 0.25
    reach_m: Length = 9.0
    places: Count = 3
    again_s: Delay = 1.5


class Avoided(enum.Enum):
    """What of the other robots a plan leads around, beside all that stands in the costmap."""

    WAYS = "ways"  # their bodies, and the ways that are reserved against us
    BODIES = "bodies"  # their bodies: the robot stops before a reserved way
    WORKING = "working"  # only those that do not clear a way which is reserved


class GivingWay:
    """One navigation among other robots. With none about, every answer is that of a robot alone."""

    def __init__(self, context: SkillContext, options: GivingWayOptions) -> None:
        self._traffic, self._options = context.traffic, options
        self._clock = context.clock
        self._making_room_since_s: float | None = None

    def begin(self) -> None:
        """Asks for the right to go, from now on."""
        self._traffic.release()
        self._traffic.claim()

    def end(self) -> None:
        """Gives everything back."""
        self._traffic.release()

    def announce(self, follower: LocalController, footprint: Footprint) -> None:
        """Tells what is left of the way."""
        self._traffic.announce(follower.ahead(math.inf), footprint.discs)

    def stand(self, pose: Pose2D, footprint: Footprint) -> None:
        """Tells that the robot stays where it is for now."""
        self._traffic.announce(np.array([[pose.x_m, pose.y_m, pose.yaw_rad]]), footprint.discs)

    def wish(self, pose: Pose2D, goal: Pose2D, footprint: Footprint) -> None:
        """Reserve the goal while there is no way to it, so that one who stands on it and comes later steps aside."""
        self._traffic.announce(pose_array([pose, goal]), footprint.discs)

    def others(self) -> Sequence[Neighbour]:
        """All others that were heard of lately."""
        return self._traffic.others()

    def ahead_of_us(self) -> Sequence[Neighbour]:
        """Those who go first, and go somewhere."""
        return [one for one in self._traffic.others() if one.first and one.path is not None]

    def costmap(self, costmap: FreeSpace, avoided: Avoided) -> FreeSpace:
        """The costmap with that of the others which is to be avoided."""
        others = [one for one in self._traffic.others() if avoided is not Avoided.WORKING or not _will_move(one)]
        with_others = with_outlines(costmap, [(one.discs, one.pose[None, :]) for one in others], _UNSURE_M)
        if avoided is not Avoided.WAYS:
            return with_others
        return with_outlines(with_others, [(one.discs, _thinned(one)) for one in self.ahead_of_us()])

    def less(self, avoided: Avoided) -> Avoided | None:
        """What is avoided instead when there was no way around more; None: nothing less would help."""
        if avoided is Avoided.WAYS and self.ahead_of_us():
            return Avoided.BODIES
        if avoided is not Avoided.WORKING and any(_will_move(one) for one in self._traffic.others()):
            return Avoided.WORKING
        return None

    def let_pass(self, names: Sequence[str]) -> None:
        """Changes turns with robots for which we should have made way and cannot."""
        for name in names:
            self._traffic.let_pass(name)

    def conflict_m(self, follower: LocalController, footprint: Footprint) -> tuple[float, str] | None:
        """How far (m) it is along the path to where it meets a reserved way, and whose; None: it meets none."""
        ahead = follower.ahead(self._options.look_m)
        found: tuple[float, str] | None = None
        for one in self.ahead_of_us():
            ways = with_outlines(NoObstacles(), [(one.discs, _thinned(one))])
            met = np.flatnonzero(footprint_clearance_m(ways, footprint, ahead) < self._options.apart_m)
            if len(met):
                way_m = float(progress_m(ahead)[met[0]])
                found = (way_m, one.name) if found is None or way_m < found[0] else found
        return found

    def room_for(self, follower: LocalController, footprint: Footprint) -> str | None:
        """Who is to make way and stands near ahead, so that we wait a while; None: nobody does.

        Once that has taken too long, turns are changed.
        """
        ahead = follower.ahead(self._options.room_look_m)
        for one in self._traffic.others():
            if not one.yields:
                continue
            body = with_outlines(NoObstacles(), [(one.discs, one.pose[None, :])])
            clearance = footprint_clearance_m(body, footprint, ahead)
            if clearance.min() < min(self._options.room_m, float(clearance[0]) - 0.02):
                now_s = self._clock.now()
                since_s = self._making_room_since_s = self._making_room_since_s or now_s
                if now_s - since_s < self._options.patience_s:
                    return one.name
                self.let_pass([one.name])
                return None
        self._making_room_since_s = None
        return None

    def somebody_goes(self) -> bool:
        """Returns whether another robot is on its way."""
        return any(one.path is not None for one in self._traffic.others())

    def is_robot(self, place_W: tuple[float, float]) -> bool:
        """Returns whether another robot covers a place (x, y), or ends just before it."""
        bodies = self.costmap(NoObstacles(), Avoided.BODIES)
        return bool(bodies.clearance_m(np.array([place_W]))[0] < _BODY_M)

    def name_at(self, place_W: tuple[float, float] | None) -> str | None:
        """The robot that stands about a place (x, y); None: nobody."""
        if place_W is None:
            return None
        about = (one.name for one in self._traffic.others() if math.dist(place_W, one.pose[:2].tolist()) < _ABOUT_M)
        return next(about, None)

    def in_whose_way(self, here: Pose2D, footprint: Footprint) -> Sequence[str]:
        """Those who have reserved a way where the robot stands."""
        return [one.name for one in self.ahead_of_us() if self._in_way_of(one, here, footprint)]

    def _in_way_of(self, one: Neighbour, here: Pose2D, footprint: Footprint) -> bool:
        way = with_outlines(NoObstacles(), [(one.discs, _thinned(one)[1:])])
        return bool(footprint_clearance_m(way, footprint, pose_array([here]))[0] < self._options.apart_m)

    def waiting_place(
        self, costmap: FreeSpace, footprint: Footprint, here: Pose2D, tried: Sequence[Pose2D] = ()
    ) -> Pose2D | None:
        """The nearest pose that can be reached and lies off all reserved ways; None: there is none.

        Places beside those that were `tried` are left out.
        """
        options = self._options
        n = int(2.0 * options.reach_m / _CELL_M) + 1
        axis = np.linspace(-options.reach_m, options.reach_m, n)
        xs, ys = here.x_m + axis, here.y_m + axis
        x, y = np.meshgrid(xs, ys)
        everything = self.costmap(costmap, Avoided.BODIES)
        free = clearance_on_grid(everything, xs, ys) > footprint.inscribed_m + SAFE_MARGIN_M
        ways = with_outlines(NoObstacles(), [(one.discs, _thinned(one)) for one in self.ahead_of_us()])
        aside = clearance_on_grid(ways, xs, ys) > footprint.inscribed_m + options.aside_m
        for other in tried:
            aside &= np.hypot(x - other.x_m, y - other.y_m) > _ANEW_M
        yaws = here.yaw_rad + np.arange(_YAWS) * (2.0 * math.pi / _YAWS)

        def suits(places: FloatArray) -> Pose2D | None:
            poses = np.column_stack([np.repeat(places, _YAWS, axis=0), np.tile(yaws, len(places))])
            room = footprint_clearance_m(everything, footprint, poses) > SAFE_MARGIN_M + _SLACK_M
            good = np.flatnonzero(room & (footprint_clearance_m(ways, footprint, poses) > options.aside_m))
            return Pose2D(*poses[good[0]].tolist()) if len(good) else None

        cells = [cell for cell in reachable(free, (n // 2, n // 2)) if aside[cell] and sum(cell) % 2 == 0]
        rows, columns = np.array(cells, dtype=np.int64).reshape(-1, 2).T
        return first_that_suits(np.column_stack([x[rows, columns], y[rows, columns]]), suits)


def reachable(free: NDArray[np.bool_], begin: tuple[int, int]) -> list[tuple[int, int]]:
    """Cells (row, column) that can be reached over free ones, nearest first. The beginning counts as free."""
    seen, order, queue = {begin}, [begin], deque([begin])
    rows, columns = free.shape
    while queue:
        row, column = queue.popleft()
        for cell in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
            if cell not in seen and 0 <= cell[0] < rows and 0 <= cell[1] < columns and free[cell]:
                seen.add(cell)
                order.append(cell)
                queue.append(cell)
    return order


def first_that_suits(places_W: FloatArray, suits: Callable[[FloatArray], Pose2D | None]) -> Pose2D | None:
    """The first pose that suits at places (N, 2), many of which are looked at together; None: there is none."""
    for begin in range(0, len(places_W), _AT_ONCE):
        if (place := suits(places_W[begin : begin + _AT_ONCE])) is not None:
            return place
    return None


def _will_move(one: Neighbour) -> bool:
    """Returns whether a robot goes on by itself, or clears a way that is reserved against it."""
    return one.yields or (one.first and one.path is not None)


def _thinned(one: Neighbour) -> FloatArray:
    """The poses that a robot still covers: where it is, and its way, not closer than needed."""
    way = one.path if one.path is not None else np.empty((0, 3))
    along = progress_m(way)
    kept, last = [one.pose], -math.inf
    for pose, at in zip(way, along, strict=True):
        if at - last >= _WAY_STEP_M:
            kept.append(pose)
            last = float(at)
    return np.vstack([*kept, way[-1:]])
