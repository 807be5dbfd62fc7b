"""Surveyed occupancy grids in the map_server form (PGM picture and YAML), with their distance field."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from skills.estimate.compiled import distances
from skills.robot import FloatArray

BoolGrid = NDArray[np.bool_]
MOST_CELLS: Final = 16_000_000
_PGM: Final = re.compile(rb"P[25](?:\s|#[^\n]*\n)+(\d+)(?:\s|#[^\n]*\n)+(\d+)(?:\s|#[^\n]*\n)+(\d+)\s")
_HEAD_BYTES: Final = 4096


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
    resolution: float = Field(ge=0.005, le=1.0)
    origin: tuple[float, float, float]
    occupied_thresh: float = Field(le=1.0)
    free_thresh: float = Field(ge=0.0)
    negate: float = 0.0
    mode: Literal["trinary", "scale"] = "trinary"
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
    if not told.free_thresh < told.occupied_thresh:
        raise refused("free_thresh", "must lie below occupied_thresh, both in 0..1")
    picture = path.parent / told.image
    try:
        occupied, unknown = _classify(_grey(picture), told)
    except (OSError, ValueError, cv2.error) as error:
        raise refused("image", f"no picture can be read from {picture}: {error}") from error
    if told.origin[2] != 0.0:
        return _turned(occupied, unknown, told)
    return GridMap(occupied, told.resolution, told.origin[:2], unknown, told.height_band_m)


def _grey(picture: Path) -> NDArray[np.uint8]:
    """The grey values of a PGM or PNG file, whose head is looked at first. Raises OSError and ValueError."""
    if not picture.is_file():
        raise ValueError("there is no such file; put the map's PGM or PNG there")
    with picture.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    pgm = _PGM.match(head)
    if pgm:
        columns, rows, depth = (int(value) for value in pgm.groups())
    elif head.startswith(b"\x89PNG") and len(head) >= 26:
        columns, rows, depth = int.from_bytes(head[16:20]), int.from_bytes(head[20:24]), 255
        if head[25] != 0:
            raise ValueError("it has colours or is transparent; save it as a grey picture")
    else:
        raise ValueError("it is neither PGM nor PNG; save it as one of these, in grey")
    if not 4 <= rows * columns <= MOST_CELLS:
        raise ValueError(f"it has {columns} x {rows} cells; cut it or make it coarser, to at most {MOST_CELLS}")
    size = picture.stat().st_size
    if pgm and head.startswith(b"P5") and size - pgm.end() != (said := rows * columns * (1 if depth < 256 else 2)):
        raise ValueError(f"it says {columns} x {rows} cells, {said} bytes, and has {size - pgm.end()}; save it again")
    grey = cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE)
    if grey is None or grey.shape != (rows, columns):
        raise ValueError(f"it says {columns} x {rows} cells and is damaged; save it again")
    return np.asarray(grey, dtype=np.uint8)


def _turned(occupied: BoolGrid, unknown: BoolGrid, told: _MapFile) -> GridMap:
    """The grid of a turned map with axes parallel to the world's, in cells half as long, so that thin walls stay."""
    x, y, yaw = told.origin
    c, s = math.cos(yaw), math.sin(yaw)
    rows, columns = occupied.shape
    ends = np.array([(0, 0), (columns, 0), (0, rows), (columns, rows)]) * told.resolution @ np.array([[c, s], [-s, c]])
    low, step = ends.min(axis=0), told.resolution / 2.0
    count = np.ceil((ends.max(axis=0) - low) / step - 1e-6).astype(int)
    if count[0] * count[1] > 4 * MOST_CELLS:
        raise MapError(f"the map at {told.origin} becomes too large when it is turned; cut it")
    across, up = np.meshgrid(*(edge + (np.arange(n) + 0.5) * step for edge, n in zip(low, count, strict=True)))
    column, row = (
        np.floor(along / told.resolution).astype(int) for along in (c * across + s * up, c * up - s * across)
    )
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    column, row = column.clip(0, columns - 1), row.clip(0, rows - 1)
    origin_m = (x + float(low[0]), y + float(low[1]))
    return GridMap(occupied[row, column] & inside, step, origin_m, unknown[row, column] | ~inside, told.height_band_m)


def _key_lines(path: Path) -> dict[str, int]:
    """The 1-based line of each key. Raises MapError when there is no file or it is no YAML mapping."""
    try:
        node = yaml.compose(path.read_text(), Loader=yaml.SafeLoader)
    except OSError as error:
        raise MapError(f"{path}:1: cannot be read ({error.strerror}); check the map's path") from error
    except (UnicodeDecodeError, yaml.reader.ReaderError) as error:
        raise MapError(f"{path}:1: it is no text; give the map's YAML file") from error
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        raise MapError(f"{path}:{line}: {error.problem}; correct the YAML there") from error
    if not isinstance(node, yaml.MappingNode):
        raise MapError(f"{path}:1: must be a mapping with the keys {', '.join(_MapFile.model_fields)}")
    return {key.value: key.start_mark.line + 1 for key, _ in node.value}


def _classify(grey: NDArray[np.uint8], told: _MapFile) -> tuple[BoolGrid, BoolGrid]:
    """Occupied and unknown cells, row 0 at the bottom, by the thresholds of the map_server.

    What lies between them is unknown in trinary mode; in scale mode it is what is likelier.
    """
    share = grey.astype(np.float64) / 255.0
    probability = np.flipud(share if told.negate else 1.0 - share)
    if told.mode == "scale":
        occupied = probability >= (told.free_thresh + told.occupied_thresh) / 2.0
        return occupied, np.zeros_like(occupied)
    occupied = probability > told.occupied_thresh
    return occupied, ~occupied & (probability >= told.free_thresh)
