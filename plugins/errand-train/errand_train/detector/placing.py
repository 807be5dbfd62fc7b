"""Geometry of pictures on a training canvas, and of their visible labels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from errand_train.detector.labels import LEAST_SEEN, Labels

Floats = NDArray[np.float32]
LEAST_LONG_PX: Final = 10.0
LEAST_SHORT_PX: Final = 4.0


@dataclass(frozen=True)
class Cell:
    """A part of a canvas, in whole pixels: x0 <= x < x1, y0 <= y < y1."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.x1 - self.x0, self.y1 - self.y0

    @property
    def middle(self) -> Floats:
        """Middle (2,)."""
        return np.array([(self.x0 + self.x1) / 2, (self.y0 + self.y1) / 2], dtype=np.float32)


@dataclass(frozen=True)
class Targets:
    """Targets in a canvas: boxes (N, 4) as x0 y0 x1 y1, class indices (N,), and whether to ignore each (N,)."""

    boxes: Floats
    classes: NDArray[np.int64]
    ignored: NDArray[np.bool_]


def similarity_map(focus: Floats, to: Floats, *, angle_rad: float, scale: float, flipped: bool) -> Floats:
    """Affine map (2, 3) that rotates, scales and perhaps mirrors, and moves `focus` to the point `to`."""
    cosine, sine = scale * np.cos(angle_rad), scale * np.sin(angle_rad)
    linear = np.array([[cosine, -sine], [sine, cosine]]) @ np.diag([-1.0 if flipped else 1.0, 1.0])
    return np.concatenate([linear, (to - linear @ focus)[:, None]], axis=1).astype(np.float32)


def place_labels(labels: Labels, affine: Floats, cell: Cell) -> Targets:
    """Places labels by an affine map, cut off at a cell's edges; marks hardly visible and small ones to be ignored."""
    found = [_cut(outline @ affine[:, :2].T + affine[:, 2], cell) for outline in labels.outlines]
    kept = [k for k, one in enumerate(found) if one is not None]
    boxes = np.array([one[0] for one in found if one is not None], dtype=np.float32).reshape(-1, 4)
    shares = np.array([one[1] for one in found if one is not None], dtype=np.float32)
    sides = boxes[:, 2:] - boxes[:, :2]
    small = (sides.max(axis=1, initial=0.0) < LEAST_LONG_PX) | (sides.min(axis=1, initial=np.inf) < LEAST_SHORT_PX)
    hidden = labels.seen[kept] * shares < LEAST_SEEN
    return Targets(boxes, labels.classes[kept], labels.ignored[kept] | small | hidden)


def _cut(outline: Floats, cell: Cell) -> tuple[Floats, float] | None:
    """The box of an outline within the cell, and the share of its area that is inside; None where nothing is."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    if low[0] >= cell.x0 and low[1] >= cell.y0 and high[0] <= cell.x1 and high[1] <= cell.y1:
        return np.concatenate([low, high]), 1.0
    if low[0] >= cell.x1 or low[1] >= cell.y1 or high[0] <= cell.x0 or high[1] <= cell.y0:
        return None
    frame = np.array([[cell.x0, cell.y0], [cell.x1, cell.y0], [cell.x1, cell.y1], [cell.x0, cell.y1]], np.float32)
    outline = np.ascontiguousarray(outline, dtype=np.float32)
    area, inside = cv2.intersectConvexConvex(cv2.convexHull(outline), frame)
    if inside is None or area < 1.0:
        return None
    points = inside.reshape(-1, 2)
    whole = max(float(cv2.contourArea(cv2.convexHull(outline))), 1.0)
    return np.concatenate([points.min(axis=0), points.max(axis=0)]), min(1.0, float(area) / whole)


def join_targets(parts: list[Targets]) -> Targets:
    """Joins the targets of several cells of one canvas."""
    return Targets(
        np.concatenate([part.boxes for part in parts]),
        np.concatenate([part.classes for part in parts]),
        np.concatenate([part.ignored for part in parts]),
    )
