"""Depth pictures as points with their pixels and colours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.robot import FloatArray, Image

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


def cloud_from_image(image: Image, X_WO: RigidTransform, max_depth_m: float = MAX_DEPTH_M) -> PointCloud:
    """All valid depth pixels as world points; those of a grey picture are grey."""
    colour = np.repeat(image.grey[..., None], 3, axis=2) if image.colour is None else image.colour
    lens, depth = image.depth_intrinsics, image.depth_m
    rows, columns = np.nonzero((depth > MIN_DEPTH_M) & (depth < max_depth_m))
    z = depth[rows, columns].astype(np.float64)
    x, y = (columns - lens.cx) / lens.fx * z, (rows - lens.cy) / lens.fy * z
    X_WC = camera_pose_W(image, X_WO)
    p_W = np.stack([x, y, z], axis=1) @ X_WC.rotation().matrix().T + X_WC.translation()
    pixels = _colour_pixels(image, np.stack([x / z, y / z], axis=1))
    return PointCloud(p_W, pixels, colour[pixels[:, 1], pixels[:, 0]])


def _colour_pixels(image: Image, rays: FloatArray) -> NDArray[np.int64]:
    """Pixels (N, 2) of the colour picture along rays (N, 2) with x/z and y/z."""
    lens = image.intrinsics
    u = np.clip(np.rint(rays[:, 0] * lens.fx + lens.cx), 0, lens.width - 1)
    v = np.clip(np.rint(rays[:, 1] * lens.fy + lens.cy), 0, lens.height - 1)
    return np.stack([u, v], axis=1).astype(np.int64)
