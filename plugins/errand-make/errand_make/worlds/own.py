"""Builds the folder of a world from the map of a building, or from upright cylinders."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from errand_make.mesh import Material, Mesh, mtl_text, obj_text, palette_picture, write_text
from errand_make.shapes import Box, Cylinder, Model, Shape, model_sdf
from errand_make.worlds.rooms import (
    BANDS_M,
    FREE,
    OCCUPIED,
    UNKNOWN,
    Bools,
    Door,
    Grid,
    Room,
    body_margin_m,
    clearance_m,
    find_rooms,
    most_open_pose,
    pgm_bytes,
    yaml_text,
)
from plant.scene_pictures import save_png
from plant.worlds.geometry_files import OWN_PACKAGE
from plant.worlds.world import WorldError
from skills.inputs.yaml_source import yaml_of
from skills.robot import Pose2D

FINEST_M: Final = 0.02
COARSEST_M: Final = 0.05
_MOST_CELLS: Final = 16_000_000
_MARGIN_M: Final = 1.0
_MATERIALS: Final = {"floor": Material((0.62, 0.60, 0.56)), "wall": Material((0.86, 0.86, 0.82))}
_DIRECTIVES: Final = f"""# Made by `errand world`.
directives:
- add_model:
    name: walls
    file: package://{OWN_PACKAGE}/walls.sdf
- add_weld:
    parent: world
    child: walls::walls
"""


Plan = Callable[[Grid, Pose2D], tuple[Sequence[Room], Sequence[Door], Mapping[str, Any]]]
"""Rooms, doors, and further facts (`places` by pose, `zones`) of a grid, for a start."""


def found_plan(grid: Grid, start: Pose2D) -> tuple[Sequence[Room], Sequence[Door], Mapping[str, Any]]:
    """Rooms and doors that the grid's narrow passages make."""
    return (*find_rooms(grid, start), {})


def world_from_grid(
    folder: Path, grid: Grid, *, start: Pose2D | None, wall_height_m: float, plan: Plan = found_plan
) -> None:
    """Writes a world whose walls are the occupied cells. Raises WorldError when the robot fits nowhere."""
    grid = _resampled(grid)
    walls = [_box(grid, cells, wall_height_m) for cells in rectangles(grid.cells == OCCUPIED)]
    _write(folder, walls, {"scan": grid, "keepout": grid}, start, plan)


def world_from_cylinders(
    folder: Path,
    cylinders: Sequence[tuple[float, float, float, float]],
    *,
    start: Pose2D | None,
    around: Sequence[tuple[float, float]] = (),
) -> None:
    """Writes a world of upright cylinders (x, y, radius, height) that reaches 2 m around some points.

    Raises WorldError when the robot fits nowhere.
    """
    shapes = [Cylinder(radius=r, length=h, p=(x, y, h / 2.0)) for x, y, r, h in cylinders]
    places, reach = np.array(cylinders)[:, :2], max(r for _, _, r, _ in cylinders) + _MARGIN_M / 2.0
    low, high = places.min(axis=0) - reach, places.max(axis=0) + reach
    for here in map(np.array, around):
        low, high = np.minimum(low, here - 2.0), np.maximum(high, here + 2.0)
    step = 0.025
    shape = tuple(int(n) for n in np.ceil((high - low) / step))[::-1]
    if shape[0] * shape[1] > _MOST_CELLS:
        raise WorldError(
            f"the cylinders spread over {shape[1] * step:.0f} x {shape[0] * step:.0f} m; leave far ones out"
        )
    grids = {}
    for name, (bottom, _) in BANDS_M.items():
        cells = np.full(shape, FREE, np.uint8)
        for x, y, radius, height in cylinders:
            if height > bottom:
                _set_disc(cells, (np.array([x, y]) - low) / step, radius / step)
        grids[name] = Grid(cells, (float(low[0]), float(low[1])), step)
    _write(folder, shapes, grids, start, found_plan)


def _set_disc(cells: np.ndarray[Any, np.dtype[np.uint8]], centre: Any, radius: float) -> None:
    """Occupies the cells whose centres lie in a disc (column, row, in cells)."""
    c0, r0 = (max(0, int(value - radius) - 1) for value in centre)
    c1, r1 = (int(value + radius) + 2 for value in centre)
    part = cells[r0:r1, c0:c1]
    row, column = np.indices(part.shape)
    part[(column + c0 + 0.5 - centre[0]) ** 2 + (row + r0 + 0.5 - centre[1]) ** 2 <= radius**2] = OCCUPIED


