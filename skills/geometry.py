"""Planar geometry: angles, poses and polygons."""

import math
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from skills.robot import FloatArray, Pose2D
from skills.world_model import FreeSpace

_SIGHT_STEP_M = 0.1
SPOT_EDGE_M: Final = 0.09
"""Distance of a comfortable spot from the edges of a surface."""
_SPOTS_APART_M = 0.04
_ROUNDING_M = 1e-6
AngleT = TypeVar("AngleT", float, FloatArray)


def wrap(angle_rad: AngleT) -> AngleT:
    """Returns the same angle, or angles, in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def compose(X_AB: Pose2D, X_BC: Pose2D) -> Pose2D:
    """Returns X_AC."""
    c, s = math.cos(X_AB.yaw_rad), math.sin(X_AB.yaw_rad)
    x_m = X_AB.x_m + c * X_BC.x_m - s * X_BC.y_m
    y_m = X_AB.y_m + s * X_BC.x_m + c * X_BC.y_m
    return Pose2D(x_m, y_m, wrap(X_AB.yaw_rad + X_BC.yaw_rad))


def inverse(X_AB: Pose2D) -> Pose2D:
    """Returns X_BA."""
    c, s = math.cos(X_AB.yaw_rad), math.sin(X_AB.yaw_rad)
    return Pose2D(-c * X_AB.x_m - s * X_AB.y_m, s * X_AB.x_m - c * X_AB.y_m, -X_AB.yaw_rad)


def relative_pose(X_WA: Pose2D, X_WB: Pose2D) -> Pose2D:
    """Returns X_AB, from the poses of A and B in one frame."""
    return compose(inverse(X_WA), X_WB)


def bearing_rad(here: Pose2D, place_W: tuple[float, float]) -> float:
    """Direction to a point (x, y), relative to the heading of a pose."""
    return wrap(math.atan2(place_W[1] - here.y_m, place_W[0] - here.x_m) - here.yaw_rad)


def facing_poses(point_W: tuple[float, float], here: Pose2D, stand_off_m: float, count: int = 24) -> list[Pose2D]:
    """Returns poses at distance `stand_off_m` from a point that face it, the nearest to `here` first."""
    poses = []
    for k in range(count):
        yaw = math.atan2(point_W[1] - here.y_m, point_W[0] - here.x_m) + 2 * math.pi * k / count
        x, y = point_W[0] - stand_off_m * math.cos(yaw), point_W[1] - stand_off_m * math.sin(yaw)
        poses.append(Pose2D(x, y, wrap(yaw)))
    return sorted(poses, key=lambda pose: math.hypot(pose.x_m - here.x_m, pose.y_m - here.y_m))


def line_of_sight(space: FreeSpace, from_W: FloatArray, points_W: FloatArray, *, beyond_m: float) -> NDArray[np.bool_]:
    """Mask (N,) of the points (N, 2) to which no obstacle blocks the straight line from `from_W` (2,).

    Obstacles within beyond_m of `from_W` do not count.
    """
    offsets = points_W - from_W
    away_m = np.linalg.norm(offsets, axis=1)
    steps_m = np.arange(beyond_m, float(away_m.max(initial=0.0)), _SIGHT_STEP_M)
    lines_W = from_W + steps_m[None, :, None] * (offsets / np.maximum(away_m, 1e-6)[:, None])[:, None]
    is_clear = space.clearance_m(lines_W.reshape(-1, 2)).reshape(len(points_W), len(steps_m)) > 0.0
    return np.asarray((is_clear | (steps_m >= away_m[:, None])).all(axis=1))


def grid_inside(
    polygon: tuple[tuple[float, float], ...], step_m: float, *, first_m: float = 0.0, margin_m: float = 0.0
) -> FloatArray:
    """Points (N, 2) of a grid in a convex polygon grown by margin_m; the grid starts first_m from its lowest corner."""
    corners = np.asarray(polygon, dtype=float)
    axes = (np.arange(a + first_m, b, step_m) for a, b in zip(corners.min(axis=0), corners.max(axis=0), strict=True))
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    return np.asarray(grid[inside_polygon(grid, polygon, margin_m)])


def surface_spots(polygon_W: tuple[tuple[float, float], ...], edge_m: float = SPOT_EDGE_M) -> FloatArray:
    """Points (N, 2) on a convex surface at least edge_m from its edges; its centre when it is small."""
    inside = grid_inside(polygon_W, _SPOTS_APART_M, first_m=edge_m, margin_m=_ROUNDING_M - edge_m)
    return inside if len(inside) else np.asarray([np.mean(polygon_W, axis=0)])


def inside_polygon(
    xy: FloatArray, polygon: tuple[tuple[float, float], ...], margin_m: float = 0.0
) -> NDArray[np.bool_]:
    """Mask (N,) of the rows of xy (N, 2) inside a convex polygon grown by `margin_m`; corners in either order."""
    import shapely  # commands that move nothing do without

    grown = shapely.Polygon(polygon).buffer(margin_m, join_style="mitre", mitre_limit=100.0)
    return np.asarray(shapely.contains_xy(grown, xy))
