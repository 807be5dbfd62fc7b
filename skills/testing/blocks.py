"""A little world of upright blocks, and what rays see of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skills.estimate.compiled import compiled
from skills.estimate.grid_map import GridMap
from skills.robot import FloatArray

Colour = tuple[int, int, int]
FLOOR_COLOUR: Colour = (150, 140, 130)
NOTHING_COLOUR: Colour = (20, 20, 20)


@dataclass(frozen=True)
class Block:
    """An upright block from (x0, y0) to (x1, y1) in the world frame (m), from height z0 to z1, of one colour (RGB).

    A loose one can be taken. Raises ValueError for a block without extent.
    """

    x0: float
    y0: float
    x1: float
    y1: float
    z0: float = 0.0
    z1: float = 2.5
    colour: Colour = (200, 195, 185)
    loose: bool = False

    def __post_init__(self) -> None:
        if not (self.x0 < self.x1 and self.y0 < self.y1 and self.z0 < self.z1):
            raise ValueError(f"{self}: x0 < x1, y0 < y1 and z0 < z1 must hold")

    def holds(self, point_W: FloatArray, margin_m: float = 0.0) -> bool:
        """Returns whether a point (3,) lies in the block, or within a margin of it."""
        low, high = np.array([self.x0, self.y0, self.z0]), np.array([self.x1, self.y1, self.z1])
        return bool(np.all(point_W >= low - margin_m) and np.all(point_W <= high + margin_m))

    def standing_at(self, x: float, y: float, z: float) -> Block:
        """The same block with the middle of its base at (x, y, z)."""
        dx, dy = 0.5 * (self.x1 - self.x0), 0.5 * (self.y1 - self.y0)
        return replace(self, x0=x - dx, y0=y - dy, x1=x + dx, y1=y + dy, z0=z, z1=z + self.z1 - self.z0)


def can_at(x: float, y: float, z: float, colour: Colour = (200, 20, 25)) -> Block:
    """A can, 66 mm across and 115 mm high, that stands at (x, y) on a surface at height z; red by default."""
    return Block(x - 0.033, y - 0.033, x + 0.033, y + 0.033, z, z + 0.115, colour, loose=True)


ROOM: tuple[Block, ...] = (
    Block(-2.1, -2.6, 4.1, -2.5),
    Block(-2.1, 2.5, 4.1, 2.6),
    Block(-2.1, -2.5, -2.0, 2.5),
    Block(4.0, -2.5, 4.1, 2.5),
    Block(1.2, -0.6, 1.8, 0.6, 0.70, 0.75, (130, 90, 60)),  # a table's top, and its four legs
    *(Block(x, y, x + 0.05, y + 0.05, 0.0, 0.70, (90, 60, 40)) for x in (1.2, 1.75) for y in (-0.6, 0.55)),
)
"""A room of 6 m by 5 m with a table 0.75 m high before the origin."""

TABLE_CAN: Block = can_at(1.38, 0.0, 0.75)
"""A red can near the edge of the room's table that faces the origin."""


def block_array(blocks: Sequence[Block]) -> FloatArray:
    """Rows x0, y0, z0, x1, y1, z1 (B, 6)."""
    return np.array([(b.x0, b.y0, b.z0, b.x1, b.y1, b.z1) for b in blocks], dtype=np.float64).reshape(-1, 6)


@compiled
def cast_rays(
    origin: FloatArray, directions: FloatArray, blocks: FloatArray, limit: float
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Distance along each direction (N, 3) to what it meets, and what that is.

    NaN and -1 beyond the limit; the number of the block; -2 for the floor at height 0. Distances count in lengths of
    the direction, so that directions with z = 1 in a camera give depth.
    """
    ranges = np.empty(directions.shape[0])
    hits = np.empty(directions.shape[0], dtype=np.int64)
    for n in range(directions.shape[0]):
        best, hit = limit, -1
        if directions[n, 2] < 0.0 and -origin[2] / directions[n, 2] < best:
            best, hit = -origin[2] / directions[n, 2], -2
        for b in range(blocks.shape[0]):
            near, far = 0.0, best
            for axis in range(3):
                d = directions[n, axis]
                d = d if abs(d) > 1e-12 else 1e-12
                t0 = (blocks[b, axis] - origin[axis]) / d
                t1 = (blocks[b, axis + 3] - origin[axis]) / d
                near, far = max(near, min(t0, t1)), min(far, max(t0, t1))
            if 0.0 < near < far:
                best, hit = near, b
        ranges[n] = best if hit != -1 else np.nan
        hits[n] = hit
    return ranges, hits


def colours_of(blocks: Sequence[Block], hits: NDArray[np.int64]) -> NDArray[np.uint8]:
    """RGB (N, 3) of what rays met."""
    palette = np.array([*(b.colour for b in blocks), FLOOR_COLOUR, NOTHING_COLOUR], dtype=np.uint8)
    index = np.where(hits == -2, len(blocks), np.where(hits == -1, len(blocks) + 1, hits))
    return np.asarray(palette[index])


def grid_of(blocks: Sequence[Block], band_m: tuple[float, float], resolution_m: float = 0.05) -> GridMap:
    """The grid that a surveyor would make of the blocks that stand in a band of heights."""
    x0, y0 = min(b.x0 for b in blocks) - 0.2, min(b.y0 for b in blocks) - 0.2
    columns = math.ceil((max(b.x1 for b in blocks) + 0.2 - x0) / resolution_m)
    rows = math.ceil((max(b.y1 for b in blocks) + 0.2 - y0) / resolution_m)
    x = x0 + (np.arange(columns) + 0.5) * resolution_m
    y = y0 + (np.arange(rows) + 0.5) * resolution_m
    occupied = np.zeros((rows, columns), dtype=np.bool_)
    for b in blocks:
        if b.z0 < band_m[1] and b.z1 > band_m[0]:
            occupied |= ((y > b.y0) & (y < b.y1))[:, None] & ((x > b.x0) & (x < b.x1))[None, :]
    return GridMap(occupied, resolution_m, (x0, y0), height_band_m=band_m)
