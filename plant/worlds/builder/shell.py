"""The shell of the flat: floor, walls with door openings, frames, skirting and what hangs on the walls."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from plant.models.builder.mesh import Material, Mesh
from plant.models.builder.shapes import Box, Shape
from plant.worlds.builder.plan import (
    DOOR_HEIGHT_M,
    DOOR_WIDTH_M,
    DOORS,
    HANGINGS,
    OUTLINE_M,
    ROOMS,
    WALL_HEIGHT_M,
    WALLS,
    Door,
    Hanging,
    Room,
    Wall,
    openings,
    room,
)
from skills.robot import FloatArray

FRAME_M, FRAME_DEPTH_M, SKIRTING_M = 0.07, 0.012, 0.07
UP = np.array([0.0, 0.0, 1.0])


def shell_collisions() -> list[Shape]:
    """The floor and the wall boxes, lintels included."""
    x, y = OUTLINE_M
    floor = Box(size=(x + 2, y + 2, 0.2), p=(x / 2, y / 2, -0.1))
    return [floor, *(box for wall in WALLS for box in _wall_boxes(wall))]


def _wall_boxes(wall: Wall) -> Iterator[Box]:
    r = wall.footprint
    low, high = (r.x0, r.x1) if wall.along_x else (r.y0, r.y1)
    gaps = openings(wall)
    edges = [low, *(edge for gap in gaps for edge in gap), high]
    for a, b in zip(edges[0::2], edges[1::2], strict=True):
        yield _box(wall, a, b, 0.0, WALL_HEIGHT_M)
    for a, b in gaps:
        yield _box(wall, a, b, DOOR_HEIGHT_M, WALL_HEIGHT_M)


def _box(wall: Wall, a: float, b: float, z0: float, z1: float) -> Box:
    r = wall.footprint
    x0, x1, y0, y1 = (a, b, r.y0, r.y1) if wall.along_x else (r.x0, r.x1, a, b)
    return Box(size=(x1 - x0, y1 - y0, z1 - z0), p=((x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2))


def shell_mesh(materials: Mapping[str, Material]) -> Mesh:
    """The visual geometry of the shell."""
    mesh = Mesh(materials)
    for one in ROOMS:
        r = one.inside
        mesh.add_rectangle(one.floor, (r.x0, r.y0, 0), (r.x1 - r.x0, 0, 0), (0, r.y1 - r.y0, 0))
        for side in _sides(one):
            _add_panel(mesh, one, side)
    for wall in WALLS:
        _add_caps(mesh, wall)
    for door in DOORS:
        _add_door(mesh, door)
    for hanging in HANGINGS:
        _add_hanging(mesh, hanging)
    _add_outside(mesh)
    return mesh


@dataclass(frozen=True)
class _Side:
    """One inner face of a room: from `corner` along `along` (unit) for `length`; `inward` is its normal."""

    name: str
    corner: FloatArray
    along: FloatArray
    inward: FloatArray
    length: float


def _sides(one: Room) -> list[_Side]:
    r = one.inside
    x, y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    return [
        _Side("n", np.array([r.x0, r.y1, 0.0]), x, -y, r.x1 - r.x0),
        _Side("s", np.array([r.x1, r.y0, 0.0]), -x, y, r.x1 - r.x0),
        _Side("e", np.array([r.x1, r.y1, 0.0]), -y, -x, r.y1 - r.y0),
        _Side("w", np.array([r.x0, r.y0, 0.0]), y, x, r.y1 - r.y0),
    ]


def _gaps(side: _Side) -> list[tuple[float, float]]:
    """Door openings on a room's side, as intervals along it."""
    found = []
    for door in DOORS:
        offset = np.array([door.x, door.y, 0.0]) - side.corner
        if abs(offset @ side.inward) < 0.1 and 0 < offset @ side.along < side.length:
            middle = float(offset @ side.along)
            found.append((middle - DOOR_WIDTH_M / 2, middle + DOOR_WIDTH_M / 2))
    return sorted(found)


def _add_panel(mesh: Mesh, one: Room, side: _Side) -> None:
    gaps = _gaps(side)
    edges = [0.0, *(edge for gap in gaps for edge in gap), side.length]
    for a, b in zip(edges[0::2], edges[1::2], strict=True):
        mesh.add_rectangle(one.wall, side.corner + a * side.along, (b - a) * side.along, WALL_HEIGHT_M * UP)
        skirting = side.corner + a * side.along + FRAME_DEPTH_M * side.inward
        mesh.add_rectangle("skirting", skirting, (b - a) * side.along, SKIRTING_M * UP)
        mesh.add_rectangle("skirting", skirting + SKIRTING_M * UP, (b - a) * side.along, -FRAME_DEPTH_M * side.inward)
    for a, b in gaps:
        lintel = side.corner + a * side.along + DOOR_HEIGHT_M * UP
        mesh.add_rectangle(one.wall, lintel, (b - a) * side.along, (WALL_HEIGHT_M - DOOR_HEIGHT_M) * UP)


def _add_caps(mesh: Mesh, wall: Wall) -> None:
    r = wall.footprint
    mesh.add_rectangle("cap", (r.x0, r.y0, WALL_HEIGHT_M), (r.x1 - r.x0, 0, 0), (0, r.y1 - r.y0, 0))


def _add_door(mesh: Mesh, door: Door) -> None:
    """Jamb linings, casings on both faces and the sill."""
    turned = np.eye(3) if door.along_x else np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    frame, half, deep = Mesh(mesh.materials), DOOR_WIDTH_M / 2, 0.05 + FRAME_DEPTH_M
    for sign in (-1, 1):
        low, high = sorted((sign * half, sign * (half + FRAME_M)))
        frame.add_box("skirting", (low, -deep, 0), (high, deep, DOOR_HEIGHT_M + FRAME_M), faces={"-z": None})
    frame.add_box("skirting", (-half, -deep, DOOR_HEIGHT_M), (half, deep, DOOR_HEIGHT_M + FRAME_M))
    frame.add_rectangle("sill", (-half, -0.05, 0.0), (DOOR_WIDTH_M, 0, 0), (0, 0.10, 0))
    mesh.add_mesh(frame, turned, (door.x, door.y, 0))


def _add_hanging(mesh: Mesh, item: Hanging) -> None:
    """A picture, mirror, window or door on a room's wall, `along` being x or y in the world."""
    side = {s.name: s for s in _sides(room(item.room))}[item.side]
    axis = np.abs(side.along)
    start = side.corner + (item.along - float(side.corner @ axis)) * axis + item.z * UP
    corner = start - item.width / 2 * side.along - item.height / 2 * UP + 0.02 * side.inward
    mesh.add_rectangle(item.material, corner, item.width * side.along, item.height * UP)
    if item.frame is None:
        return
    back, edge = corner - 0.008 * side.inward - 0.04 * (side.along + UP), 0.08
    mesh.add_rectangle(item.frame, back, (item.width + edge) * side.along, (item.height + edge) * UP)


def _add_outside(mesh: Mesh) -> None:
    x, y = OUTLINE_M
    around: Sequence[tuple[tuple[float, float], tuple[float, float]]] = [
        ((0, 0), (x, 0)),
        ((x, 0), (0, y)),
        ((x, y), (-x, 0)),
        ((0, y), (0, -y)),
    ]
    for (px, py), (dx, dy) in around:
        mesh.add_rectangle("wall_outside", (px, py, 0), (dx, dy, 0), WALL_HEIGHT_M * UP)
    mesh.add_rectangle("ground", (-1, -1, -0.01), (x + 2, 0, 0), (0, y + 2, 0))
