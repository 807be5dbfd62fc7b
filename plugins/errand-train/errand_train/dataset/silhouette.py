"""Silhouette of an object: the pixels that it would cover alone, also beyond the picture's edge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

from skills.robot import FloatArray, Intrinsics

FunctionT = TypeVar("FunctionT", bound=Callable[..., object])
NEAR_M = 0.05


def _compiled(function: FunctionT) -> FunctionT:
    return cast(FunctionT, numba.njit(cache=True, error_model="numpy")(function))


@dataclass(frozen=True)
class Silhouette:
    """Covered pixels inside the picture, and in all."""

    inside_px: int
    whole_px: int


def project(points_C: FloatArray, camera: Intrinsics) -> FloatArray:
    """Projects points (N, 3) of the camera's frame to pixels (N, 2); whole numbers are pixel centres."""
    z = np.maximum(points_C[:, 2], 1e-6)
    u = camera.fx * points_C[:, 0] / z + camera.cx
    v = camera.fy * points_C[:, 1] / z + camera.cy
    return np.column_stack([u, v])


def silhouette(points_C: FloatArray, faces: NDArray[np.int64], camera: Intrinsics) -> Silhouette:
    """Counts the pixels that a mesh covers. Leaves out triangles that reach behind the camera.

    The canvas extends one picture beyond every edge; pixels still farther out do not count.
    """
    before = np.all(points_C[faces][..., 2] > NEAR_M, axis=1)
    pixels = project(points_C, camera)
    width, height = camera.width, camera.height
    canvas = np.zeros((3 * height, 3 * width), dtype=np.uint8)
    _draw(canvas, pixels[:, 0] + width, pixels[:, 1] + height, faces[before])
    inside = int(canvas[height : 2 * height, width : 2 * width].sum())
    return Silhouette(inside, int(canvas.sum()))


@_compiled
def _draw(canvas: NDArray[np.uint8], u: FloatArray, v: FloatArray, faces: NDArray[np.int64]) -> None:
    """Sets every pixel whose centre lies in a triangle."""
    height, width = canvas.shape
    for t in range(faces.shape[0]):
        x0, x1, x2 = u[faces[t, 0]], u[faces[t, 1]], u[faces[t, 2]]
        y0, y1, y2 = v[faces[t, 0]], v[faces[t, 1]], v[faces[t, 2]]
        top = max(int(np.ceil(min(y0, y1, y2))), 0)
        bottom = min(int(np.floor(max(y0, y1, y2))), height - 1)
        for row in range(top, bottom + 1):
            left, right = 1e9, -1e9
            for a, b, c, d in ((x0, y0, x1, y1), (x1, y1, x2, y2), (x2, y2, x0, y0)):
                if min(b, d) <= row <= max(b, d):
                    if abs(d - b) < 1e-12:
                        left, right = min(left, a, c), max(right, a, c)
                    else:
                        x = a + (row - b) / (d - b) * (c - a)
                        left, right = min(left, x), max(right, x)
            first, last = max(int(np.ceil(left)), 0), min(int(np.floor(right)), width - 1)
            for column in range(first, last + 1):
                canvas[row, column] = 1
