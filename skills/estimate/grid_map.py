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
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, ValidationError

from skills.estimate.compiled import distances
from skills.robot import FloatArray

BoolGrid = NDArray[np.bool_]


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


class _MapFile(BaseModel):
    """The keys of a map_server YAML file, and the band of heights."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    image: str
    resolution: PositiveFloat
    origin: tuple[float, float, float]
    occupied_thresh: float = Field(le=1.0)
    free_thresh: float = Field(ge=0.0)
    negate: float = 0.0
    mode: Any = None
    height_band_m: tuple[float, float] | None = None


def load_grid_map(path: Path) -> GridMap:
    """Read a map_server YAML file and the picture that it names. Raises MapError with file:line and the hint."""
    lines = _key_lines(path)

    def refused(key: str, why: str) -> MapError:
        return MapError(f"{path}:{lines.get(key, 1)}: {key}: {why}")

    try:
        told = _MapFile.model_validate(yaml.safe_load(path.read_text()))
    except ValidationError as error:
        first = error.errors()[0]
        why = f"{first['msg']}; known keys are {', '.join(_MapFile.model_fields)}"
        raise refused(str(first["loc"][0]), why) from error
    if told.origin[2] != 0.0:
        raise refused("origin", "the map is turned; give it again with yaw 0")
    if not told.free_thresh < told.occupied_thresh:
        raise refused("free_thresh", "must lie below occupied_thresh, both in 0..1")
    picture = path.parent / told.image
    grey = cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE) if picture.is_file() else None
    if grey is None:
        raise refused("image", f"no picture can be read from {picture}; put a PGM file there")
    occupied, unknown = _classify(np.asarray(grey, dtype=np.uint8), told)
    return GridMap(occupied, told.resolution, told.origin[:2], unknown, told.height_band_m)


def _key_lines(path: Path) -> dict[str, int]:
    """The 1-based line of each key. Raises MapError when there is no file or it is no YAML mapping."""
    try:
        node = yaml.compose(path.read_text(), Loader=yaml.SafeLoader)
    except OSError as error:
        raise MapError(f"{path}:1: cannot be read ({error.strerror}); check the map's path") from error
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        raise MapError(f"{path}:{line}: {error.problem}; correct the YAML there") from error
    if not isinstance(node, yaml.MappingNode):
        raise MapError(f"{path}:1: must be a mapping with the keys {', '.join(_MapFile.model_fields)}")
    return {key.value: key.start_mark.line + 1 for key, _ in node.value}


def _classify(grey: NDArray[np.uint8], told: _MapFile) -> tuple[BoolGrid, BoolGrid]:
    """Occupied and unknown cells, row 0 at the bottom, by the thresholds of the map_server's trinary mode."""
    share = grey.astype(np.float64) / 255.0
    probability = np.flipud(share if told.negate else 1.0 - share)
    occupied = probability > told.occupied_thresh
    return occupied, ~occupied & (probability >= told.free_thresh)
