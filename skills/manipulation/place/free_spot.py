"""Free spots on a surface: seen to be flat and empty, away from the edges."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skills.api import Surface
from skills.geometry import grid_inside
from skills.perception.fitting import LevelPlane
from skills.perception.point_cloud import PointCloud
from skills.perception.surface_segmentation import SurfaceView
from skills.robot import FloatArray

CLEARANCE_M = 0.12
EDGE_M = 0.09
_GRID_M, _ROUNDING_M = 0.04, 1e-6
_ROOM_M = 0.3
"""So much room around a spot is enough: more does not count."""
_ANOTHER_M = 0.2
_SAMPLE_M, _SURVEYED_M = 0.01, 0.01


def spots(surface: Surface) -> FloatArray:
    """Points (N, 2) of a surface at least EDGE_M from its edges, or its middle when it is small."""
    kept = grid_inside(surface.polygon_W, _GRID_M, first_m=EDGE_M, margin_m=_ROUNDING_M - EDGE_M)
    return kept if len(kept) else np.asarray([np.mean(surface.polygon_W, axis=0)])


def clear_spots(candidates: FloatArray, circles_W: Sequence[tuple[float, float, float]]) -> FloatArray:
    """Candidates (N, 2) that lie in none of the circles (x, y, radius)."""
    for x, y, radius_m in circles_W:
        candidates = candidates[np.linalg.norm(candidates - [x, y], axis=1) > radius_m]
    return candidates


def free_spots(view: SurfaceView, candidates: FloatArray, avoid_W: Sequence[FloatArray] = ()) -> FloatArray:
    """Candidates (N, 2) around which the surface is seen, with nothing on it within CLEARANCE_M.

    `avoid_W` holds more points (M, 2) of objects that stand there.
    """
    if len(candidates) == 0 or len(view.plane_points) == 0:
        return np.empty((0, 2))
    from scipy.spatial import cKDTree

    seen = cKDTree(view.plane_points.p_W[:, :2])
    around = np.array([len(found) for found in seen.query_ball_point(candidates, 0.04)])
    things = [cluster.points.p_W[:, :2] for cluster in view.clusters] + list(avoid_W)
    free = around > 15
    if things:
        distance, _ = cKDTree(np.concatenate(things)).query(candidates)
        free &= distance > CLEARANCE_M
    return candidates[free]


def unseen_view(surface: Surface, standing_W: FloatArray) -> SurfaceView:
    """A surface that no picture shows, taken as level at its surveyed height; `standing_W` (N, 3) stands on it.

    It counts as seen but for what is within CLEARANCE_M of those points.
    """
    inside = grid_inside(surface.polygon_W, _SAMPLE_M, margin_m=0.0)
    if len(standing_W):
        inside = inside[np.min(np.linalg.norm(inside[:, None] - standing_W[None, :, :2], axis=2), axis=1) > CLEARANCE_M]
    points = np.column_stack([inside, np.full(len(inside), surface.height_m)])
    plane = LevelPlane((0.0, 0.0), surface.height_m, (0.0, 0.0), _SURVEYED_M)
    unseen = np.zeros((len(points), 2), dtype=np.int64), np.zeros((len(points), 3), dtype=np.uint8)
    return SurfaceView(plane, PointCloud(points, *unseen), ())


def roomiest_first(free: FloatArray, view: SurfaceView, but: Sequence[FloatArray]) -> FloatArray:
    """Free spots (N, 2), those with the most room about them first, and none near the points `but`."""
    for point in but:
        free = free[np.linalg.norm(free - point[:2], axis=1) > _ANOTHER_M]
    things = [cluster.points.p_W[:, :2] for cluster in view.clusters]
    if len(free) == 0 or not things:
        return free
    room_m = [float(np.min(np.linalg.norm(np.concatenate(things) - spot, axis=1))) for spot in free]
    return free[np.argsort(-np.minimum(room_m, _ROOM_M), kind="stable")]


def spaced_spots(free: FloatArray) -> list[FloatArray]:
    """Spots (N, 2) in their order, without those that are near an earlier one."""
    kept = list[FloatArray]()
    for spot in free:
        if all(float(np.linalg.norm(spot - other)) > _ANOTHER_M for other in kept):
            kept.append(spot)
    return kept