def _resampled(grid: Grid) -> Grid:
    """Returns the grid in cells of a usable size: coarse cells are cut, fine cells merged."""
    if grid.resolution_m > COARSEST_M + 1e-9:
        cut = int(np.ceil(grid.resolution_m / COARSEST_M - 1e-6))
        if grid.cells.size * cut**2 > _MOST_CELLS:
            raise WorldError("the map is too large for its resolution; check 'resolution', or cut the map")
        return Grid(grid.cells.repeat(cut, axis=0).repeat(cut, axis=1), grid.origin_m, grid.resolution_m / cut)
    if grid.resolution_m >= FINEST_M:
        return grid
    many = int(np.ceil(FINEST_M / grid.resolution_m - 1e-6))
    rows, columns = (-(-n // many) for n in grid.cells.shape)
    whole = np.full((rows * many, columns * many), UNKNOWN, np.uint8)
    whole[: grid.cells.shape[0], : grid.cells.shape[1]] = grid.cells
    merged = whole.reshape(rows, many, columns, many).min(axis=(1, 3))  # occupied, else unknown, else free
    return Grid(merged, grid.origin_m, grid.resolution_m * many)


def rectangles(occupied: Bools) -> list[tuple[int, int, int, int]]:
    """Covers cells with few rectangles (row, column, row after, column after)."""
    along = _runs_merged(occupied)
    across = [(r0, c0, r1, c1) for c0, r0, c1, r1 in _runs_merged(occupied.T)]
    return min(along, across, key=len)


def _runs_merged(occupied: Bools) -> list[tuple[int, int, int, int]]:
    """Runs of cells along the rows; equal runs in consecutive rows are merged."""
    done, open_runs = [], dict[tuple[int, int], int]()
    edges = np.diff(np.pad(occupied, ((0, 1), (1, 1))).astype(np.int8), axis=1)
    for row, changes in enumerate(edges):
        runs = set(zip(np.flatnonzero(changes == 1).tolist(), np.flatnonzero(changes == -1).tolist(), strict=True))
        for run in [run for run in open_runs if run not in runs]:
            done.append((open_runs.pop(run), run[0], row, run[1]))
        for run in runs:
            open_runs.setdefault(run, row)
    return sorted(done)


def _box(grid: Grid, cells: tuple[int, int, int, int], height_m: float) -> Box:
    r0, c0, r1, c1 = cells
    low = np.array([c0, r0]) * grid.resolution_m + grid.origin_m
    high = np.array([c1, r1]) * grid.resolution_m + grid.origin_m
    (x, y), (width, depth) = (low + high) / 2.0, high - low
    return Box(size=(float(width), float(depth), height_m), p=(float(x), float(y), height_m / 2.0))


def _write(folder: Path, walls: Sequence[Shape], grids: dict[str, Grid], start: Pose2D | None, plan: Plan) -> None:
    """Writes all files of the world. Raises WorldError when the start is not free, or the robot fits nowhere."""
    keepout = grids["keepout"]
    start = _start(keepout, start)
    rooms, doors, more = plan(keepout, start)
    size = np.array(keepout.cells.shape[::-1]) * keepout.resolution_m
    centre = size / 2.0 + keepout.origin_m
    floor = Box(
        size=(float(size[0]) + 2 * _MARGIN_M, float(size[1]) + 2 * _MARGIN_M, 0.2),
        p=(float(centre[0]), float(centre[1]), -0.1),
    )
    mesh = _mesh(floor, walls)
    write_text(folder / "walls.sdf", model_sdf(Model("walls", "walls.obj", [floor, *walls])))
    write_text(folder / "walls.obj", obj_text(mesh, "walls.mtl"))
    write_text(folder / "walls.mtl", mtl_text(mesh, "palette.png"))
    save_png(folder / "palette.png", palette_picture(_MATERIALS), 9)
    write_text(folder / "world.dmd.yaml", _DIRECTIVES)
    write_text(folder / "knowledge.yaml", _knowledge_text(start, rooms, doors, more))
    (folder / "map").mkdir(exist_ok=True)
    for name, grid in grids.items():
        (folder / "map" / f"{name}.pgm").write_bytes(pgm_bytes(grid))
        write_text(folder / "map" / f"{name}.yaml", yaml_text(grid, f"{name}.pgm", BANDS_M[name]))


def _start(grid: Grid, start: Pose2D | None) -> Pose2D:
    if not np.any(grid.cells == FREE):
        raise WorldError("no cell of it is free; check 'negate' and the two thresholds")
    clearance = clearance_m(grid)
    best = most_open_pose(grid, clearance)
    if best is None:
        raise WorldError("no free place is wide enough for the robot's body; check 'resolution'")
    if start is not None and body_margin_m(grid, clearance, start) < 0.0:
        there = f"({start.x_m:g}, {start.y_m:g}, {start.yaw_rad:g})"
        free = f"{best.x_m:.2f} {best.y_m:.2f} {best.yaw_rad:.2f}"
        raise WorldError(f"the start {there} touches a wall or lies outside; a free one is --start {free}")
    return start or best


def _mesh(floor: Box, walls: Sequence[Shape]) -> Mesh:
    mesh = Mesh(_MATERIALS)
    (x, y, _), (dx, dy, _) = floor.p, floor.size
    mesh.add_rectangle("floor", (x - dx / 2, y - dy / 2, 0.0), (dx, 0, 0), (0, dy, 0))
    for wall in walls:
        if isinstance(wall, Box):
            half = np.array(wall.size) / 2.0
            mesh.add_box("wall", np.array(wall.p) - half, np.array(wall.p) + half, faces={"-z": None})
        elif isinstance(wall, Cylinder):
            mesh.add_cylinder("wall", wall.radius, (wall.p[0], wall.p[1], 0.0), wall.length, sides=12)
    return mesh


def _knowledge_text(start: Pose2D, rooms: Sequence[Room], doors: Sequence[Door], more: Mapping[str, Any]) -> str:
    places = {room.name: {"pose": _pose(room.pose), "polygon": list(map(list, room.polygon))} for room in rooms}
    places |= {name: {"pose": _pose(pose)} for name, pose in more.get("places", {}).items()}
    facts = {
        "robot": {"name": "Alice"},
        "start": _pose(start),
        "places": places,
        "doors": [{"between": list(d.between), "at": list(d.at), "width": d.width_m} for d in doors],
        **({"zones": more["zones"]} if more.get("zones") else {}),
    }
    head = "# Made by `errand world`: give the rooms their names, here and under doors. Metres and radians.\n"
    return head + yaml_of(facts)


def _pose(pose: Pose2D) -> dict[str, float]:
    return {"x": round(pose.x_m, 3), "y": round(pose.y_m, 3), "yaw": round(pose.yaw_rad, 4)}
