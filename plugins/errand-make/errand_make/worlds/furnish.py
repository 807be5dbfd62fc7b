"""Adds furniture, objects, people, a dock and names of rooms to the folder of a world."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from os.path import relpath
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely

from errand_make.mesh import Material, Mesh, mtl_text, obj_text, palette_picture, write_text
from errand_make.shapes import Box, Model, model_sdf
from errand_make.worlds.rooms import (
    BANDS_M,
    FREE,
    OCCUPIED,
    Bools,
    Grid,
    Point,
    body_margin_m,
    clearance_m,
    pgm_bytes,
    reached_cells,
    yaml_text,
)
from executive.app.prepare.worlds import open_world
from executive.words.slug import slug
from plant.scene_pictures import save_png
from plant.worlds.geometry_files import OWN_PACKAGE
from plant.worlds.seeding import place_people
from plant.worlds.world import World, WorldError
from skills.inputs.errors import InputError
from skills.inputs.yaml_source import parse_yaml, read_yaml, yaml_of
from skills.robot import Pose2D

Size = tuple[float, float, float]
"""Width along the front, depth and height, in metres."""
SIZES: Final[Mapping[str, Size]] = {"table": (1.2, 0.7, 0.75), "desk": (1.4, 0.7, 0.74), "shelf": (0.9, 0.4, 0.9)}
"""Kinds of furniture, each with a flat top for objects."""
PERSON: Final = "person"
PERSON_SIZE: Final[Size] = (0.5, 0.5, 1.7)
"""Size of what a person takes up, with some clearance."""
VIEW_M: Final = 0.92
"""Distance of a viewpoint from the front edge, m."""
_BOARD_M, _LEG_M = 0.03, 0.05
_WIDE_M: Final = 1.4
"""A wider top needs two viewpoints."""
_FROM_DOOR_M, _FROM_START_M, _STEP_M, _BEHIND_M, _BESIDE_M, _SPARE_M = 0.9, 1.6, 0.1, 0.1, 0.3, 0.1
_PERSON_M: Final = (1.05, 1.35)
"""Range of the distance between the start and a person who stands before it, m."""
_PERSON_RADIUS_M: Final = 0.35
_APART_M: Final = 1.0
"""Distance of a person from other people, the start, and the poses of places."""
_PERSON_CLEAR_M: Final = 0.5
_MOST_TRIED: Final = 200
_SEEDS: Final = 6
_BEARINGS: Final = tuple(k * math.pi / 8 for k in (3, -3, 2, -2, 4, -4, 1, -1, 0))
"""Bearings of a person, seen from the start; the way ahead is the last choice."""
_COMMON_FACTS: Final = "flat"
"""World with facts of many objects in its knowledge, for additions to other worlds."""
_MATERIALS: Final = {"wood": Material((0.72, 0.55, 0.36))}
_RULES: Final = """# What the seed places: loose objects on surfaces, people about the start.
rules: {from_edge_m: [0.08, 0.25], clear_m: 0.12, rim_m: 0.03, drop_m: 0.001}
fronts: {}
objects: []
"""


@dataclass(frozen=True)
class Furniture:
    """Piece of furniture: `pose` is the middle of its footprint, and its yaw the direction of the front."""

    kind: str
    name: str
    size: Size
    pose: Pose2D

    def boxes(self) -> tuple[Box, ...]:
        """Collision shapes in its own frame: x to the front, z up, on the floor."""
        width, depth, height = self.size
        below = height - _BOARD_M
        if self.kind == PERSON:
            return (Box(size=(depth, width, height), p=(0.0, 0.0, height / 2)),)
        top = Box(size=(depth, width, _BOARD_M), p=(0.0, 0.0, height - _BOARD_M / 2.0))
        if self.kind == "table":
            at = [(i * (depth / 2 - _LEG_M), j * (width / 2 - _LEG_M), below / 2) for i in (-1, 1) for j in (-1, 1)]
            return (top, *(Box(size=(_LEG_M, _LEG_M, below), p=place) for place in at))
        sides = [
            Box(size=(depth, _BOARD_M, below), p=(0.0, side * (width - _BOARD_M) / 2, below / 2)) for side in (-1, 1)
        ]
        if self.kind == "desk":
            return (top, *sides)
        back = Box(size=(_BOARD_M, width, below), p=((_BOARD_M - depth) / 2, 0.0, below / 2))
        boards = [Box(size=(depth, width, _BOARD_M), p=(0.0, 0.0, height * share)) for share in (1 / 3, 2 / 3)]
        return (top, *sides, back, *boards)

    def point(self, ahead_m: float, aside_m: float) -> tuple[float, float]:
        """Point in the world (m) ahead of the middle, towards the front, and aside to the left."""
        c, s = math.cos(self.pose.yaw_rad), math.sin(self.pose.yaw_rad)
        x, y = self.pose.x_m + c * ahead_m - s * aside_m, self.pose.y_m + s * ahead_m + c * aside_m
        return round(x, 3), round(y, 3)

    def outline(self) -> list[list[float]]:
        """Corners of the top in the world frame, m."""
        width, depth, _ = self.size
        corners = ((1, -1), (1, 1), (-1, 1), (-1, -1))
        return [list(self.point(i * depth / 2, j * width / 2)) for i, j in corners]

    def viewpoints(self) -> list[Pose2D]:
        """Poses from which the robot sees the whole top."""
        width, depth, _ = self.size
        yaw = math.remainder(self.pose.yaw_rad + math.pi, math.tau)
        aside = (0.0,) if width <= _WIDE_M else (-width / 4, width / 4)
        return [Pose2D(*self.point(depth / 2 + VIEW_M, each), yaw) for each in aside]

    def front(self) -> list[list[float]]:
        """Part of the front edge before which the robot can stand."""
        width, depth, _ = self.size
        return [list(self.point(depth / 2, side * (width / 2 - 0.1))) for side in (-1, 1)]


def covered(grid: Grid, pose: Pose2D, box: Box) -> Bools:
    """Mask of the cells under a box in the frame of a pose."""
    rows, columns = np.indices(grid.cells.shape)
    x, y = ((k + 0.5) * grid.resolution_m + low for k, low in zip((columns, rows), grid.origin_m, strict=True))
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    ahead, aside = c * (x - pose.x_m) + s * (y - pose.y_m), c * (y - pose.y_m) - s * (x - pose.x_m)
    half = grid.resolution_m / 2.0
    inside = np.abs(ahead - box.p[0]) <= box.size[0] / 2.0 + half
    return np.asarray(inside & (np.abs(aside - box.p[1]) <= box.size[1] / 2.0 + half))


def with_furniture(grid: Grid, piece: Furniture, band_m: tuple[float, float]) -> Grid:
    """Returns a grid in which the parts of a piece within a height band (m) are occupied."""
    cells = grid.cells.copy()
    for box in piece.boxes():
        low, high = box.p[2] - box.size[2] / 2.0, box.p[2] + box.size[2] / 2.0
        if low < band_m[1] and high > band_m[0]:
            cells[covered(grid, piece.pose, box)] = OCCUPIED
    return replace(grid, cells=cells)


def refusal(world: World, grid: Grid, piece: Furniture, rooms: Mapping[str, Pose2D]) -> str | None:
    """Returns why a piece cannot stand there on the keep-out grid, or None."""
    width, depth, height = piece.size
    place = covered(grid, piece.pose, Box(size=(depth, width, height), p=(0.0, 0.0, height / 2.0)))
    if not place.any() or np.any(grid.cells[place] != FREE):
        return "it touches a wall or furniture, or lies outside"
    after = with_furniture(grid, piece, BANDS_M["keepout"])
    clearance, outline = clearance_m(after), shapely.Polygon(piece.outline())
    for other, at in people_W(world):
        if outline.dwithin(shapely.Point(at), _PERSON_RADIUS_M / 2.0):
            return f"{other} stands there"
    if min(body_margin_m(after, clearance, pose) for pose in piece.viewpoints()) < _SPARE_M:
        return "there is no room for the robot in front"
    before, was_reached = clearance_m(grid), reached_cells(clearance_m(grid), grid, world.start)
    usable = {
        name: pose
        for name, pose in {**rooms, "": world.start}.items()
        if body_margin_m(grid, before, pose) >= 0.0 and _in(was_reached, grid, pose)
    }
    if any(body_margin_m(after, clearance, pose) < 0.0 for pose in usable.values()):
        return "it stands where the robot starts, or from where it looks at a room or surface"
    reached = reached_cells(clearance, after, world.start)
    if not all(_in(reached, after, pose) for pose in (*usable.values(), *piece.viewpoints())):
        return "the robot could no longer reach all rooms and its front"
    return None


def place_in(
    world: World, grid: Grid, piece: Furniture, room: Sequence[Point], doors: Sequence[Point], rooms: Any
) -> Furniture:
    """Returns the piece with its back at a wall of a room, far from doors. Raises WorldError when it fits nowhere."""
    found = sorted(_spots(world, grid, piece, room, doors), key=lambda each: each[0], reverse=True)
    for _, moved in found[:_MOST_TRIED]:
        if refusal(world, grid, moved, rooms) is None:
            return moved
    raise WorldError(f"a {piece.kind} of {piece.size[0]:g} x {piece.size[1]:g} m fits at no wall of that room")


def _spots(
    world: World, grid: Grid, piece: Furniture, room: Sequence[Point], doors: Sequence[Point]
) -> Iterator[tuple[float, Furniture]]:
    """Yields poses with the back at a wall, each with its distance (m) to the nearest door."""
    clearance, (width, depth, _) = clearance_m(grid), piece.size
    (x0, y0), (x1, y1) = (tuple(map(pick, zip(*room, strict=True))) for pick in (min, max))
    for x in np.arange(x0, x1, _STEP_M):
        for y in np.arange(y0, y1, _STEP_M):
            far_m = min((math.dist((x, y), door) for door in doors), default=9.0) - width / 2
            if far_m < _FROM_DOOR_M or math.dist((x, y), (world.start.x_m, world.start.y_m)) < _FROM_START_M:
                continue
            for quarter in range(4):
                moved = replace(piece, pose=Pose2D(float(x), float(y), quarter * math.pi / 2))
                back = (moved.point(-depth / 2 - _BEHIND_M, side * width / 3) for side in (-1, 0, 1))
                inner = (moved.point(0.0, side / 4 * (width / 2 + _BESIDE_M)) for side in range(-4, 5))
                at_wall = all(_free(grid, clearance, at) <= 0.0 for at in back)
                if at_wall and all(_free(grid, clearance, at) > 0.0 for at in inner):
                    yield round(far_m, 2), moved


def _in(cells: Bools, grid: Grid, pose: Pose2D) -> bool:
    """Returns whether a pose, inside the grid, stands on one of the cells."""
    at = (np.array([pose.x_m, pose.y_m]) - grid.origin_m) // grid.resolution_m
    return bool(cells[int(at[1]), int(at[0])])


def _free(grid: Grid, clearance: Any, at: tuple[float, float]) -> float:
    """Clearance (m) at a point; 0 at occupied points and outside."""
    column, row = (int((value - low) // grid.resolution_m) for value, low in zip(at, grid.origin_m, strict=True))
    inside = 0 <= row < clearance.shape[0] and 0 <= column < clearance.shape[1]
    return max(0.0, float(clearance[row, column])) if inside else 0.0


def add_furniture(folder: Path, piece: Furniture, place: str, grids: Mapping[str, Grid]) -> None:
    """Writes a piece into a world: model, surface, viewpoints, front, and the robot's grids by the name of the file.

    Raises WorldError when a file cannot be extended.
    """
    name, height = slug(piece.name), piece.size[2]
    mesh, models = Mesh(_MATERIALS), folder / "furniture"
    for box in piece.boxes():
        mesh.add_box("wood", np.array(box.p) - np.array(box.size) / 2, np.array(box.p) + np.array(box.size) / 2)
    views = [{"x": pose.x_m, "y": pose.y_m, "yaw": round(pose.yaw_rad, 4)} for pose in piece.viewpoints()]
    facts = {"place": place, "height": height, "polygon": piece.outline(), "viewpoints": views}
    knowledge = with_entry(folder / "knowledge.yaml", "surfaces", piece.name, facts)
    rules = with_entry(folder / "objects.yaml", "fronts", piece.name, [piece.front()], usual=_RULES)
    weld = _directives(folder / "world.dmd.yaml", name, piece.pose)
    models.mkdir(exist_ok=True)
    write_text(models / f"{name}.sdf", model_sdf(Model(name, f"{name}.obj", piece.boxes())))
    write_text(models / f"{name}.obj", obj_text(mesh, f"{name}.mtl"))
    write_text(models / f"{name}.mtl", mtl_text(mesh, f"{name}.png"))
    save_png(models / f"{name}.png", palette_picture(_MATERIALS), 9)
    for file, grid in grids.items():
        band = BANDS_M[file]
        changed = with_furniture(grid, piece, band)
        (folder / "map" / f"{file}.pgm").write_bytes(pgm_bytes(changed))
        write_text(folder / "map" / f"{file}.yaml", yaml_text(changed, f"{file}.pgm", band))
    for path, text in zip(("knowledge.yaml", "objects.yaml", "world.dmd.yaml"), (knowledge, rules, weld), strict=True):
        write_text(folder / path, text)


def _directives(file: Path, name: str, pose: Pose2D) -> str:
    text = file.read_text(encoding="utf-8")
    return f"""{text.rstrip()}
