"""Placement of a held object: free spots on a surface, and arm angles that put the object down on one."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from skills.api import PlanningError, Surface
from skills.geometry import grid_inside, inside_polygon
from skills.manipulation.arm.arm_skill import Goal
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.held_object import LEAST_ABOVE_M, OFF_SURFACE_M, HeldObject
from skills.manipulation.arm.kinematics import ArmModel
from skills.manipulation.arm.motion import ArmPlanner
from skills.perception.fitting import LevelPlane
from skills.perception.point_cloud import PointCloud
from skills.perception.surface_segmentation import SurfaceView
from skills.robot import FloatArray

CLEARANCE_M = 0.12
"""Distance of a free spot from the objects on the surface."""
EDGE_M = 0.09
"""Distance of a spot from the edges of the surface."""
_GRID_M = 0.04
"""Distance between spots."""
_ROUNDING_M = 1e-6
_SEEN_WITHIN_M = 0.04
"""Radius around a spot in which the surface must be seen."""
_LEAST_SEEN = 15
"""Number of points of the surface that must be exceeded around a spot."""
_ENOUGH_CLEARANCE_M = 0.3
"""Distance from objects beyond which a spot gets no better."""
_ANOTHER_M = 0.2
"""Least distance between two spots that are tried after each other."""
_SAMPLE_M = 0.01
"""Distance between the points of a surface that no picture shows."""
_SURVEYED_M = 0.01
"""Uncertainty of a surveyed height."""
_LEAST_BACK_M = 0.08
"""The open hand must be able to draw back from a spot by this distance."""
_MARGIN_RAD = 0.05
"""Distance of the joints from their limits."""
_EDGE_M = 0.1
"""Distance beyond a surface's edge within which an object counts as over the surface."""


def spots(surface: Surface) -> FloatArray:
    """Points (N, 2) of a surface at least EDGE_M from its edges; its middle when it is small."""
    inside = grid_inside(surface.polygon_W, _GRID_M, first_m=EDGE_M, margin_m=_ROUNDING_M - EDGE_M)
    return inside if len(inside) else np.asarray([np.mean(surface.polygon_W, axis=0)])


def clear_spots(candidates: FloatArray, circles_W: Sequence[tuple[float, float, float]]) -> FloatArray:
    """Returns the candidates (N, 2) that lie in none of the circles (x, y, radius)."""
    for x, y, radius_m in circles_W:
        candidates = candidates[np.linalg.norm(candidates - [x, y], axis=1) > radius_m]
    return candidates


def free_spots(view: SurfaceView, candidates: FloatArray, avoid_W: Sequence[FloatArray] = ()) -> FloatArray:
    """Returns the candidates (N, 2) around which the surface is seen, with no object within CLEARANCE_M.

    `avoid_W` holds points (M, 2) of further objects.
    """
    if len(candidates) == 0 or len(view.plane_points) == 0:
        return np.empty((0, 2))
    from scipy.spatial import cKDTree

    seen = cKDTree(view.plane_points.p_W[:, :2])
    around = np.array([len(found) for found in seen.query_ball_point(candidates, _SEEN_WITHIN_M)])
    objects = [cluster.points.p_W[:, :2] for cluster in view.clusters] + list(avoid_W)
    free = around > _LEAST_SEEN
    if objects:
        distance, _ = cKDTree(np.concatenate(objects)).query(candidates)
        free &= distance > CLEARANCE_M
    return candidates[free]


def unseen_view(surface: Surface, standing_W: FloatArray) -> SurfaceView:
    """Returns a level view of a surface that no picture shows; points (N, 3) of objects stand on it.

    The surface counts as seen except within CLEARANCE_M of those points.
    """
    inside = grid_inside(surface.polygon_W, _SAMPLE_M, margin_m=0.0)
    if len(standing_W):
        inside = inside[np.min(np.linalg.norm(inside[:, None] - standing_W[None, :, :2], axis=2), axis=1) > CLEARANCE_M]
    points = np.column_stack([inside, np.full(len(inside), surface.height_m)])
    plane = LevelPlane((0.0, 0.0), surface.height_m, (0.0, 0.0), _SURVEYED_M)
    unseen = np.zeros((len(points), 2), dtype=np.int64), np.zeros((len(points), 3), dtype=np.uint8)
    return SurfaceView(plane, PointCloud(points, *unseen), ())


def clearest_first(free: FloatArray, view: SurfaceView, without: Sequence[FloatArray]) -> FloatArray:
    """Returns free spots (N, 2) by their distance from objects, without those near the points `without`."""
    for point in without:
        free = free[np.linalg.norm(free - point[:2], axis=1) > _ANOTHER_M]
    objects = [cluster.points.p_W[:, :2] for cluster in view.clusters]
    if len(free) == 0 or not objects:
        return free
    clearance_m = [float(np.min(np.linalg.norm(np.concatenate(objects) - spot, axis=1))) for spot in free]
    return free[np.argsort(-np.minimum(clearance_m, _ENOUGH_CLEARANCE_M), kind="stable")]


def spaced_spots(free: FloatArray) -> list[FloatArray]:
    """Returns spots (N, 2) in their order, without those near an earlier one."""
    spaced = list[FloatArray]()
    for spot in free:
        if all(float(np.linalg.norm(spot - other)) > _ANOTHER_M for other in spaced):
            spaced.append(spot)
    return spaced


@dataclass(frozen=True)
class PrePlacePose:
    """Joint angles (J,) with the object above its spot, and the height (m) of its lowest point over the surface."""

    q_rad: FloatArray
    height_m: float


def above_goal(
    on_top_B: Sequence[FloatArray], held: HeldObject, planner: ArmPlanner, beside: Sequence[Box], opening: float
) -> Goal:
    """Returns a goal with the object, upright as before, over the first point of a surface within reach.

    The hand, open to `opening`, must be able to leave the object without contact with the boxes `beside` (B). The goal
    raises PlanningError when there is no such point.
    """

    def goal(scene: ArmScene, q: FloatArray) -> FloatArray:
        for (above_m, tilt_rad), p_BT in itertools.product(held.approaches(), on_top_B):
            for X_BH in held.above(p_BT, scene.model.p_BS, above_m, tilt_rad):
                for solution in scene.model.inverse(X_BH, margin_rad=_MARGIN_RAD):
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
