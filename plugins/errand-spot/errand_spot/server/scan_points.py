"""Points of the last scans, and the no-go regions of clients."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from skills.robot import FloatArray, Scan

_HEIGHTS_M: Final = (0.15, 1.0)
_NEAR_M = 2.0
_REMEMBERED_S, _CELL_M, _SEEN_M, _THIN_M, _AROUND_M = 15.0, 0.05, 0.01, 0.12, 0.2
_ROW = 1e7


@dataclass(frozen=True)
class Region:
    """No-go region of a client: corners (N, 2) of its convex outline in `odom`, counter-clockwise; its end."""

    corners_O: FloatArray
    until_s: float


class ScanPoints:
    """Highest points of the last scan up to the body's height; earlier ones below or, if thin, between its beams."""

    def __init__(self) -> None:
        self._scan: Scan | None = None
        self._points = np.empty((0, 5))  # x, y, z in `odom`, their time, and whether they are of something thin
        self.points_O: FloatArray = self._points[:, :2]

    def take(self, scan: Scan | None) -> None:
        """Takes in a scan; nothing without a new one."""
        if scan is None or scan is self._scan:
            return
        points_O = (scan.X_OB @ scan.points_B().T).T
        points_O = points_O[(points_O[:, 2] > _HEIGHTS_M[0]) & (points_O[:, 2] < _HEIGHTS_M[1])]
        away = self._points[:, :3] - (scan.X_OB @ scan.X_BL).translation()
        far_m = np.hypot(away[:, 0], away[:, 1])
        low = away[:, 2] < far_m * math.tan(float(scan.elevations_rad.min())) - _CELL_M
        missed_m = np.abs(away[:, 2:] - far_m[:, None] * np.tan(scan.elevations_rad)).min(axis=1)
        unseen = (far_m < _NEAR_M) & (low | ((missed_m > _SEEN_M) & (self._points[:, 4] > 0.0)))
        kept = self._points[unseen & (self._points[:, 3] > scan.stamp_s - _REMEMBERED_S)]
        highest = points_O[np.argsort(-points_O[:, 2], kind="stable")]
        cells, around = (np.round(highest[:, :2] / size_m) @ [_ROW, 1.0] for size_m in (_CELL_M, _AROUND_M))
        first = np.unique(cells, return_index=True)[1]
        _, top, inverse = np.unique(around, return_index=True, return_inverse=True)
        bottom = len(around) - 1 - np.unique(around[::-1], return_index=True)[1]
        thin = (highest[top, 2] - highest[bottom, 2] < _THIN_M)[inverse][first]
        new = np.column_stack([highest[first], np.full(len(first), scan.stamp_s), thin])
        self._scan, self._points = scan, np.concatenate([kept, new])
        self.points_O = self._points[:, :2]