- add_model:
    name: {name}
    file: package://{OWN_PACKAGE}/furniture/{name}.sdf
- add_weld:
    parent: world
    child: {name}::{name}
    X_PC:
      translation: [{pose.x_m:g}, {pose.y_m:g}, 0]
      rotation: !Rpy {{deg: [0, 0, {math.degrees(pose.yaw_rad):.2f}]}}
"""


def add_object(folder: Path, world: World, name: str, surface: str, *, thing: str, model: Path | None) -> str:
    """Adds an object that the seed places on a surface, and its usual place to the knowledge; returns its name.

    `name` is that of its model, which further objects have with a number, `thing` the class of the model, and `model` a
    folder that the world is to import. Raises WorldError.
    """
    facts, rules = folder / "knowledge.yaml", folder / "objects.yaml"
    taken = {each.name for each in world.seed_rules.objects} | {each.name for each in world.seed_rules.people}
    own = name if name not in taken else next(each for k in count(2) if (each := f"{name}_{k}") not in taken)
    if thing not in (read_yaml(facts).data.get("things") or {}):
        known = read_yaml(open_world(_COMMON_FACTS).knowledge_path).data["things"].get(thing, {})
        write_text(facts, with_entry(facts, "things", thing, {**known, "usual": [surface]}))
    if model is not None:
        write_text(rules, with_entry(rules, "imports", None, relpath(model.resolve(), folder.resolve()), usual=_RULES))
    rule = {"name": own, "model": name, "surfaces": [surface]}
    write_text(rules, with_entry(rules, "objects", None, rule, usual=_RULES))
    return own


def people_W(world: World) -> list[tuple[str, Point]]:
    """Returns the points where some seeds place each person, with the person's name."""
    placed = [each for seed in range(_SEEDS) for each in place_people(world, seed)]
    return [(each.name, (float(each.X_WO.translation()[0]), float(each.X_WO.translation()[1]))) for each in placed]


