"""Rooms and doors in the free space of a grid, by a watershed of the clearance.

Cells are flooded from the highest clearance down. Two basins that meet at a saddle much narrower than both are rooms
with a door between them; other basins merge. Clearance is measured along the axes, so that a crossing of corridors is
no wider than the corridors; equal clearances are ordered by the Euclidean distance, which is least in the plane of a
door.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from skills.grid_map import GridMap
from skills.robot import FloatArray, Pose2D

Bools = NDArray[np.bool_]
FREE, UNKNOWN, OCCUPIED = 254, 205, 0
BANDS_M = {"scan": (0.70, 1.30), "low_scan": (0.27, 0.31), "keepout": (0.05, 1.00)}
"""Height band of each grid (m)."""


@dataclass(frozen=True)
class Grid:
    """Cell values (rows from the south up), the world position of the south-west corner, and the cell size (m)."""

    cells: NDArray[np.uint8]
    origin_m: tuple[float, float]
    resolution_m: float


def grid_of(read: GridMap) -> Grid:
    """Returns the cells of a map that was read."""
    return Grid(read.grey(free=FREE, unknown=UNKNOWN, occupied=OCCUPIED), read.origin_m, read.resolution_m)


def pgm_bytes(grid: Grid) -> bytes:
    """Returns the binary PGM form, north up."""
    rows, columns = grid.cells.shape
    return f"P5\n{columns} {rows}\n255\n".encode() + grid.cells[::-1].tobytes()


def yaml_text(grid: Grid, image: str, band_m: tuple[float, float]) -> str:
    """Returns the YAML text beside the PGM."""
    return f"""image: {image}
mode: trinary
resolution: {grid.resolution_m}
origin: [{grid.origin_m[0]}, {grid.origin_m[1]}, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
height_band_m: [{band_m[0]}, {band_m[1]}]
"""


BODY_M = (1.10, 0.50)
NARROWER = 0.8
WIDEST_DOOR_M = 1.5
LEAST_BASIN_M2, LEAST_ROOM_M2 = 0.4, 1.5
_TIE = 1e-3
_YAWS = np.arange(8) * np.pi / 8

Point = tuple[float, float]
_Saddle = tuple[int, int, float, float, float]
"""Two labels, the width (m) between their basins, and its row and column (in cells)."""


@dataclass(frozen=True)
class Room:
    """A room: its name, outline (world frame, m), and a free pose of the robot in it."""

    name: str
    polygon: tuple[Point, ...]
    pose: Pose2D


@dataclass(frozen=True)
class Door:
    """A narrow passage between two rooms: its centre and its width (m)."""

    between: tuple[str, str]
    at: Point
    width_m: float


def clearance_m(grid: Grid) -> FloatArray:
    """Distance (m) from each cell's centre to the nearest cell that is not free; outside the grid nothing is free."""
    free = np.pad((grid.cells == FREE).astype(np.uint8), 1)
    far = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1] - 0.5
    return np.asarray(far * grid.resolution_m, dtype=np.float64)


def most_open_pose(grid: Grid, clearance: FloatArray, among: Bools | None = None) -> Pose2D | None:
    """Free pose with the highest clearance, at the yaw with the widest margin; None when the body fits nowhere."""
    wanted = clearance if among is None else np.where(among, clearance, -1.0)
    row, column = np.unravel_index(int(np.argmax(wanted)), wanted.shape)
    x, y = ((index + 0.5) * grid.resolution_m + low for index, low in zip((column, row), grid.origin_m, strict=True))
    return pose_at(grid, clearance, (float(x), float(y)))


def pose_at(grid: Grid, clearance: FloatArray, point: Point) -> Pose2D | None:
    """Free pose at a point, at the yaw with the widest margin; None when the body does not fit there."""
    x, y = point
    turned = [Pose2D(float(x), float(y), float(yaw)) for yaw in _YAWS]
    margins = [body_margin_m(grid, clearance, pose) for pose in turned]
    best = int(np.argmax(np.round(margins, 2)))
    return turned[best] if margins[best] >= 0.0 else None


def body_margin_m(grid: Grid, clearance: FloatArray, pose: Pose2D) -> float:
    """Margin (m) between the body's sides and the nearest cell that is not free; negative if it does not fit."""
    half = BODY_M[1] / 2.0
    along = np.linspace(half - BODY_M[0] / 2.0, BODY_M[0] / 2.0 - half, 9)
    points = np.array([pose.x_m, pose.y_m]) + along[:, None] * [np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)]
    cells = np.floor((points - grid.origin_m) / grid.resolution_m).astype(int)[:, ::-1]
    inside = np.all((cells >= 0) & (cells < clearance.shape), axis=1)
    if not inside.all():
        return -half
    return float(clearance[cells[:, 0], cells[:, 1]].min()) - half


def find_rooms(grid: Grid, start: Pose2D) -> tuple[tuple[Room, ...], tuple[Door, ...]]:
    """Finds the rooms within reach of the start, largest first, and the doors between them."""
    clearance = clearance_m(grid)
    labels, saddles = _segmented(grid, clearance)
    reached = reached_cells(clearance, grid, start)
    sizes = np.bincount(labels[reached], minlength=int(labels.max()) + 1)
    sizes[0] = 0
    rooms: dict[int, Room] = {}
    for label in np.argsort(-sizes, kind="stable")[: np.count_nonzero(sizes)]:
        room = room_of(f"room {len(rooms) + 1}", labels == label, grid, clearance, reached)
        if room is not None:
            rooms[int(label)] = room
    doors = []
    for a, b, width, row, column in saddles:
        if a in rooms and b in rooms and width >= BODY_M[1]:
            x, y = (i * grid.resolution_m + low for i, low in zip((column, row), grid.origin_m, strict=True))
            doors.append(Door((rooms[a].name, rooms[b].name), (round(x, 3), round(y, 3)), round(width, 2)))
    return tuple(rooms.values()), tuple(doors)


