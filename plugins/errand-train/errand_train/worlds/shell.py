"""The shell of a world: floor, walls with door openings, frames, skirting and hangings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from errand_make.mesh import Material, Mesh
from errand_make.shapes import Box, Shape
from errand_train.worlds.plan import Door, Hanging, Plan, Rectangle, Room
from skills.robot import FloatArray

FRAME_M, FRAME_DEPTH_M, SKIRTING_M = 0.07, 0.012, 0.07
UP = np.array([0.0, 0.0, 1.0])
_NOTHING_M = 1e-6

Span = tuple[float, float]
_Gap = tuple[Rectangle, Door]


def shell_collisions(plan: Plan) -> list[Shape]:
    """Collision shapes of the floor and the walls, with lintels."""
    x, y = plan.outline_m
    floor = Box(size=(x + 2, y + 2, 0.2), p=(x / 2, y / 2, -0.1))
    return [floor, *(box for wall in plan.walls for box in _wall_boxes(plan, wall))]


def _wall_boxes(plan: Plan, wall: Rectangle) -> Iterator[Box]:
    """A wall beside its doors, then the lintels over them."""
    gaps, sides = _divided(plan, wall, plan.doors)
    spans = [(side, 0.0) for side in sides] + [(gap, plan.door_height_m) for gap, door in gaps if not door.open]
    for (x0, y0, x1, y1), z0 in spans:
        yield Box(
            size=(x1 - x0, y1 - y0, plan.wall_height_m - z0),
            p=((x0 + x1) / 2, (y0 + y1) / 2, (z0 + plan.wall_height_m) / 2),
        )


def _divided(plan: Plan, wall: Rectangle, doors: Iterable[Door]) -> tuple[list[_Gap], list[Rectangle]]:
    """The openings of these doors in a wall, as far as they lie in it, and what is left of it.

    A wall runs along its longer side.
    """
    x0, y0, x1, y1 = wall
    along_x = x1 - x0 > y1 - y0
    low, high = (x0, x1) if along_x else (y0, y1)
    inside = [d for d in doors if x0 <= d.x <= x1 and y0 <= d.y <= y1 and d.along_x == along_x]
    gaps, sides = _around(plan, low, high, [(d.x if along_x else d.y, d) for d in inside])

    def part(a: float, b: float) -> Rectangle:
        return (a, y0, b, y1) if along_x else (x0, a, x1, b)

    return [(part(a, b), door) for a, b, door in gaps], [part(a, b) for a, b in sides]


def _around(
    plan: Plan, low: float, high: float, doors: Iterable[tuple[float, Door]]
) -> tuple[list[tuple[float, float, Door]], list[Span]]:
    """The openings of the doors with these middles, in order, and what is left of a line from low to high."""
    halves = sorted((middle, plan.width_m(door) / 2, door) for middle, door in doors)
    gaps = [(middle - half, middle + half, door) for middle, half, door in halves]
    edges = [low, *(edge for a, b, _ in gaps for edge in (a, b)), high]
    spans = zip(edges[0::2], edges[1::2], strict=True)
    return gaps, [(a, b) for a, b in spans if b - a > _NOTHING_M]


def shell_mesh(plan: Plan, materials: Mapping[str, Material]) -> Mesh:
    """Visual geometry of the shell."""
    mesh = Mesh(materials)
    for one in plan.rooms:
        x0, y0, x1, y1 = one.inside
        mesh.add_rectangle(one.floor, (x0, y0, 0), (x1 - x0, 0, 0), (0, y1 - y0, 0))
        for side in _sides(one).values():
            _add_panel(mesh, plan, one, side)
    open_doors = [door for door in plan.doors if door.open]
    for wall in plan.walls:
        for x0, y0, x1, y1 in _divided(plan, wall, open_doors)[1]:
            mesh.add_rectangle("cap", (x0, y0, plan.wall_height_m), (x1 - x0, 0, 0), (0, y1 - y0, 0))
    for door in plan.doors:
        if not door.open:
            _add_door(mesh, plan, door)
    for hanging in plan.hangings:
        _add_hanging(mesh, plan, hanging)
    _add_outside(mesh, plan)
    return mesh


@dataclass(frozen=True)
class _Side:
    """One inner face of a room: from `corner` along `along` (unit) for `length`; `inward` is its normal."""

    corner: FloatArray
    along: FloatArray
    inward: FloatArray
    length: float


def _sides(one: Room) -> dict[str, _Side]:
    """The sides of a room by name."""
    x0, y0, x1, y1 = one.inside
    x, y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    return {
        "n": _Side(np.array([x0, y1, 0.0]), x, -y, x1 - x0),
        "s": _Side(np.array([x1, y0, 0.0]), -x, y, x1 - x0),
        "e": _Side(np.array([x1, y1, 0.0]), -y, -x, y1 - y0),
        "w": _Side(np.array([x0, y0, 0.0]), y, x, y1 - y0),
    }


def _doors_along(plan: Plan, side: _Side) -> Iterator[tuple[float, Door]]:
    """The doors on a room's side, each with its middle as a length along it."""
    for door in plan.doors:
        offset = np.array([door.x, door.y, 0.0]) - side.corner
        if abs(offset @ side.inward) < 0.1 and 0 < offset @ side.along < side.length:
            yield float(offset @ side.along), door


