"""Surveyed occupancy grids in the map_server form (a picture and YAML), with their distance field."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Annotated, Any, Final, Literal, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict

from skills.compiled import distances
from skills.geometry import grid_inside, inside_polygon
from skills.inputs.errors import InputError, count_text, nearest_name
from skills.inputs.outside import file_beside, is_file
from skills.inputs.picture_files import Brightness, read_brightness
from skills.inputs.schema import validate
from skills.inputs.yaml_source import YamlSource, quoted_key, read_yaml
from skills.quantities import Angle, Coordinate, Height, Quantity, Share
from skills.robot import FloatArray, Pose2D
from skills.world_model import Costmap, Localiser, Surface

BoolGrid = NDArray[np.bool_]
Cells = NDArray[np.int64]
CELL_M: Final = 0.04
"""Side of a cell."""
LEVELS: Final = np.arange(round(0.08 / CELL_M), round(2.0 / CELL_M))
"""Levels of the cells of a column, from just above the floor to above the arm."""
_AGREE_M = 0.03
"""Noise of the grids: distance within which an occupied cell of one counts as occupied in another."""
_AT_SURFACE_M = 0.06
"""Distance from a surveyed surface within which occupied cells are its edge."""
_FEWEST_COLUMNS = 8
"""Number of connected columns from which on they are a wall."""
_BELOW_TOP_M = 0.01
"""Distance from a surveyed surface down to the solid below it."""
MOST_CELLS: Final = 16_000_000
UNKNOWN_GREY: Final = 205
"""The grey that map_saver writes for unknown ground."""


@dataclass(frozen=True)
class GridMap:
    """An occupancy grid fixed in the world frame, axes parallel to the world's.

    `occupied` and `unknown` are (rows, columns) with row 0 at the smallest y. `origin_m` is the world (x, y) of the
    outer corner of cell [0, 0]. `height_band_m` is the band of heights above the floor that the grid covers; None when
    its file does not name one. `notes` are remarks on the file for the user. The constructor raises ValueError for a
    grid of fewer than 2 x 2 cells.
    """

    occupied: BoolGrid
    resolution_m: float
    origin_m: tuple[float, float]
    unknown: BoolGrid | None = None
    height_band_m: tuple[float, float] | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.occupied.ndim != 2 or min(self.occupied.shape) < 2:
            raise ValueError("GridMap: occupied must be a grid of at least 2 x 2 cells")

    @cached_property
    def distance(self) -> NDArray[np.float32]:
        """Signed distance (m) from each cell centre to the boundary of the occupied cells; see `signed_distance`."""
        return signed_distance(self.occupied, self.resolution_m)

    @property
    def frame(self) -> tuple[float, float, float]:
        """Cell size and x, y of the outer corner of cell [0, 0], in metres."""
        return (self.resolution_m, *self.origin_m)

    @property
    def size_m(self) -> tuple[float, float]:
        """Extent along x and y, in metres."""
        rows, columns = self.occupied.shape
        return columns * self.resolution_m, rows * self.resolution_m

    def cells(self, points_W: FloatArray) -> NDArray[np.int64]:
        """The (row, column) of each (x, y) row; extrapolated outside the grid."""
        scaled = (np.asarray(points_W, dtype=np.float64)[:, :2] - self.origin_m) / self.resolution_m
        return np.asarray(np.floor(scaled[:, ::-1]).astype(np.int64))

    def centres(self, cells: NDArray[np.int64]) -> FloatArray:
        """World (x, y) of the centres of (row, column) rows."""
        return np.asarray((cells[:, ::-1] + 0.5) * self.resolution_m + self.origin_m)

    def distance_m(self, points_W: FloatArray) -> FloatArray:
        """Signed distance (m) from each (x, y) row to the nearest occupied cell, bilinear between cell centres.

        Off the grid it is minus the distance to the grid, because unsurveyed ground counts as blocked.
        """
        points = np.ascontiguousarray(points_W, dtype=np.float64)
        return distances(self.distance, *self.frame, points)

    def grey(self, *, free: int, unknown: int, occupied: int) -> NDArray[np.uint8]:
        """The grid as a grey picture (rows, columns), row 0 at the smallest y."""
        grey = np.full(self.occupied.shape, free, np.uint8)
        if self.unknown is not None:
            grey[self.unknown] = unknown
        grey[self.occupied] = occupied
        return grey

    def with_unknown_blocked(self) -> GridMap:
        """The same grid with unknown cells counted as occupied, for planning."""
        return self if self.unknown is None else replace(self, occupied=self.occupied | self.unknown, unknown=None)


def signed_distance(occupied: BoolGrid, resolution_m: float) -> NDArray[np.float32]:
    """Distance (m) from each cell's centre to the boundary of the occupied cells, negative inside them."""
    if not occupied.any():
        return np.full(occupied.shape, math.hypot(*occupied.shape) * resolution_m, dtype=np.float32)
    outside, inside = (
        cv2.distanceTransform(cells.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        for cells in (~occupied, occupied)
    )
    return np.ascontiguousarray(np.where(occupied, 0.5 - inside, outside - 0.5) * resolution_m, dtype=np.float32)


CellSize = Annotated[float, Quantity(ge=0.005, le=1.0, unit="m")]


def _lower(value: Any) -> Any:
    return value.lower() if isinstance(value, str) else value


class _MapFile(BaseModel):
    """The keys of a map_server YAML file, and the band of heights."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)

    image: str
    resolution: CellSize
    origin: tuple[Coordinate, Coordinate, Angle]
    occupied_thresh: Share
    free_thresh: Share
    negate: bool = False
    mode: Annotated[Literal["trinary", "scale", "raw"] | None, BeforeValidator(_lower)] = None
    trinary: bool | None = None
    height_band_m: tuple[Height, Height] | None = None

    @property
    def read_as(self) -> str:
        """The file's mode; older files state it by the key `trinary`."""
        return self.mode or ("scale" if self.trinary is False else "trinary")


def load_grid_map(path: Path) -> GridMap:
    """Reads a map_server YAML file and the picture that it names.

    Raises InputError, with file and line, when the file is no such map or its picture cannot be used.
    """
    source, file, picture, remarks = _read(path)
    occupied, unknown = _classify(picture, file)
    notes = (*remarks, *_notes(picture, file, occupied, unknown))
    if file.origin[2] != 0.0:
        return _turned(occupied, unknown, file, source, notes)
    return GridMap(occupied, file.resolution, file.origin[:2], unknown, file.height_band_m, notes)


@dataclass(frozen=True)
class FilterMask:
    """A Nav2 filter mask: `percent` (rows, columns), row 0 at the bottom, with -1 for unknown cells.

    `origin` is the world pose x, y (m), yaw (rad) of the outer corner of cell [0, 0].
    """

    percent: NDArray[np.int16]
    resolution_m: float
    origin: tuple[float, float, float]

    @property
    def corners_W(self) -> FloatArray:
        """World (x, y) of the mask's four corners, (4, 2)."""
        rows, columns = self.percent.shape
        return self._points_W(np.array([(0, 0), (columns, 0), (columns, rows), (0, rows)]))

    def outlines_W(self, least: int) -> list[FloatArray]:
        """World (x, y) of the outlines, (N, 2) each, around cells with values of at least `least`."""
        found, _ = cv2.findContours((self.percent >= least).astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)
        simple = (cv2.approxPolyDP(each, 1.0, closed=True)[:, 0] for each in found)
        return [self._points_W(each + 0.5) for each in simple if len(each) > 2]

    def _points_W(self, cells: NDArray[Any]) -> FloatArray:
        """World (x, y) of points given in columns and rows."""
        x, y, yaw = self.origin
        turn = [[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]]
        return np.asarray(cells * self.resolution_m @ turn + (x, y))

    def at(self, points_W: FloatArray) -> NDArray[np.int16]:
        """Values at points (N, 2); -1 off the mask."""
        x, y, yaw = self.origin
        turned = (points_W - (x, y)) @ [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
        column, row = np.floor(turned / self.resolution_m).astype(np.int64).T
        rows, columns = self.percent.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return np.where(inside, self.percent[row.clip(0, rows - 1), column.clip(0, columns - 1)], np.int16(-1))


@lru_cache(maxsize=16)
def load_filter_mask(path: Path) -> FilterMask:
    """Reads a Nav2 filter mask in the map_server form, once per file. Raises InputError as `load_grid_map`."""
    _, file, picture, _ = _read(path)
    occupied, unknown = _classify(picture, file)
    percent = np.where(occupied, 100, 0).astype(np.int16)
    if file.read_as == "raw":
        percent = np.flipud(np.rint(255.0 * picture.shares)).astype(np.int16)
    elif file.read_as == "scale":
        probability = np.flipud(picture.shares if file.negate else 1.0 - picture.shares)
        share = (probability - file.free_thresh) / (file.occupied_thresh - file.free_thresh)
        percent = np.rint(100.0 * share.clip(0.0, 1.0)).astype(np.int16)
    return FilterMask(np.where(unknown, np.int16(-1), percent), file.resolution, file.origin)


def _read(path: Path) -> tuple[YamlSource, _MapFile, Brightness, tuple[str, ...]]:
    """Source, keys and picture of a map file, and remarks on them. Raises InputError when it cannot be used."""
    _refuse_other_files(path)
    source, strange = _without_unknown_keys(read_yaml(path))
    file = validate(_MapFile, source)
    if not file.free_thresh < file.occupied_thresh:
        what = f"free_thresh: {file.free_thresh:g} should be below occupied_thresh, {file.occupied_thresh:g}"
        raise source.error(("free_thresh",), what, "swap the two, or correct them")
    if file.trinary is not None and file.mode is not None and file.trinary != (file.mode == "trinary"):
        raise source.error(("trinary",), f"trinary: 'mode' says {file.mode}", "remove 'trinary'")
    picture, moved = _picture(source, file)
    return source, file, picture, (*strange, *moved)


_PICTURES: Final = frozenset({".pgm", ".png", ".bmp", ".ppm", ".jpg", ".jpeg", ".gif", ".tif", ".tiff", ".webp"})
_OTHER_MAPS: Final = {
    ".posegraph": "a pose graph of slam_toolbox",
    ".data": "the scans of a pose graph of slam_toolbox",
    ".pbstream": "a state of Cartographer",
    ".bt": "an octree of OctoMap",
    ".ot": "an octree of OctoMap",
    ".db": "a database of RTAB-Map",
}


def _refuse_other_files(path: Path) -> None:
    """Raises InputError, naming the file to give instead, for a map's picture and for maps of other forms."""
    suffix = path.suffix.lower()
    if suffix in _PICTURES:
        beside = path.with_suffix(".yaml")
        hint = f"give {beside}" if is_file(beside) else "give the YAML file with 'image', 'resolution' and 'origin'"
        raise InputError("it is the picture of a map, which has no scale", hint=hint, file=path)
    if suffix in _OTHER_MAPS:
        hint = "start its program, and save the map by `ros2 run nav2_map_server map_saver_cli -f NAME`"
        raise InputError(f"it is {_OTHER_MAPS[suffix]}", hint=hint, file=path)


def _without_unknown_keys(source: YamlSource) -> tuple[YamlSource, tuple[str, ...]]:
    """Removes keys without a meaning here, with a remark on each; keeps misspelled required keys."""
    if not isinstance(source.data, dict) or not source.data.keys() & _MapFile.model_fields.keys():
        return source, ()
    lacking = {name for name, field in _MapFile.model_fields.items() if field.is_required()} - source.data.keys()
    optional = _MapFile.model_fields.keys() - source.data.keys()
    known, notes = {}, list[str]()
    for key, value in source.data.items():
        if key in _MapFile.model_fields or nearest_name(str(key), lacking) is not None:
            known[key] = value
        else:
            near = nearest_name(str(key), optional)
            advice = "" if near is None else f"; did you mean '{near}'?"
            notes.append(f"line {source.line((key,))}: the {quoted_key(key)} is unknown and counts for nothing{advice}")
    return replace(source, data=known), tuple(notes)


def _picture(source: YamlSource, file: _MapFile) -> tuple[Brightness, tuple[str, ...]]:
    """The map's picture, and a remark if it lies in another folder. Raises InputError at the line that names it."""
    name = file.image.replace("\\", "/").rpartition("/")[2]
    beside, notes = source.path.parent / name, tuple[str, ...]()
    try:
        absolute = PurePosixPath(file.image).is_absolute() or PureWindowsPath(file.image).is_absolute()
        if absolute and not is_file(Path(file.image)) and name and is_file(beside):
            notes, picture = (f"image: there is no {file.image[:100]}; {name} beside the file is read",), beside
        else:
            picture = file_beside(source.path, file.image)
        found = read_brightness(picture, most_pixels=MOST_CELLS)
    except InputError as error:
        what = f"image: {error.message}" if error.file == source.path else f"image: {file.image[:100]}: {error.message}"
        raise source.error(("image",), what, error.hint) from error
    if min(found.shares.shape) < 2:
        rows, columns = found.shares.shape
        what = f"image: it has {columns} x {rows} cells"
        raise source.error(("image",), what, "name a picture of 2 x 2 cells or more")
    return found, notes


def _notes(picture: Brightness, file: _MapFile, occupied: BoolGrid, unknown: BoolGrid) -> tuple[str, ...]:
    """Remarks on a map whose file is probably wrong, or which map_server interprets differently."""
    notes = []
    if picture.more_bytes:
        notes.append(f"image: it has {count_text(picture.more_bytes, 'byte')} after the last pixel, which are not read")
    grey = UNKNOWN_GREY / 255.0
    free = (grey if file.negate else 1.0 - grey) < file.free_thresh
    share = float(np.mean(np.abs(picture.shares - grey) < 0.5 / 255.0))
    if file.read_as != "raw" and free and share > 0.0:
        notes.append(
            f"{100.0 * share:.0f} % of the picture has the grey {UNKNOWN_GREY}, by which map_saver means unknown "
            f"ground. It counts as free, since free_thresh is {file.free_thresh:g}; write 0.196 unless that is meant"
        )
    if picture.opacity is not None and file.read_as == "trinary":
        averaged = _by_thresholds((3.0 * picture.shares + picture.opacity) / 4.0, file)
        other = float(np.mean((averaged[0] != occupied) | (averaged[1] != unknown)))
        if other > 0.0:
            notes.append(
                f"map_server reads {100.0 * other:.0f} % of the picture otherwise, since it takes opacity for a fourth "
                "colour; here transparent cells are unknown. Remove the alpha channel, and both read the same"
            )
    return tuple(notes)


def _turned(
    occupied: BoolGrid, unknown: BoolGrid, file: _MapFile, source: YamlSource, notes: tuple[str, ...]
) -> GridMap:
    """Resamples a rotated map to axes parallel to the world's, at half the cell size so that thin walls stay."""
    x, y, yaw = file.origin
    c, s = math.cos(yaw), math.sin(yaw)
    rows, columns = occupied.shape
    ends = np.array([(0, 0), (columns, 0), (0, rows), (columns, rows)]) * file.resolution @ np.array([[c, s], [-s, c]])
    low, step = ends.min(axis=0), file.resolution / 2.0
    count = np.ceil((ends.max(axis=0) - low) / step - 1e-6).astype(int)
    if count[0] * count[1] > 4 * MOST_CELLS:
        raise source.error(("origin",), "origin: the map becomes too large when it is turned", "cut it")
    across, up = np.meshgrid(*(edge + (np.arange(n) + 0.5) * step for edge, n in zip(low, count, strict=True)))
    turned = (c * across + s * up, c * up - s * across)
    column, row = (np.floor(along / file.resolution).astype(int) for along in turned)
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    column, row = column.clip(0, columns - 1), row.clip(0, rows - 1)
    origin_m = (x + float(low[0]), y + float(low[1]))
    unknown = unknown[row, column] | ~inside
    return GridMap(occupied[row, column] & inside, step, origin_m, unknown, file.height_band_m, notes)


def _classify(picture: Brightness, file: _MapFile) -> tuple[BoolGrid, BoolGrid]:
    """Occupied and unknown cells, row 0 at the bottom, by mode and thresholds as map_server applies them.

    Values between the thresholds are unknown in trinary mode, and in scale mode the more likely state. In raw mode a
    value is the percentage itself, and unknown above 100. In the first two modes cells that are not opaque are unknown.
    """
    if file.read_as == "raw":
        percent = np.flipud(np.rint(255.0 * picture.shares))
        unknown = percent > 100.0
        return (percent >= 50.0) & ~unknown, unknown
    occupied, unknown = _by_thresholds(picture.shares, file)
    if picture.opacity is not None:
        hidden = np.flipud(picture.opacity < 1.0)
        return occupied & ~hidden, unknown | hidden
    return occupied, unknown


def _by_thresholds(shares: NDArray[np.float64], file: _MapFile) -> tuple[BoolGrid, BoolGrid]:
    """Occupied and unknown cells, row 0 at the bottom, by brightness and the thresholds."""
    probability = np.flipud(shares if file.negate else 1.0 - shares)
    if file.read_as == "scale":
        return probability >= (file.free_thresh + file.occupied_thresh) / 2.0, np.zeros(shares.shape, dtype=np.bool_)
    occupied = probability > file.occupied_thresh
    return occupied, ~occupied & (probability >= file.free_thresh)


def map_columns(grids: Sequence[GridMap], surfaces: Sequence[Surface]) -> Cells:
    """Columns (N, 3) of solid cells, x, y and one past the highest level: walls, and all below a lowest surface."""
    walls = wall_columns(grids, surfaces)
    columns = [np.insert(walls, 2, LEVELS[-1] + 1, axis=1)]
    for surface in sorted(surfaces, key=lambda surface: surface.height_m):
        below = np.floor(grid_inside(surface.polygon_W, CELL_M, margin_m=1e-6) / CELL_M).astype(np.int64)
        columns.append(np.insert(below, 2, math.floor((surface.height_m - _BELOW_TOP_M) / CELL_M), axis=1))
    every = np.vstack(columns)
    return every[np.sort(np.unique(every[:, :2], axis=0, return_index=True)[1])]


def wall_columns(grids: Sequence[GridMap], surfaces: Iterable[Surface]) -> Cells:
    """Columns (N, 2) of cells that are occupied in all grids of a map, and thus solid at all their heights.

    A grid has no heights, and a LiDAR's band shows table tops and their edges. So the columns exclude surveyed
    surfaces, over which the arm reaches, and single posts, such as chair legs.
    """
    first, *others = sorted(grids, key=lambda grid: np.count_nonzero(grid.occupied))
    points_W = first.centres(np.argwhere(first.occupied))
    for grid in others:
        points_W = points_W[grid.distance_m(points_W) < _AGREE_M]
    for surface in surfaces:
        points_W = points_W[~inside_polygon(points_W, surface.polygon_W, _AT_SURFACE_M)]
    columns = np.unique(np.floor(points_W / CELL_M).astype(np.int64), axis=0)
    if len(columns) == 0:
        return columns
    low = columns.min(axis=0)
    picture = np.zeros(columns.max(axis=0) - low + 1, dtype=np.uint8)
    picture[tuple((columns - low).T)] = 1
    _, parts, about, _ = cv2.connectedComponentsWithStats(picture)
    return np.asarray(np.argwhere((parts > 0) & (about[parts, cv2.CC_STAT_AREA] >= _FEWEST_COLUMNS)) + low)


class LocaliserComponent(Protocol):
    """Builds the localiser of one robot."""

    def build(self, grid: GridMap, start: Pose2D | None, *, surely: bool) -> Localiser:
        """Builds a localiser on a surveyed grid; `start` is the robot's start pose, None when it is unknown.

        `surely` is False when the robot may have been moved since it was at `start`.
        """


class CostmapComponent(Protocol):
    """Builds the costmap of one robot."""

    def build(self, keepout: GridMap) -> Costmap:
        """Builds a costmap on a surveyed keep-out grid."""
