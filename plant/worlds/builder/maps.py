"""Grids in the form of `map_server`: PGM and YAML."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Bools = NDArray[np.bool_]
FREE, UNKNOWN, OCCUPIED = 254, 205, 0
BANDS_M = {"scan": (0.70, 1.30), "low_scan": (0.27, 0.31), "keepout": (0.05, 1.00)}
"""The heights that each grid speaks of."""


@dataclass(frozen=True)
class Grid:
    """Cell values (rows from the south up), the world position of the south-west corner, and the cell size (m)."""

    cells: NDArray[np.uint8]
    origin_m: tuple[float, float]
    resolution_m: float


def pgm_bytes(grid: Grid) -> bytes:
    """The binary PGM form, north up."""
    rows, columns = grid.cells.shape
    return f"P5\n{columns} {rows}\n255\n".encode() + grid.cells[::-1].tobytes()


def yaml_text(grid: Grid, image: str, band_m: tuple[float, float]) -> str:
    """The YAML beside the PGM."""
    return f"""image: {image}
mode: trinary
resolution: {grid.resolution_m}
origin: [{grid.origin_m[0]}, {grid.origin_m[1]}, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
height_band_m: [{band_m[0]}, {band_m[1]}]
"""
