"""Standing poses from which a point on a surface is within the arm's reach."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skills.api import Cause, FreeSpace, Running
from skills.geometry import wrap
from skills.navigate.footprint import Footprint, footprint_clear
from skills.navigate.ports import NavigateInputs
from skills.navigate.skill import Navigate
from skills.robot import ArmCapabilities, FloatArray, Pose2D
from skills.routine import Routine, RoutineSkill, SkillFailure

BEARINGS = 24
REACH_WEIGHT = 4.0
COMFORTABLE_BEARING_RAD = 0.35
_LOOKED_AT = 40
_OFFERED = 5
_SHORT_M, _UNSURE_COST = 0.03, 0.5


@dataclass(frozen=True)
class Standing:
    """A pose of the body and what speaks against it."""

    pose: Pose2D
    cost: float


def is_comfortable(pose: Pose2D, point_W: tuple[float, float], arm: ArmCapabilities) -> bool:
    """Returns whether the point lies before the robot at a good distance already."""
    nearest_m, farthest_m = arm.comfortable_m
    dx, dy = point_W[0] - pose.x_m, point_W[1] - pose.y_m
    bearing = wrap(math.atan2(dy, dx) - pose.yaw_rad)
    return nearest_m <= math.hypot(dx, dy) <= farthest_m and abs(bearing) < COMFORTABLE_BEARING_RAD


def free_places(
    point_W: tuple[float, float],
    here: Pose2D,
    costmap: FreeSpace,
    footprint: Footprint,
    distances_m: Sequence[float],
    best_m: float,
) -> list[Standing]:
    """Free poses around point_W that face it, the cheapest first; at a distance of best_m the reach is best."""
    found = []
    for k, distance in itertools.product(range(BEARINGS), distances_m):
        yaw = 2 * math.pi * k / BEARINGS
        pose = Pose2D(point_W[0] - distance * math.cos(yaw), point_W[1] - distance * math.sin(yaw), yaw)
        if footprint_clear(costmap, footprint, pose):
            found.append(Standing(pose, _cost(pose, here, abs(distance - best_m))))
    return sorted(found, key=lambda standing: standing.cost)[:_LOOKED_AT]


def reachable(free: Sequence[Standing], reach_cost: Callable[[Pose2D], float | None]) -> list[Standing]:
    """The best of some places, best first.

    `reach_cost` says how awkward the reach from a pose is, None where the point is out of reach.
    """
    best = list[Standing]()
    for standing in sorted(free, key=lambda standing: standing.cost):
        if len(best) == _OFFERED and standing.cost >= best[-1].cost:
            break
        cost = _sure_cost(standing.pose, reach_cost)
        if cost is not None:
            best.append(Standing(standing.pose, standing.cost + REACH_WEIGHT * cost))
            best = sorted(best, key=lambda each: each.cost)[:_OFFERED]
    return best


def first_reachable_spot(
    before: Sequence[tuple[FloatArray, Sequence[Standing]]],
    reach_cost: Callable[[FloatArray], Callable[[Pose2D], float | None]],
) -> tuple[FloatArray, Sequence[Standing]] | None:
    """First spot that the arm reaches from a free pose, with its poses; else the first spot with a free pose.

    `reach_cost` gives the cost of reaching a spot from a pose. None: no spot has a free pose before it.
    """
    for spot, free in before:
        if near := reachable(free, reach_cost(spot)):
            return spot, near
    return next(((spot, free) for spot, free in before if free), None)


def _sure_cost(pose: Pose2D, reach_cost: Callable[[Pose2D], float | None]) -> float | None:
    """How awkward the reach is where the robot may stop a little short of a pose; None for one out of reach."""
    cost = reach_cost(pose)
    if cost is None:
        return None
    x_m, y_m = pose.x_m - _SHORT_M * math.cos(pose.yaw_rad), pose.y_m - _SHORT_M * math.sin(pose.yaw_rad)
    behind = reach_cost(Pose2D(x_m, y_m, pose.yaw_rad))
    return cost + _UNSURE_COST if behind is None else max(cost, behind)


def _cost(pose: Pose2D, here: Pose2D, off_m: float) -> float:
    """Metres to go, turning, and how far the distance is from the best."""
    turn = abs(wrap(pose.yaw_rad - here.yaw_rad))
    way = float(np.hypot(pose.x_m - here.x_m, pose.y_m - here.y_m))
    return way + 0.3 * turn + 4.0 * off_m


def go_to_one(skill: RoutineSkill[Any], goals: Sequence[NavigateInputs]) -> Routine[None]:
    """Drives to the first of some goals to which there is a path. Raises SkillFailure."""
    for k, goal in enumerate(goals, start=1):
        try:
            yield from skill.perform(Navigate(skill.context), goal)
            return
        except SkillFailure as failure:
            if k == len(goals) or failure.cause is not Cause.PLANNING:
                raise
        yield Running("choosing another place to stand")
