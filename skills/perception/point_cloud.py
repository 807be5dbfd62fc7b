"""Depth pictures as points with their pixels and colours."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.robot import FloatArray, Image, Intrinsics

MIN_DEPTH_M = 0.15
MAX_DEPTH_M = 4.0


@dataclass(frozen=True)
class PointCloud:
    """Points p_W (N, 3) in m, their pixels (N, 2) as (u, v) in the colour picture, colours (N, 3) RGB uint8."""

    p_W: FloatArray
    pixels: NDArray[np.int64]
    colours: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.p_W)

    def where(self, keep: NDArray[np.bool_]) -> PointCloud:
        """The points that a mask (N,) keeps."""
        return PointCloud(self.p_W[keep], self.pixels[keep], self.colours[keep])


def camera_pose_W(image: Image, X_WO: RigidTransform) -> RigidTransform:
    """X_WC at the picture's capture time."""
    return X_WO @ image.frames.pose(image.camera_frame)


def cloud_from_image(
    image: Image,
    X_WO: RigidTransform,
    max_depth_m: float = MAX_DEPTH_M,
    heights_m: tuple[float, float] = (-math.inf, math.inf),
) -> PointCloud:
    """All valid depth pixels between two heights as world points; those of a grey picture are grey."""
    colour = np.repeat(image.grey[..., None], 3, axis=2) if image.colour is None else image.colour
    depth, X_WC = image.depth_m, camera_pose_W(image, X_WO)
    x_C, y_C = lens_rays(image.depth_intrinsics)
    R_WC, p_WC = X_WC.rotation().matrix(), X_WC.translation()
    height = depth * (R_WC[2, 0] * x_C + R_WC[2, 1] * y_C[:, None] + R_WC[2, 2]).astype(np.float32) + p_WC[2]
    low_m, high_m = heights_m
    kept = (depth > MIN_DEPTH_M) & (depth < max_depth_m) & (height > low_m) & (height < high_m)
    rows, columns = np.nonzero(kept)
    rays = np.column_stack([x_C[columns], y_C[rows]])
    z = depth[kept].astype(np.float64)[:, None]
    p_W = z * (rays @ R_WC[:, :2].T + R_WC[:, 2]) + p_WC
    pixels = _colour_pixels(image, rays)
    return PointCloud(p_W, pixels, colour[pixels[:, 1], pixels[:, 0]])


@lru_cache(maxsize=8)
def lens_rays(lens: Intrinsics) -> tuple[FloatArray, FloatArray]:
    """x/z of each column (W,) and y/z of each row (H,) of a lens."""
    return (np.arange(lens.width, dtype=np.float64) - lens.cx) / lens.fx, (
        np.arange(lens.height, dtype=np.float64) - lens.cy
    ) / lens.fy


def _colour_pixels(image: Image, rays: FloatArray) -> NDArray[np.int64]:
    """Pixels (N, 2) of the colour picture along rays (N, 2) with x/z and y/z."""
    lens = image.intrinsics
    u = np.clip(np.rint(rays[:, 0] * lens.fx + lens.cx), 0, lens.width - 1)
    v = np.clip(np.rint(rays[:, 1] * lens.fy + lens.cy), 0, lens.height - 1)
    return np.stack([u, v], axis=1).astype(np.int64)


def grid_labels(
    xy: FloatArray, cell_m: float, *, fewest: int = 1, dilated: bool = False
) -> tuple[NDArray[np.int32], int]:
    """Points (N, 2) grouped by neighbourhood on a grid: the label of each, 0 for none, and the number of labels.

    Cells with less than `fewest` points are empty; `dilated`, groups also join across a gap of one cell or two.
    """
    cells = np.floor((xy - xy.min(axis=0)) / cell_m).astype(np.int64) + 1
    counts = np.zeros(cells.max(axis=0) + 2, dtype=np.int32)
    np.add.at(counts, (cells[:, 0], cells[:, 1]), 1)
    occupied = (counts >= fewest).astype(np.uint8)
    joined = cv2.dilate(occupied, np.ones((3, 3), np.uint8)) if dilated else occupied
    count, grid = cv2.connectedComponents(joined, connectivity=8)
    return np.asarray(np.where(occupied > 0, grid, 0)[cells[:, 0], cells[:, 1]]), int(count)
