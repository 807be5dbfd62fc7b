"""Surveyed occupancy grids in the map_server form (PGM picture and YAML), with their distance field."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from skills.estimate.compiled import distances
from skills.robot import FloatArray

BoolGrid = NDArray[np.bool_]

REQUIRED_KEYS = ("image", "resolution", "origin", "occupied_thresh", "free_thresh")
KNOWN_KEYS = (*REQUIRED_KEYS, "negate", "mode", "height_band_m")


class MapError(ValueError):
    """A map that cannot be used; the text begins with file:line and ends with the hint."""


@dataclass(frozen=True)
class GridMap:
    """An occupancy grid fixed in the world frame, axes parallel to the world's.

    `occupied` and `unknown` are (rows, columns) with row 0 at the smallest y; `origin_m` is the world (x, y) of the
    outer corner of cell [0, 0]. `distance` is the signed distance (m) from each cell's centre to the boundary of the
    occupied cells: positive in the open, negative inside. `height_band_m` is the heights above the floor that the
    grid speaks of, None when its file does not say. Raises ValueError for grids of fewer than 2 x 2 cells.
    """

    occupied: BoolGrid
    resolution_m: float
    origin_m: tuple[float, float]
    unknown: BoolGrid | None = None
    height_band_m: tuple[float, float] | None = None
    distance: NDArray[np.float32] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.occupied.ndim != 2 or min(self.occupied.shape) < 2:
            raise ValueError("GridMap: occupied must be a grid of at least 2 x 2 cells")
        object.__setattr__(self, "distance", signed_distance(self.occupied, self.resolution_m))

    @property
    def size_m(self) -> tuple[float, float]:
        """Extent along x and y, in metres."""
        rows, columns = self.occupied.shape
        return columns * self.resolution_m, rows * self.resolution_m

    def cells(self, points_W: FloatArray) -> NDArray[np.int64]:
        """The (row, column) of each (x, y) row; cells outside the grid are given as they would count on."""
        scaled = (np.asarray(points_W, dtype=np.float64)[:, :2] - self.origin_m) / self.resolution_m
        return np.asarray(np.floor(scaled[:, ::-1]).astype(np.int64))

    def centres(self, cells: NDArray[np.int64]) -> FloatArray:
        """World (x, y) of the centres of (row, column) rows."""
        return np.asarray((cells[:, ::-1] + 0.5) * self.resolution_m + self.origin_m)

    def contains(self, points_W: FloatArray) -> BoolGrid:
        """Whether each (x, y) row lies on the grid."""
        cells = self.cells(points_W)
        return np.asarray(np.all((cells >= 0) & (cells < self.occupied.shape), axis=1))

    def distance_m(self, points_W: FloatArray) -> FloatArray:
        """Signed distance (m) from each (x, y) row to the nearest occupied cell, bilinear between cell centres.

        Off the grid it is minus the distance to the grid: ground that nobody surveyed counts as blocked.
        """
        points = np.ascontiguousarray(points_W, dtype=np.float64)
        return distances(self.distance, self.resolution_m, self.origin_m[0], self.origin_m[1], points)

    def with_unknown_blocked(self) -> GridMap:
        """The same grid with unknown cells counted as occupied, as planning wants it."""
        if self.unknown is None:
            return self
        return GridMap(self.occupied | self.unknown, self.resolution_m, self.origin_m, None, self.height_band_m)


def signed_distance(occupied: BoolGrid, resolution_m: float) -> NDArray[np.float32]:
    """Distance (m) from each cell's centre to the boundary of the occupied cells, negative inside them."""
    if not occupied.any():
        return np.full(occupied.shape, math.hypot(*occupied.shape) * resolution_m, dtype=np.float32)
    outside, inside = (
        cv2.distanceTransform(cells.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        for cells in (~occupied, occupied)
    )
    return np.ascontiguousarray(np.where(occupied, 0.5 - inside, outside - 0.5) * resolution_m, dtype=np.float32)


def load_grid_map(path: Path) -> GridMap:
    """Read a map_server YAML file and the picture that it names. Raises MapError with file:line and the hint."""
    lines = _key_lines(path)
    values = _Values(path, yaml.safe_load(path.read_text()), lines)
    values.refuse_unknown()
    resolution_m = values.positive("resolution")
    x_m, y_m, yaw_rad = values.numbers("origin", 3)
    if yaw_rad != 0.0:
        raise values.error("origin", "the map is turned; give it again with yaw 0")
    occupied, unknown = _classify(_read_picture(values), values)
    band = values.numbers("height_band_m", 2) if "height_band_m" in lines else None
    return GridMap(occupied, resolution_m, (x_m, y_m), unknown, (band[0], band[1]) if band else None)


@dataclass(frozen=True)
class _Values:
    """The mapping of one file, with the line of each key, for errors that name the place."""

    path: Path
    values: dict[str, Any]
    lines: dict[str, int]

    def error(self, key: str, why: str) -> MapError:
        return MapError(f"{self.path}:{self.lines.get(key, 1)}: {key}: {why}")

    def refuse_unknown(self) -> None:
        for key in self.values:
            if key not in KNOWN_KEYS:
                raise self.error(key, f"unknown key; known are {', '.join(KNOWN_KEYS)}")
        for key in REQUIRED_KEYS:
            if key not in self.values:
                raise self.error(key, "missing; add it")

    def numbers(self, key: str, count: int) -> tuple[float, ...]:
        value = self.values[key]
        plain = isinstance(value, list) and len(value) == count and all(isinstance(v, int | float) for v in value)
        if not plain:
            raise self.error(key, f"must be a list of {count} numbers, is {value!r}")
        return tuple(float(v) for v in value)

    def number(self, key: str, default: float | None = None) -> float:
        value = self.values.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise self.error(key, f"must be a number, is {value!r}")
        return float(value)

    def positive(self, key: str) -> float:
        value = self.number(key)
        if value <= 0.0:
            raise self.error(key, f"must be above 0, is {value}")
        return value


def _key_lines(path: Path) -> dict[str, int]:
    """The 1-based line of each key. Raises MapError when there is no file or it is no YAML mapping."""
    try:
        node = yaml.compose(path.read_text(), Loader=yaml.SafeLoader)
    except OSError as error:
        raise MapError(f"{path}:1: cannot be read ({error.strerror}); check the map's path") from error
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        raise MapError(f"{path}:{line}: {error.problem}; mend the YAML there") from error
    if not isinstance(node, yaml.MappingNode):
        raise MapError(f"{path}:1: must be a mapping with the keys {', '.join(REQUIRED_KEYS)}")
    return {key.value: key.start_mark.line + 1 for key, _ in node.value}


def _read_picture(values: _Values) -> NDArray[np.uint8]:
    """The picture that the file names, as grey levels, row 0 at the top."""
    name = values.values["image"]
    if not isinstance(name, str):
        raise values.error("image", f"must be a file name, is {name!r}")
    picture = values.path.parent / name
    grey = cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE) if picture.is_file() else None
    if grey is None:
        raise values.error("image", f"no picture can be read from {picture}; put a PGM file there")
    return np.asarray(grey, dtype=np.uint8)


def _classify(grey: NDArray[np.uint8], values: _Values) -> tuple[BoolGrid, BoolGrid]:
    """Occupied and unknown cells, row 0 at the bottom, by the thresholds of the map_server's trinary mode."""
    share = grey.astype(np.float64) / 255.0
    probability = np.flipud(share if values.number("negate", 0) else 1.0 - share)
    high, low = values.number("occupied_thresh"), values.number("free_thresh")
    if not 0.0 <= low < high <= 1.0:
        raise values.error("free_thresh", f"must lie below occupied_thresh, both in 0..1; are {low} and {high}")
    occupied = probability > high
    return occupied, ~occupied & (probability >= low)
