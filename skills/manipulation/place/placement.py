"""Placement of a held object: arm angles that put it down on a free spot of a surface."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pydrake.math import RigidTransform

from skills.api import PlanningError, Surface
from skills.geometry import inside_polygon
from skills.manipulation.arm.arm_skill import Goal
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.held_object import LEAST_ABOVE_M, OFF_SURFACE_M, HeldObject
from skills.manipulation.arm.kinematics import ArmModel
from skills.manipulation.arm.motion import ArmPlanner
from skills.robot import FloatArray

_LEAST_BACK_M = 0.08
"""The open hand must be able to draw back from a spot by this distance."""
_MARGIN_RAD = 0.05
"""Distance of the joints from their limits."""
_EDGE_M = 0.1
"""Distance beyond a surface's edge within which an object counts as over the surface."""


@dataclass(frozen=True)
class PrePlacePose:
    """Joint angles (J,) with the object above its spot, and the height (m) of its lowest point over the surface."""

    q_rad: FloatArray
    height_m: float


def above_goal(
    on_top_B: Sequence[FloatArray],
    held: HeldObject,
    planner: ArmPlanner,
    beside: Sequence[Box],
    opening: float,
    takes: Callable[[RigidTransform], bool] = lambda X_BH: True,
    along_rad: float | None = None,
) -> Goal:
    """Returns a goal with the object, upright as before, over the first point of a surface within reach.

    `takes` judges whether the object fits below a hand pose X_BH; a long object may lie along `along_rad` (B). The
    hand, open to `opening`, must be able to leave the object without contact with the boxes `beside` (B). The goal
    raises PlanningError when there is no such point.
    """

    def goal(scene: ArmScene, q: FloatArray) -> FloatArray:
        for (above_m, tilt_rad), p_BT in itertools.product(held.approaches(), on_top_B):
            for X_BH in held.above(p_BT, scene.model.p_BS, above_m, tilt_rad, along_rad):
                solutions = scene.model.inverse(X_BH, margin_rad=_MARGIN_RAD)
                for solution in solutions if len(solutions) and takes(X_BH) else ():
                    q_above = scene.model.turned_near(solution, q)
                    if scene.free(q_above) and _can_put_down(scene, q_above, above_m, planner, beside, opening):
                        return q_above
        raise PlanningError("no free spot is within the arm's reach")

    return goal


def hold_on_path(goal: Goal, box_H: Box) -> Goal:
    """Returns that goal with the object's box in the hand on the path, unless the box is in contact at either end."""

    def chosen(scene: ArmScene, q: FloatArray) -> FloatArray:
        q_goal = goal(scene, q)
        scene.hold([box_H])
        if not (scene.free(q) and scene.free(q_goal)):
            scene.hold(())
        return q_goal

    return chosen


def reaches(model: ArmModel, X_BH: RigidTransform) -> bool:
    """Returns whether the arm reaches a hand pose above a spot and the pose in which the object stands."""
    lowered = RigidTransform(X_BH.rotation(), X_BH.translation() - [0.0, 0.0, LEAST_ABOVE_M])
    return model.reaches(X_BH, _MARGIN_RAD) and model.reaches(lowered, _MARGIN_RAD)


def _can_put_down(
    scene: ArmScene, q_rad: FloatArray, above_m: float, planner: ArmPlanner, beside: Sequence[Box], opening: float
) -> bool:
    """Returns whether the hand can go down to the surface and, with its finger open, draw back again."""
    X_BH = scene.model.X_BH(q_rad)
    lowered = RigidTransform(X_BH.rotation(), X_BH.translation() - [0.0, 0.0, above_m])
    back = lowered @ RigidTransform([-_LEAST_BACK_M, 0.0, 0.0])
    try:
        down = planner.line(scene.model, q_rad, lowered)
        with scene.with_only(beside, opening):
            planner.line(scene.model, down[-1], back, scene)
    except PlanningError:
        return False
    return True


def clear_heights(heights_m: Sequence[float], now_m: float, held_W: FloatArray, surface: Surface) -> Sequence[float]:
    """Returns the body heights (m), always with the first, at which the held object does not press on a surface.

    `held_W` are the object's corners (N, 3) while the body is `now_m` high; the arm stays as it is. Only an object
    above the surface or its edge can come to press on it.
    """
    clearance_m = float(held_W[:, 2].min()) - surface.height_m
    if clearance_m < 0.0 or not inside_polygon(held_W[:, :2], surface.polygon_W, _EDGE_M).any():
        return heights_m
    lowest_m = now_m - clearance_m + OFF_SURFACE_M
    return [*heights_m[:1], *(height_m for height_m in heights_m[1:] if height_m > lowest_m)]
