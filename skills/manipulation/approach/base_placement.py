"""Base placement: poses of the body from which the arm reaches a point on a surface."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skills.api import FreeSpace, Running
from skills.footprint import Footprint, footprint_clear
from skills.geometry import wrap
from skills.navigate.skill import Navigate
from skills.navigate.surroundings import NavigateInputs
from skills.robot import ArmCapabilities, FloatArray, Pose2D
from skills.routine import PlanningAttempt, Routine, RoutineSkill

BEARINGS = 24
"""Number of directions from which a point is approached."""
REACH_WEIGHT = 4.0
COMFORTABLE_BEARING_RAD = 0.35
_MOST_FREE = 40
"""Number of free placements that are considered."""
_MOST_OFFERED = 5
"""Number of placements within reach that are offered."""
_SHORT_M = 0.03
"""Distance by which the robot may stop short of a pose."""
_UNSURE_COST = 0.5
"""Cost of a pose from which the arm does not reach the point when the robot stops short."""


@dataclass(frozen=True)
class BasePlacement:
    """Pose of the body and its cost."""

    pose: Pose2D
    cost: float


def is_comfortable(pose: Pose2D, point_W: tuple[float, float], arm: ArmCapabilities) -> bool:
    """Returns whether the point is ahead of the robot and within the arm's comfortable range of distances."""
    nearest_m, farthest_m = arm.comfortable_m
    dx, dy = point_W[0] - pose.x_m, point_W[1] - pose.y_m
    bearing = wrap(math.atan2(dy, dx) - pose.yaw_rad)
    return nearest_m <= math.hypot(dx, dy) <= farthest_m and abs(bearing) < COMFORTABLE_BEARING_RAD


def free_placements(
    point_W: tuple[float, float],
    here: Pose2D,
    costmap: FreeSpace,
    footprint: Footprint,
    distances_m: Sequence[float],
    best_m: float,
) -> list[BasePlacement]:
    """Returns free poses around a point that face it, the cheapest first; `best_m` is the best distance for the arm."""
    found = []
    for k, distance in itertools.product(range(BEARINGS), distances_m):
        yaw = 2 * math.pi * k / BEARINGS
        pose = Pose2D(point_W[0] - distance * math.cos(yaw), point_W[1] - distance * math.sin(yaw), yaw)
        if footprint_clear(costmap, footprint, pose):
            found.append(BasePlacement(pose, _cost(pose, here, abs(distance - best_m))))
    return sorted(found, key=lambda placement: placement.cost)[:_MOST_FREE]


def reachable_placements(
    free: Sequence[BasePlacement], reach_cost: Callable[[Pose2D], float | None]
) -> list[BasePlacement]:
    """Returns the cheapest placements from which the point is within reach, best first.

    `reach_cost` returns the cost of the reach from a pose, and None when the point is out of reach.
    """
    best = list[BasePlacement]()
    for placement in sorted(free, key=lambda placement: placement.cost):
        if len(best) == _MOST_OFFERED and placement.cost >= best[-1].cost:
            break
        cost = _sure_cost(placement.pose, reach_cost)
        if cost is not None:
            best.append(BasePlacement(placement.pose, placement.cost + REACH_WEIGHT * cost))
            best = sorted(best, key=lambda each: each.cost)[:_MOST_OFFERED]
    return best


def first_reachable_spot(
    before: Sequence[tuple[FloatArray, Sequence[BasePlacement]]],
    reach_cost: Callable[[FloatArray], Callable[[Pose2D], float | None]],
) -> tuple[FloatArray, Sequence[BasePlacement]] | None:
    """Returns the first spot within reach of a free pose, with its placements; else the first spot with a free pose.

    `reach_cost` returns, for a spot, the function from a pose to the cost of the reach. None when no spot has a free
    pose.
    """
    for spot, free in before:
        if near := reachable_placements(free, reach_cost(spot)):
            return spot, near
    return next(((spot, free) for spot, free in before if free), None)


def _sure_cost(pose: Pose2D, reach_cost: Callable[[Pose2D], float | None]) -> float | None:
    """Cost of the reach, also when the robot stops short of the pose; None when the point is out of reach."""
    cost = reach_cost(pose)
    if cost is None:
        return None
    x_m, y_m = pose.x_m - _SHORT_M * math.cos(pose.yaw_rad), pose.y_m - _SHORT_M * math.sin(pose.yaw_rad)
    behind = reach_cost(Pose2D(x_m, y_m, pose.yaw_rad))
    return cost + _UNSURE_COST if behind is None else max(cost, behind)


def _cost(pose: Pose2D, here: Pose2D, off_m: float) -> float:
    """Cost of the distance to drive, of the turn, and of the deviation from the best distance."""
    turn = abs(wrap(pose.yaw_rad - here.yaw_rad))
    drive_m = float(np.hypot(pose.x_m - here.x_m, pose.y_m - here.y_m))
    return drive_m + 0.3 * turn + 4.0 * off_m


def go_to_one(skill: RoutineSkill[Any], goals: Sequence[NavigateInputs]) -> Routine[None]:
    """Drives to the first of the goals to which a path exists. Raises SkillFailure when no goal is reached."""
    *first, last = goals
    for goal in first:
        with PlanningAttempt():
            yield from skill.perform(Navigate(skill.context), goal)
            return
        yield Running("choosing another place to stand")
    yield from skill.perform(Navigate(skill.context), last)