def reached_cells(clearance: FloatArray, grid: Grid, start: Pose2D) -> Bools:
    """Mask of the cells that the body's centre can reach from the start."""
    _, parts = cv2.connectedComponents((clearance >= BODY_M[1] / 2.0).astype(np.uint8))
    row, column = (
        int((value - low) / grid.resolution_m)
        for value, low in zip((start.y_m, start.x_m), grid.origin_m[::-1], strict=True)
    )
    return np.asarray((parts == parts[row, column]) & (parts > 0))


def room_of(name: str, cells: Bools, grid: Grid, clearance: FloatArray, reached: Bools) -> Room | None:
    """Room of some cells; None when the body does not fit."""
    pose = most_open_pose(grid, clearance, cells & reached)
    outlines, _ = cv2.findContours(cells.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    outline = cv2.approxPolyDP(max(outlines, key=cv2.contourArea), 2.0, True).reshape(-1, 2)
    if pose is None or len(outline) < 3:
        return None
    corners = (outline + 0.5) * grid.resolution_m + grid.origin_m
    return Room(name, tuple((round(float(x), 3), round(float(y), 3)) for x, y in corners), pose)


def _segmented(grid: Grid, clearance: FloatArray) -> tuple[NDArray[np.int64], list[_Saddle]]:
    """Labels of the cells (0: not free), and the saddles between the basins: labels, width (m), row, column."""
    free = np.pad((grid.cells == FREE).astype(np.uint8), 1)
    far = cv2.distanceTransform(free, cv2.DIST_C, 3) - 0.5 + _TIE * np.pad(clearance, 1) / grid.resolution_m
    order = np.argsort(-far, axis=None, kind="stable")[: np.count_nonzero(free)]
    cell_m2 = grid.resolution_m**2
    parent, labels, meetings = _flooded(
        far, order, NARROWER, WIDEST_DOOR_M / 2.0 / grid.resolution_m, LEAST_BASIN_M2 / cell_m2
    )
    roots = _roots(parent)
    labels = roots[labels][1:-1, 1:-1]
    widest: dict[tuple[int, int], _Saddle] = {}
    small = {int(each) for each in np.flatnonzero(np.bincount(labels.ravel()) * cell_m2 < LEAST_ROOM_M2)}
    joined = np.arange(len(parent))
    for first, second, cell in meetings:  # the widest first
        a, b = sorted(int(_root(joined, roots[each])) for each in (first, second))
        row, column = divmod(int(cell), far.shape[1])
        if a == b:
            continue
        if a in small or b in small:
            larger, smaller = (b, a) if a in small else (a, b)
            joined[smaller] = larger
            continue
        across_m = 2.0 * (float(far[row, column]) + 0.5) * grid.resolution_m
        widest.setdefault((a, b), (a, b, across_m, row - 0.5, column - 0.5))
    joined = _roots(joined)
    saddles: dict[tuple[int, int], _Saddle] = {}
    for a, b, width, row, column in widest.values():
        first, second = sorted((int(joined[a]), int(joined[b])))
        if first != second:
            saddles.setdefault((first, second), (first, second, width, row, column))
    return joined[labels], list(saddles.values())


def _roots(parent: NDArray[np.int64]) -> NDArray[np.int64]:
    """Final label of each label after all merges."""
    while True:
        above = parent[parent]
        if np.array_equal(above, parent):
            return above
        parent = above


def _root(parent: Any, label: Any) -> Any:
    while parent[label] != label:
        label = parent[label]
    return label


_root_of = numba.njit(cache=True)(_root)


@numba.njit(cache=True)
def _flooded(far: Any, order: Any, narrower: float, widest: float, least: float) -> Any:
    """Floods the cells; returns parents of labels, labels of cells, and the cells where separate basins meet."""
    rows, columns = far.shape
    labels = np.zeros((rows, columns), np.int64)
    parent = [0]
    peaks = [0.0]
    sizes = [0]
    meetings = [(0, 0, 0)]
    for cell in order:
        row, column = cell // columns, cell % columns
        here, own, steepest, label = far[row, column], 0, -1.0, 0
        for dr in range(-1, 2):
            for dc in range(-1, 2):
                other = labels[row + dr, column + dc]
                if other == 0:
                    continue
                other = _root_of(parent, other)
                if far[row + dr, column + dc] > steepest:
                    steepest, label = far[row + dr, column + dc], other
                if own == 0:
                    own = other
                elif other != own:
                    low, high = (own, other) if peaks[own] <= peaks[other] else (other, own)
                    if here >= narrower * peaks[low] or here > widest or sizes[low] < least:
                        parent[low] = high
                        sizes[high] += sizes[low]
                        own = high
                    else:
                        meetings.append((own, other, cell))
        if label == 0:
            label = len(parent)
            parent.append(label)
            peaks.append(here)
            sizes.append(0)
        labels[row, column] = label
        sizes[_root_of(parent, label)] += 1
    return np.array(parent), labels, meetings[1:]


def compile_kernels() -> None:
    """Finds the rooms of a small map, to compile the functions that numba's cache lacks."""
    cells = np.full((60, 60), FREE, np.uint8)
    cells[28:32, :24] = cells[28:32, 36:] = OCCUPIED
    find_rooms(Grid(cells, (0.0, 0.0), 0.05), Pose2D(1.5, 0.7, 0.0))
