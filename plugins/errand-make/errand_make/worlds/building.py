"""Building files of Open-RMF's traffic editor: walls, doors, floors, names and lanes of one level, in metres."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray
from shapely.geometry import LineString, MultiLineString
from shapely.ops import linemerge

from errand_make.worlds.building_file import (
    EDGES,
    HINT,
    LevelFrame,
    building_levels,
    level_edges,
    level_floors,
    level_frame,
    level_vertices,
    listed,
)
from errand_make.worlds.rooms import (
    FREE,
    LEAST_ROOM_M2,
    OCCUPIED,
    UNKNOWN,
    Door,
    Grid,
    Point,
    Room,
    clearance_m,
    pose_at,
    reached_cells,
    room_of,
)
from skills.inputs.errors import InputError, count_text, suggestion
from skills.inputs.yaml_source import YamlSource
from skills.robot import FloatArray, Pose2D

_CELL_M: Final = 0.05
_MOST_CELLS: Final = 16_000_000
_WALL_M: Final = 0.1
_LANE_M: Final = 1.2
"""Width of the free ground along a lane; the preferred zone is half as wide."""
_AROUND_M: Final = 1.0
"""Free ground around a level without floors."""
_BESIDE_DOOR_M: Final = 0.4
_FAR_M: Final = 1.0
"""Largest distance between a named vertex and a pose that is free for the body."""
_SUFFIXES: Final = (".building.yaml", ".building.yml")
_LEFT_OUT: Final = ("models", "human_lanes")

Segment = tuple[Point, Point]


@dataclass(frozen=True)
class Building:
    """One level of a building: world frame as Open-RMF's (x right, y up in the drawing), in metres.

    `names` are points by name, `starts` the names of vertices where a robot starts or charges.
    """

    walls: tuple[Segment, ...]
    doors: tuple[Segment, ...]
    lanes: tuple[Segment, ...]
    floors: tuple[tuple[Point, ...], ...]
    names: Mapping[str, Point]
    starts: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def points(self) -> FloatArray:
        """All points (N, 2)."""
        edges = [point for segment in (*self.walls, *self.doors, *self.lanes) for point in segment]
        return np.array([*edges, *self.names.values(), *(point for floor in self.floors for point in floor)])


def is_building(source: YamlSource) -> bool:
    """Returns whether a YAML file has the name or the form of a building of Open-RMF."""
    named = source.path.name.endswith(_SUFFIXES)
    return named or (isinstance(source.data, dict) and "levels" in source.data)


def read_building(source: YamlSource, *, level: str | None, scale_m: float | None) -> Building:
    """Reads one level of a building file, by default the first; `scale_m` is the length of a pixel (m).

    Raises InputError when the level is not there, its coordinates are geographic, or an edge names no vertex.
    """
    levels, notes = building_levels(source), list[str]()
    if level is not None and level not in levels:
        raise source.error(("levels",), f"there is no level '{level}'", suggestion(level, list(levels)))
    name = level or next(iter(levels))
    if level is None and len(levels) > 1:
        notes.append(f"it has the levels {', '.join(map(str, levels))}: {name} is taken (--level takes another)")
    system = source.data.get("coordinate_system", "reference_image")
    if system not in ("reference_image", "cartesian_meters"):
        what = f"its coordinates are of the kind '{system}', and only drawings and metres are read"
        hint = "draw the building on a floor plan in the traffic editor, or begin from a map of ROS map_server"
        raise source.error(("coordinate_system",), what, hint)
    metric = system == "cartesian_meters"
    path, part = ("levels", name), levels[name]
    vertices = list(level_vertices(source, path, part))
    edges = {key: list(level_edges(source, path, part, key, len(vertices))) for key in EDGES}
    frame = LevelFrame(1.0) if metric else level_frame(source, name, scale_m, notes)
    points = [frame.point(x, y if metric else -y) for x, y, _, _ in vertices]
    floors = tuple(tuple(points[n] for n in each) for each in level_floors(source, path, part, len(vertices)))
    named, first = dict[str, Point](), dict[str, int]()
    for n, (point, (_, _, each, _)) in enumerate(zip(points, vertices, strict=True)):
        line = source.line((*path, "vertices", n))
        if each and each in named:
            what = f"lines {first[each]} and {line} have vertices of the name '{each}'"
            notes.append(f"{what}: the later one is left out; give it a name of its own")
        elif each:
            named[each], first[each] = point, line
    starts = [
        each for _, _, each, facts in vertices if each and (facts.get("is_charger") or facts.get("spawn_robot_name"))
    ]
    notes += _left_out(source, path, part)
    one_way = sum(not facts.get("bidirectional") for _, _, facts in edges["lanes"])
    notes += [f"{count_text(one_way, 'lane')} of one direction is preferred ground in both"] if one_way else []
    segments = {key: tuple((points[a], points[b]) for a, b, _ in those if a != b) for key, those in edges.items()}
    made = Building(segments["walls"], segments["doors"], segments["lanes"], floors, named, tuple(starts), tuple(notes))
    if not len(made.points):
        raise source.error(path, f"the level {name} has no walls, floors, lanes or names", HINT)
    if not made.walls:
        what = f"line {source.line(path)}: the level {name} has no walls, so nothing bounds or divides its rooms"
        return replace(made, notes=(*made.notes, f"{what}; draw them in the traffic editor"))
    return made


def _left_out(source: YamlSource, path: tuple[str | int, ...], part: Any) -> Iterator[str]:
    """Notes on the parts of a level and of the building that a world has no form for."""
    for key in _LEFT_OUT:
        if many := len(listed(source, path, part, key)):
            yield f"{count_text(many, key[:-1].replace('_', ' '))} of the level: left out"
    if isinstance(lifts := source.data.get("lifts"), dict) and lifts:
        yield f"{count_text(len(lifts), 'lift')}: left out"


def building_grid(building: Building) -> Grid:
    """Draws a level: walls occupied; floors and the ground along lanes free; without floors, all about it free.

    Raises InputError when the level is too large.
    """
    low, high = building.points.min(axis=0) - _AROUND_M, building.points.max(axis=0) + _AROUND_M
    columns, rows = (math.ceil(size / _CELL_M) for size in high - low)
    if rows * columns > _MOST_CELLS:
        what = f"the level measures {columns * _CELL_M:.0f} x {rows * _CELL_M:.0f} m, which is too large"
        raise InputError(what, hint="check its measurements, or give the metres of a pixel by --scale")
    cells = np.full((rows, columns), UNKNOWN if building.floors else FREE, np.uint8)
    for floor in building.floors:
        cv2.fillPoly(cells, [_pixels(floor, low)], FREE)
    for lane in building.lanes:
        _draw(cells, _pixels(lane, low), FREE, _LANE_M)
    for wall in building.walls:
        _draw(cells, _pixels(wall, low), OCCUPIED, _WALL_M)
    for door in building.doors:
        _draw(cells, _pixels(_inner(door), low), FREE, 2.0 * _WALL_M)
    return Grid(cells, (float(low[0]), float(low[1])), _CELL_M)


def building_start(building: Building, grid: Grid) -> Pose2D | None:
    """Free pose of a robot: at a charger or start of the file, else at a named vertex; None if none is free."""
    clearance = clearance_m(grid)
    wanted = (building.names[name] for name in (*building.starts, *building.names))
    return next((pose for pose in (pose_at(grid, clearance, point) for point in wanted) if pose is not None), None)


Facts = tuple[Sequence[Room], Sequence[Door], Mapping[str, Any]]


def building_plan(building: Building, note: Callable[[str], None]) -> Callable[[Grid, Pose2D], Facts]:
    """Rooms, doors, named poses and zones of a level, for `world_from_grid`; `note` takes what is left out.

    A room is the ground between walls and doors that the robot reaches; a single name in it is the room's name.
    """

    def planned(grid: Grid, start: Pose2D) -> Facts:
        clearance = clearance_m(grid)
        reached = reached_cells(clearance, grid, start)
        poses = dict[str, Pose2D]()
        for name, point in building.names.items():
            pose = _near_pose(grid, clearance, reached, point)
            if pose is None:
                note(f"{name} is left out: no pose near it is free and within reach")
            else:
                poses[name] = pose
        labels, rooms = _rooms(building, grid, clearance, reached, poses)
        doors = list[Door]()
        for door in building.doors:
            sides = {rooms[label].name for label in _beside(labels, grid, door) if label in rooms}
            if len(sides) == 2:
                middle = np.mean(door, axis=0).round(3).tolist()
                doors.append(Door((min(sides), max(sides)), (middle[0], middle[1]), round(math.dist(*door), 2)))
        named = {room.name for room in rooms.values()}
        places = {name: pose for name, pose in poses.items() if name not in named}
        lanes = enumerate(_lane_outlines(building.lanes), start=1)
        zones = {f"lane {n}": {"kind": "preferred", "polygon": outline} for n, outline in lanes}
        return tuple(rooms.values()), doors, {"places": places, "zones": zones}

    return planned


def _rooms(
    building: Building, grid: Grid, clearance: FloatArray, reached: NDArray[np.bool_], poses: Mapping[str, Pose2D]
) -> tuple[NDArray[np.int32], dict[int, Room]]:
    """Labels of the cells, and the room of each label, the smallest first: a room in a room is found before it."""
    shut = grid.cells.copy()
    for door in building.doors:
        _draw(shut, _pixels(door, np.array(grid.origin_m)), OCCUPIED, 2.0 * _WALL_M)
    _, labels = cv2.connectedComponents((shut == FREE).astype(np.uint8), connectivity=4)
    sizes = np.bincount(labels[reached & (shut == FREE)], minlength=int(labels.max()) + 1)
    whole = np.bincount(labels.ravel())
    rooms = dict[int, Room]()
    for label in np.argsort(whole, kind="stable").tolist():
        if label == 0 or not sizes[label] or whole[label] * grid.resolution_m**2 < LEAST_ROOM_M2:
            continue
        inside = [name for name, pose in poses.items() if labels[_cell(grid, (pose.x_m, pose.y_m))] == label]
        name = inside[0] if len(inside) == 1 else f"room {len(rooms) + 1}"
        room = room_of(name, labels == label, grid, clearance, reached)
        if room is not None:
            rooms[label] = replace(room, pose=poses.get(name, room.pose))
    return np.asarray(labels, np.int32), rooms


def _near_pose(grid: Grid, clearance: FloatArray, reached: NDArray[np.bool_], point: Point) -> Pose2D | None:
    """Nearest pose to a point that is free for the body and within reach; None if there is none nearby."""
    row, column = _cell(grid, point)
    if reached[row, column] and (pose := pose_at(grid, clearance, point)) is not None:
        return pose
    near = round(_FAR_M / grid.resolution_m)
    rows, columns = np.nonzero(reached[max(row - near, 0) : row + near, max(column - near, 0) : column + near])
    centres = (np.stack([columns + max(column - near, 0), rows + max(row - near, 0)], 1) + 0.5) * grid.resolution_m
    centres += grid.origin_m
    order = np.argsort(np.hypot(*(centres - point).T))
    poses = (pose_at(grid, clearance, (float(x), float(y))) for x, y in centres[order])
    return next((pose for pose in poses if pose is not None), None)


def _beside(labels: NDArray[np.int32], grid: Grid, door: Segment) -> Iterator[int]:
    """Labels of the ground on the two sides of a door."""
    (x0, y0), (x1, y1) = door
    length = max(math.dist(*door), 1e-6)
    for side in (_BESIDE_DOOR_M, -_BESIDE_DOOR_M):
        point = (x0 + x1) / 2.0 - side * (y1 - y0) / length, (y0 + y1) / 2.0 + side * (x1 - x0) / length
        yield int(labels[_cell(grid, point)])


def _lane_outlines(lanes: Sequence[Segment]) -> Iterator[list[list[float]]]:
    """Outlines of the ground along chains of lanes."""
    if not lanes:
        return
    merged = linemerge(MultiLineString(lanes))
    for chain in getattr(merged, "geoms", [merged]):
        whole = _outline(chain)
        points = list(chain.coords)
        parts = [LineString(pair) for pair in itertools.pairwise(points)]
        yield from [whole] if whole else filter(None, map(_outline, parts))


def _outline(line: LineString) -> list[list[float]] | None:
    """Outline of the ground along a line; None where it closes around other ground."""
    ground = line.buffer(_LANE_M / 4.0, cap_style="square", join_style="mitre").simplify(0.02)
    if ground.geom_type != "Polygon" or ground.interiors or line.length == 0.0:
        return None
    return [[round(x, 3), round(y, 3)] for x, y in ground.exterior.coords[:-1]]


def _cell(grid: Grid, point: Point) -> tuple[int, int]:
    """Row and column of the cell of a point, at the rim for points outside."""
    column, row = ((value - low) / grid.resolution_m for value, low in zip(point, grid.origin_m, strict=True))
    rows, columns = grid.cells.shape
    return min(max(int(row), 0), rows - 1), min(max(int(column), 0), columns - 1)


def _pixels(points: Sequence[Point], low: FloatArray) -> NDArray[np.int32]:
    return np.floor((np.array(points) - low) / _CELL_M).astype(np.int32)


def _draw(cells: NDArray[np.uint8], ends: NDArray[np.int32], value: int, width_m: float) -> None:
    first, last = ((int(x), int(y)) for x, y in ends)
    cv2.line(cells, first, last, value, round(width_m / _CELL_M))


def _inner(door: Segment) -> Segment:
    """The part of a door without the walls at its ends."""
    (x0, y0), (x1, y1) = door
    share = min(_WALL_M / max(math.dist(*door), 1e-6), 0.45)
    dx, dy = share * (x1 - x0), share * (y1 - y0)
    return (x0 + dx, y0 + dy), (x1 - dx, y1 - dy)
