"""Objects that touch, told apart by their outline from above: a narrow neck between two parts that bulge.

The outline is eroded until it falls apart; each cell of it goes with the core that is nearest. The parts count as
objects only when each is about convex and the whole is not: a wrench has a neck, too, but its halves are not convex.
Boxes that stand flush, side by side, have no neck and stay one.
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.robot import FloatArray

Labels = NDArray[np.int64]
_CELL_M: Final = 0.004
_BORDER: Final = 4
_MOST_ERODED_M: Final = 0.03
_LEAST_CORE_M2: Final = 0.00008
_LEAST_PART_M2: Final = 0.0003
_FEWEST_POINTS: Final = 40
_CONVEX, _MORE_CONVEX = 0.87, 0.03


def touching_parts(xy: FloatArray) -> tuple[Labels, int]:
    """The objects among points (N, 2) that hang together from above: the label of each point, and their number."""
    cells = np.floor((xy - xy.min(axis=0)) / _CELL_M).astype(np.int64) + _BORDER
    outline = np.zeros(cells.max(axis=0) + _BORDER + 1, dtype=np.uint8)
    outline[cells[:, 0], cells[:, 1]] = 1
    parts, count = _parts(_filled(outline))
    labels = parts[cells[:, 0], cells[:, 1]].astype(np.int64) - 1
    few = count > 1 and int(np.bincount(labels, minlength=count).min()) < _FEWEST_POINTS
    return (np.zeros(len(xy), dtype=np.int64), 1) if few else (labels, count)


def _parts(outline: NDArray[np.uint8]) -> tuple[NDArray[np.int32], int]:
    """The outline's cells labelled from 1 on, 0 outside, and the number of parts; parts are parted further."""
    halves = _halves(outline)
    if not halves:
        return outline.astype(np.int32), 1
    labels, count = np.zeros(outline.shape, dtype=np.int32), 0
    for half in halves:
        own, number = _parts(half)
        labels[own > 0] = own[own > 0] + count
        count += number
    return labels, count


def _halves(outline: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
    """The parts into which the least erosion parts an outline; empty when it is one object."""
    whole = _convexity(outline)
    inside_m = cv2.distanceTransform(outline, cv2.DIST_L2, 5) * _CELL_M
    for eroded_m in np.arange(_CELL_M, _MOST_ERODED_M, _CELL_M):
        count, cores, stats, _ = cv2.connectedComponentsWithStats((inside_m > eroded_m).astype(np.uint8))
        kept = [k for k in range(1, count) if stats[k, cv2.CC_STAT_AREA] * _CELL_M**2 >= _LEAST_CORE_M2]
        if len(kept) < 2:
            continue
        off = np.stack([cv2.distanceTransform((cores != k).astype(np.uint8), cv2.DIST_L2, 5) for k in kept])
        nearest = np.argmin(off, axis=0)
        parts = [((nearest == n) & (outline > 0)).astype(np.uint8) for n in range(len(kept))]
        if all(_is_object(part, max(_CONVEX, whole + _MORE_CONVEX)) for part in parts):
            return parts
    return []


def _is_object(part: NDArray[np.uint8], convex: float) -> bool:
    return int(part.sum()) * _CELL_M**2 >= _LEAST_PART_M2 and _convexity(part) > convex


def _filled(seen: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The cells in which points were seen, with those between them, but without bridges over a gap."""
    closed = cv2.morphologyEx(seen, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)))
    borders, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(cv2.drawContours(np.zeros_like(closed), borders, -1, 1, thickness=cv2.FILLED))


def _convexity(part: NDArray[np.uint8]) -> float:
    """The share of its convex hull that an outline fills."""
    hull = cv2.convexHull(np.argwhere(part).astype(np.float32))
    # the hull passes through the middles of the cells: half a cell is missing all around
    hull_cells = cv2.contourArea(hull) + 0.5 * cv2.arcLength(hull, closed=True) + 1.0
    return float(part.sum()) / max(float(hull_cells), 1.0)
