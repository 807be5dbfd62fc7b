"""Visibility in depth images: points and surfaces that are seen or hidden, and changes between two images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.api import Surface
from skills.geometry import grid_inside
from skills.perception.point_cloud import Mask, camera_pose_W, project
from skills.robot import FloatArray, Image

_CELL_M = 0.05
_OUT, _HIDDEN, _SEEN = 0, 1, 2
_NEAR_M = 0.04
_NEAR_PER_M = 0.02
_MUCH_HIDDEN = 0.04
_LEAST_DEPTH_M = 0.05
_EDGE_M = 0.05
_PLAIN_M = 2.0
_BEFORE_M = 0.08

APART_S: Final = (0.4, 0.25)
"""Least times between a picture and the next ones that are compared with it."""
LEAST_CHANGED: Final = 24
"""Pixels that change where an object moves; noise changes fewer."""
_TOLERANCE_M = 0.008
_TOLERANCE_PER_M = 0.008
_AROUND_PX = 5
_NEAREST_M = 0.1


def depth_at_points(image: Image, X_WO: RigidTransform, points_W: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Depth of points (N, 3) from the camera (NaN out of view), and depth that the picture has there (NaN: none)."""
    lens, X_CW = image.depth_intrinsics, camera_pose_W(image, X_WO).inverse()
    p_C = points_W @ X_CW.rotation().matrix().T + X_CW.translation()
    p_C[p_C[:, 2] <= _LEAST_DEPTH_M, 2] = np.nan
    with np.errstate(invalid="ignore"):
        u, v = project(p_C, lens)
        rows, columns = image.depth_m.shape[:2]
        inside = (u >= 0) & (u <= columns - 1) & (v >= 0) & (v <= rows - 1)
    seen = np.full(len(points_W), np.nan)
    found = image.depth_m[np.rint(v[inside]).astype(int), np.rint(u[inside]).astype(int)].astype(np.float64)
    seen[inside] = np.where(np.isfinite(found) & (found > 0.0), found, np.nan)
    return np.where(inside, p_C[:, 2], np.nan), seen


def in_plain_view(image: Image, X_WO: RigidTransform, p_W: FloatArray) -> bool:
    """Returns whether a picture should show an object at a point: well inside, near, and with nothing before it."""
    beside = p_W + np.array([[0.0, 0.0, 0.0], *(_EDGE_M * np.eye(3)), *(-_EDGE_M * np.eye(3))])
    depth, seen = depth_at_points(image, X_WO, beside)
    if not np.all(np.isfinite(depth)) or depth[0] > _PLAIN_M:
        return False
    return bool(np.isfinite(seen[0]) and seen[0] > depth[0] - _BEFORE_M)


@dataclass(frozen=True)
class SurfaceShares:
    """Shares of a surface that were seen, were hidden behind something, or were never in view; they add up to 1."""

    seen: float
    hidden: float

    @property
    def out_of_view(self) -> float:
        """Share that no picture showed, or for which there was no depth."""
        return max(0.0, 1.0 - self.seen - self.hidden)

    def __str__(self) -> str:
        unseen = (self.hidden, "hidden"), (self.out_of_view, "out of view")
        parts = [f"{100 * share:.0f} % {how}" for share, how in unseen if share >= 0.005]
        return ", ".join([f"{100 * self.seen:.0f} % seen", *parts])


class Coverage:
    """Coverage of some surfaces over several pictures."""

    def __init__(self, surfaces: Sequence[Surface]) -> None:
        self._points = {surface.name: _cells(surface) for surface in surfaces}
        self._states = {name: np.zeros(len(points), dtype=np.int8) for name, points in self._points.items()}

    def add(self, image: Image, X_WO: RigidTransform) -> None:
        """Adds a picture."""
        for name, points in self._points.items():
            depth, seen = depth_at_points(image, X_WO, points)
            with np.errstate(invalid="ignore"):
                state = np.where(seen < depth - _NEAR_M - _NEAR_PER_M * depth, _HIDDEN, _SEEN)
            state = np.where(np.isfinite(depth) & np.isfinite(seen), state, _OUT)
            self._states[name] = np.maximum(self._states[name], state.astype(np.int8))

    def hidden_middle_W(self) -> Mapping[str, FloatArray]:
        """Middle (3,) of the hidden part of each surface that has a large one, by the surface's name."""
        hidden = {name: self._points[name][states == _HIDDEN] for name, states in self._states.items()}
        large = {n: points for n, points in hidden.items() if len(points) > _MUCH_HIDDEN * len(self._points[n])}
        return {n: points.mean(axis=0) for n, points in large.items()}

    def shares(self) -> Mapping[str, SurfaceShares]:
        """Shares of each surface by its name."""
        return {
            name: SurfaceShares(float(np.mean(states == _SEEN)), float(np.mean(states == _HIDDEN)))
            for name, states in self._states.items()
        }


def _cells(surface: Surface) -> FloatArray:
    """Points (N, 3) all over a surface; its middle when it is small."""
    inside = grid_inside(surface.polygon_W, _CELL_M, first_m=0.5 * _CELL_M)
    xy = inside if len(inside) else np.mean(surface.polygon_W, axis=0)[None]
    return np.column_stack([xy, np.full(len(xy), surface.height_m)])


def is_at_rest(first: Image, second: Image, X_WO: RigidTransform, p_W: FloatArray, within_m: float) -> bool:
    """Returns whether two pictures of a still camera show no change about a point p_W (3,) of the world.

    A pixel has changed when its depth differs by more than noise and than the pixels beside it explain.
    """
    lens, p_C = second.depth_intrinsics, camera_pose_W(second, X_WO).inverse() @ p_W
    z = p_C[2]
    if z < _NEAREST_M or first.depth_m.shape != second.depth_m.shape:
        return True
    half_px, middle = within_m / z * np.array([lens.fx, lens.fy]), np.array(project(p_C, lens))
    (left, top), (right, bottom) = (np.clip(middle + side * half_px, 0, None).astype(int) for side in (-1.0, 1.0))
    before, after = (image.depth_m[top:bottom, left:right] for image in (first, second))
    if before.size == 0:
        return True
    tolerance_m = _TOLERANCE_M + _TOLERANCE_PER_M * z
    differs = _differs(before, after, tolerance_m) | _differs(after, before, tolerance_m)
    near = (np.abs(before - z) < within_m) | (np.abs(after - z) < within_m)
    seen = (before > 0.0) & (after > 0.0)
    return int(np.count_nonzero(differs & near & seen)) < LEAST_CHANGED


def _differs(depth_m: NDArray[np.float32], other_m: NDArray[np.float32], tolerance_m: float) -> Mask:
    """Returns which depths lie beyond all depths that another picture has there and right beside; skips holes."""
    kernel = np.ones((_AROUND_PX, _AROUND_PX), np.uint8)
    least = cv2.erode(np.where(other_m > 0.0, other_m, np.float32(np.inf)), kernel)
    most = cv2.dilate(other_m, kernel)
    return np.asarray((depth_m < least - tolerance_m) | (depth_m > most + tolerance_m))
