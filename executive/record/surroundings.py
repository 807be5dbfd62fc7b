"""The map that a log carries, so that it stands alone: the grid as a picture, and where the places are."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np

from executive.words.knowledge import Knowledge
from skills.estimate.grid_map import GridMap

FREE, UNKNOWN, OCCUPIED = 255, 205, 0


def map_message(grid: GridMap, knowledge: Knowledge, *, world: str) -> Mapping[str, Any]:
    """The grid as a grey PNG (first row: largest y), its place in the world frame (m), and the middles of the rooms."""
    grey = np.full(grid.occupied.shape, FREE, np.uint8)
    if grid.unknown is not None:
        grey[grid.unknown] = UNKNOWN
    grey[grid.occupied] = OCCUPIED
    png = cv2.imencode(".png", np.ascontiguousarray(grey[::-1]), [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes()
    width_m, height_m = grid.size_m
    return {
        "world": world,
        "frame_id": "world",
        "resolution_m": grid.resolution_m,
        "origin_m": {"x": grid.origin_m[0], "y": grid.origin_m[1]},
        "size_m": {"x": width_m, "y": height_m},
        "format": "png",
        "data": base64.b64encode(png).decode(),
        "places": [_label(name, place.polygon) for name, place in knowledge.places.items()],
    }


def _label(name: str, polygon: Sequence[tuple[float, float]]) -> dict[str, Any]:
    x, y = np.mean(polygon, axis=0)
    return {"name": name, "x": round(float(x), 3), "y": round(float(y), 3)}