def person_before_start(world: World, grid: Grid) -> Mapping[str, Any] | None:
    """Returns ranges before the robot's start where a person has clearance, apart from others; None without any."""
    clearance, start, others = clearance_m(grid), world.start, [at for _, at in people_W(world)]
    for bearing in _BEARINGS:
        yaw = start.yaw_rad + bearing
        at = [(start.x_m + r * math.cos(yaw), start.y_m + r * math.sin(yaw)) for r in (*_PERSON_M, sum(_PERSON_M) / 2)]
        apart = all(math.dist(each, other) > _APART_M for each in at for other in others)
        if apart and min(_free(grid, clearance, each) for each in at) > _PERSON_RADIUS_M:
            about = [round(bearing - 0.05, 3), round(bearing + 0.05, 3)]
            return {"distance_m": list(_PERSON_M), "bearing_rad": about, "turned_rad": [-0.2, 0.2]}
    return None


def place_person(
    world: World, grid: Grid, name: str, room: Sequence[Point], doors: Sequence[Point], rooms: Any, about: Point
) -> Furniture:
    """Returns a person in a room as near to a point as is free, turned to it, apart from doors, places and others.

    Raises WorldError when there is no such place.
    """
    rows, columns = np.nonzero(clearance_m(grid) > _PERSON_CLEAR_M)
    spots = (np.column_stack([columns, rows]) + 0.5) * grid.resolution_m + grid.origin_m
    spots = spots[shapely.contains_xy(shapely.Polygon(room), *spots.T)]
    kept = [(pose.x_m, pose.y_m) for pose in (world.start, *rooms.values())]
    for other in (*kept, *doors, *(at for _, at in people_W(world))):
        spots = spots[np.hypot(*(spots - other).T) > _APART_M]
    nearest = spots[np.argsort(np.hypot(*(spots - about).T), kind="stable")].round(2)
    for x, y in nearest[:: max(1, len(nearest) // _MOST_TRIED)].tolist():
        facing = round(math.atan2(about[1] - y, about[0] - x), 2)
        piece = Furniture(PERSON, name, PERSON_SIZE, Pose2D(x, y, facing))
        if refusal(world, grid, piece, rooms) is None:
            return piece
    raise WorldError("there is no free place for a person; name one by --at X Y YAW, or another room by --in")


def add_person(folder: Path, name: str, place: str, where: Mapping[str, Any]) -> None:
    """Writes a person into a world: where they stand, and their usual place. Raises WorldError for a taken name."""
    knowledge = with_entry(folder / "knowledge.yaml", "people", name, {"at": place})
    rules = with_entry(folder / "objects.yaml", "people", None, {"name": name, **where}, usual=_RULES)
    write_text(folder / "knowledge.yaml", knowledge)
    write_text(folder / "objects.yaml", rules)


def dock_pose(world: World, grid: Grid, doors: Sequence[Point]) -> Pose2D:
    """Returns a pose for a dock: near a wall, away from start and doors, and reachable. Raises WorldError."""
    clearance = clearance_m(grid)
    rows, columns = np.nonzero((clearance > 0.35) & (clearance < 0.9))
    spots = (np.column_stack([columns, rows]) + 0.5) * grid.resolution_m + grid.origin_m
    start, reached = (world.start.x_m, world.start.y_m), reached_cells(clearance, grid, world.start)
    for x, y in sorted(spots.round(3).tolist(), key=lambda each: math.dist(each, start))[::7]:
        if math.dist((x, y), start) < _FROM_START_M or any(math.dist((x, y), door) < 1.2 for door in doors):
            continue
        for pose in (Pose2D(x, y, round(k * math.pi / 2, 4)) for k in range(4)):
            if body_margin_m(grid, clearance, pose) >= _SPARE_M and _in(reached, grid, pose):
                return pose
    raise WorldError("there is no free place for a dock; name one by --at X Y YAW")


def add_dock(folder: Path, pose: Pose2D) -> None:
    """Writes the pose of a dock into the robot's knowledge. Raises WorldError when there is one."""
    file = folder / "knowledge.yaml"
    text = file.read_text(encoding="utf-8")
    if parse_yaml(text, file).data.get("dock") is not None:
        raise WorldError(f"there is a dock in {file.name} already")
    write_text(file, f"{text.rstrip()}\ndock: {{x: {pose.x_m}, y: {pose.y_m}, yaw: {pose.yaw_rad}}}\n")


def with_entry(file: Path, key: str, name: str | None, value: Any, *, usual: str = "") -> str:
    """Returns a file's text with one more entry under a key; without a `name` the key has a list.

    Comments stay. `usual` is the text of a missing file. Raises WorldError when the name is taken, or the file's form
    does not allow it.
    """
    text = file.read_text(encoding="utf-8") if file.is_file() else usual
    data = parse_yaml(text, file).data
    held = data.get(key) or ([] if name is None else {})
    if name is not None and name in held:
        raise WorldError(f"'{name}' is in {file.name} already")
    entry = yaml_of([value] if name is None else {name: value}, flow_style=False if isinstance(value, str) else None)
    if held:
        begun = re.search(rf"^{key}:[^\n]*\n(?:\s*#[^\n]*\n|\s*\n)*( *)", text, re.MULTILINE)
        indent, at = (begun[1], begun.start(1)) if begun else ("", len(text))
    else:
        text, indent = re.sub(rf"^{key}:.*\n", "", text, flags=re.MULTILINE).rstrip() + f"\n\n{key}:\n", "  "
        at = len(text)
    new = text[:at] + "".join(f"{indent}{line}\n" for line in entry.splitlines()) + text[at:]
    expected: Any = [value, *held] if name is None else {name: value, **dict(held)}
    if not _holds(new, file, {**dict(data), key: expected}):
        raise WorldError(f"{file.name} has a form that cannot be extended; add it there:\n{key}:\n{entry}")
    return new


def without_entry(file: Path, key: str, name: str) -> str:
    """Returns a file's text without the entry of a name under a key; comments stay.

    Raises WorldError when the file's form does not allow it.
    """
    text = file.read_text(encoding="utf-8")
    source, lines = parse_yaml(text, file), text.splitlines(keepends=True)
    left = {other: value for other, value in source.data[key].items() if other != name}
    first = source.line((key, name) if left else (key,)) - 1
    indent = len(lines[first]) - len(lines[first].lstrip())
    ends = (n for n in range(first + 1, len(lines)) if not lines[n].startswith((" " * (indent + 1), "\n")))
    new = "".join((*lines[:first], *lines[next(ends, len(lines)) :]))
    expected = {**source.data, key: left} if left else {one: data for one, data in source.data.items() if one != key}
    if not _holds(new, file, expected):
        raise WorldError(f"'{name}' stands in {file.name} in a form that cannot be changed; remove it there")
    return new


def _holds(text: str, file: Path, data: Any) -> bool:
    """Returns whether the text of a file reads as this data."""
    try:
        return bool(parse_yaml(text, file).data == data)
    except InputError:
        return False


def with_room_name(file: Path, former: str, name: str) -> str:
    """Returns the text of knowledge.yaml in which a room has another name. Raises WorldError."""
    text = file.read_text(encoding="utf-8")
    new = re.sub(rf"(^ *|[:,] |\[){re.escape(former)}(?= *[:,\]}}\n])", rf"\g<1>{name}", text, flags=re.MULTILINE)
    if parse_yaml(new, file).data != _renamed(parse_yaml(text, file).data, former, name):
        raise WorldError(f"the room's name stands in {file.name} in a form that cannot be changed; change it there")
    return new


def _renamed(value: Any, former: str, name: str) -> Any:
    """Replaces a text in plain data, in keys and values."""
    if isinstance(value, dict):
        return {_renamed(key, former, name): _renamed(each, former, name) for key, each in value.items()}
    if isinstance(value, list):
        return [_renamed(each, former, name) for each in value]
    return name if value == former else value