def _add_panel(mesh: Mesh, plan: Plan, one: Room, side: _Side) -> None:
    gaps, spans = _around(plan, 0.0, side.length, _doors_along(plan, side))
    for a, b in spans:
        mesh.add_rectangle(one.wall, side.corner + a * side.along, (b - a) * side.along, plan.wall_height_m * UP)
        skirting = side.corner + a * side.along + FRAME_DEPTH_M * side.inward
        mesh.add_rectangle("skirting", skirting, (b - a) * side.along, SKIRTING_M * UP)
        mesh.add_rectangle("skirting", skirting + SKIRTING_M * UP, (b - a) * side.along, -FRAME_DEPTH_M * side.inward)
    for a, b, door in gaps:
        if door.open:
            continue
        lintel = side.corner + a * side.along + plan.door_height_m * UP
        mesh.add_rectangle(one.wall, lintel, (b - a) * side.along, (plan.wall_height_m - plan.door_height_m) * UP)


def _add_door(mesh: Mesh, plan: Plan, door: Door) -> None:
    """Jamb linings, casings on both faces and the sill."""
    turned = np.eye(3) if door.along_x else np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    frame, half, deep = Mesh(mesh.materials), plan.width_m(door) / 2, 0.05 + FRAME_DEPTH_M
    top = plan.door_height_m
    for sign in (-1, 1):
        low, high = sorted((sign * half, sign * (half + FRAME_M)))
        frame.add_box("skirting", (low, -deep, 0), (high, deep, top + FRAME_M), faces={"-z": None})
    frame.add_box("skirting", (-half, -deep, top), (half, deep, top + FRAME_M))
    frame.add_rectangle("sill", (-half, -0.05, 0.0), (2 * half, 0, 0), (0, 0.10, 0))
    mesh.add_mesh(frame, turned, (door.x, door.y, 0))


def _add_hanging(mesh: Mesh, plan: Plan, item: Hanging) -> None:
    """A picture, mirror, window or door on a room's wall, `along` being x or y in the world."""
    (room,) = (each for each in plan.rooms if each.name == item.room)
    side = _sides(room)[item.side]
    axis = np.abs(side.along)
    start = side.corner + (item.along - float(side.corner @ axis)) * axis + item.z * UP
    corner = start - item.width / 2 * side.along - item.height / 2 * UP + 0.02 * side.inward
    mesh.add_rectangle(item.material, corner, item.width * side.along, item.height * UP)
    if item.frame is None:
        return
    back, edge = corner - 0.008 * side.inward - 0.04 * (side.along + UP), 0.08
    mesh.add_rectangle(item.frame, back, (item.width + edge) * side.along, (item.height + edge) * UP)


def _add_outside(mesh: Mesh, plan: Plan) -> None:
    x, y = plan.outline_m
    around = (((0, 0), (x, 0)), ((x, 0), (0, y)), ((x, y), (-x, 0)), ((0, y), (0, -y)))
    for (px, py), (dx, dy) in around:
        mesh.add_rectangle("wall_outside", (px, py, 0), (dx, dy, 0), plan.wall_height_m * UP)
    mesh.add_rectangle("ground", (-1, -1, -0.01), (x + 2, 0, 0), (0, y + 2, 0))
