"""A random room: walls, floor, windows, doors, pictures and furniture, as one mesh with its supports and obstacles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RollPitchYaw, RotationMatrix

from errand_make.mesh import Material, Mesh
from errand_make.shapes import Box, Cylinder, Shape
from errand_train.dataset.furnish import BY_THE_WALL, IN_THE_MIDDLE, Furnished, random_materials
from errand_train.dataset.textures import ROLES, numbers
from skills.robot import FloatArray

WALL_CLEAR_M = 0.02
FILES_PER_ROLE = 4
_HANGINGS = (
    ("pane", (0.7, 1.8), (0.8, 1.4), (0.7, 1.1)),
    ("door", (0.75, 0.95), (1.95, 2.1), (0.0, 0.01)),
    ("hung_a", (0.25, 0.9), (0.2, 0.7), (1.0, 1.6)),
    ("hung_b", (0.25, 0.9), (0.2, 0.7), (1.0, 1.6)),
)
"""Material, and spans of width, height and height over the floor (m)."""


@dataclass(frozen=True)
class Support:
    """A rectangle for objects: its middle, half sizes, yaw (rad), height and free height above (m)."""

    centre: tuple[float, float]
    half: tuple[float, float]
    yaw_rad: float
    height_m: float
    room_m: float


@dataclass(frozen=True)
class Obstacle:
    """An upright box between two corners, in the room's frame (m)."""

    low: FloatArray
    high: FloatArray


@dataclass(frozen=True)
class Room:
    """A room whose frame has its origin in a corner of the floor; `size_m` is (x, y, height)."""

    size_m: tuple[float, float, float]
    mesh: Mesh
    textures: tuple[tuple[str, int], ...]
    supports: tuple[Support, ...]
    obstacles: tuple[Obstacle, ...]
    has_ceiling: bool


def texture_file(role: str, number: int) -> str:
    """File name of a texture beside the mesh."""
    return f"{role}_{number:03d}.png"


def random_room(rng: np.random.Generator, *, for_training: bool) -> Room:
    """Draws a room for training, or one with held-out textures."""
    known = numbers(for_training=for_training)
    chosen = {role: tuple(int(n) for n in rng.choice(known, FILES_PER_ROLE, replace=False)) for role in ROLES}
    files = {role: tuple(texture_file(role, n) for n in picked) for role, picked in chosen.items()}
    size = (float(rng.uniform(2.6, 7.5)), float(rng.uniform(2.6, 6.5)), float(rng.uniform(2.3, 3.2)))
    materials = random_materials(rng, files)
    for role in ("floor", "wall", "ceiling"):
        tile = float(rng.uniform(0.5, 2.2))
        tint = rng.uniform(0.75, 1.0) * rng.uniform(0.94, 1.0, 3)
        materials[role] = Material(
            (float(tint[0]), float(tint[1]), float(tint[2])), files[role][0], (tile, tile), float(rng.uniform(0, 0.4))
        )
    if rng.random() < 0.3:
        materials["wall_b"] = Material((1.0, 1.0, 1.0), files["wall"][1], materials["wall"].tile_m)
    for k, name in enumerate(("hung_a", "hung_b", "pane", "door")):
        materials[name] = Material((1.0, 1.0, 1.0), files[("picture", "picture", "outside", "door")[k]][k % 2])
    mesh, ceiling = Mesh(materials), bool(rng.random() < 0.65)
    _shell(mesh, size, rng, ceiling)
    supports, obstacles = _furnish(mesh, size, materials, rng)
    used = tuple((role, n) for role, picked in chosen.items() for n in picked)
    return Room(size, mesh, used, tuple(supports), tuple(obstacles), ceiling)


def _sides(size: tuple[float, float, float]) -> list[tuple[FloatArray, FloatArray, FloatArray, float]]:
    """Corner, direction along, inward normal and length of each wall; seen from inside, along runs to the right."""
    w, d, _ = size
    x, y = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    return [
        (np.array([0, d, 0.0]), x, -y, w),
        (np.array([w, 0, 0.0]), -x, y, w),
        (np.array([w, d, 0.0]), -y, -x, d),
        (np.array([0, 0, 0.0]), y, x, d),
    ]


def _shell(mesh: Mesh, size: tuple[float, float, float], rng: np.random.Generator, ceiling: bool) -> None:
    w, d, h = size
    up = np.array([0, 0, 1.0])
    mesh.add_rectangle("floor", (0, 0, 0), (w, 0, 0), (0, d, 0))
    if ceiling:
        mesh.add_rectangle("ceiling", (0, d, h), (w, 0, 0), (0, -d, 0))
    for k, (corner, along, inward, length) in enumerate(_sides(size)):
        wall = "wall_b" if k == 0 and "wall_b" in mesh.materials else "wall"
        mesh.add_rectangle(wall, corner, along * length, up * h)
        mesh.add_rectangle("skirting", corner + 0.012 * inward, along * length, up * float(rng.uniform(0.04, 0.12)))
        _hang(mesh, corner, along, inward, length, rng)


def _hang(
    mesh: Mesh, corner: FloatArray, along: FloatArray, inward: FloatArray, length: float, rng: np.random.Generator
) -> None:
    """A window, a door, pictures or nothing on a wall."""
    at = float(rng.uniform(0.2, 0.8))
    while at < length - 1.2:
        name, wide, tall, low = _HANGINGS[int(rng.integers(len(_HANGINGS)))]
        w, t, z = (float(rng.uniform(*span)) for span in (wide, tall, low))
        if at + w < length - 0.1:
            start = corner + along * at + 0.016 * inward + np.array([0, 0, z])
            mesh.add_rectangle(name, start, along * w, np.array([0, 0, t]))
        at += w + float(rng.uniform(0.3, 2.0))


def _furnish(
    mesh: Mesh, size: tuple[float, float, float], materials: dict[str, Material], rng: np.random.Generator
) -> tuple[list[Support], list[Obstacle]]:
    supports, obstacles = list[Support](), list[Obstacle]()
    for corner, along, inward, length in _sides(size):
        at = float(rng.uniform(0.0, 0.8))
        while at < length - 0.5:
            made = BY_THE_WALL[int(rng.integers(len(BY_THE_WALL)))](rng, materials)
            if at + made.width_m < length - 0.05:
                _set(
                    mesh,
                    made,
                    corner + along * (at + made.width_m / 2) + WALL_CLEAR_M * inward,
                    -inward,
                    supports,
                    obstacles,
                )
            at += made.width_m + float(rng.choice([0.03, rng.uniform(0.2, 1.6)]))
    for _ in range(int(rng.integers(0, 3))):
        made = IN_THE_MIDDLE[int(rng.integers(len(IN_THE_MIDDLE)))](rng, materials)
        yaw = float(rng.uniform(0, 2 * np.pi))
        x, y = float(rng.uniform(1.0, size[0] - 1.0)), float(rng.uniform(1.0, size[1] - 1.0))
        _set(mesh, made, np.array([x, y, 0.0]), np.array([np.cos(yaw), np.sin(yaw), 0.0]), supports, obstacles)
    if rng.random() < 0.3:
        w, d = float(rng.uniform(0.8, size[0] * 0.6)), float(rng.uniform(0.8, size[1] * 0.6))
        mesh.add_rectangle("rug", (size[0] / 2 - w / 2, size[1] / 2 - d / 2, 0.004), (w, 0, 0), (0, d, 0))
    return supports, obstacles


def _set(
    mesh: Mesh,
    made: Furnished,
    back: FloatArray,
    into_wall: FloatArray,
    supports: list[Support],
    obstacles: list[Obstacle],
) -> None:
    """Puts a piece with the middle of its back at a point, its y axis along `into_wall`, unless it would overlap."""
    x_axis = np.array([into_wall[1], -into_wall[0], 0.0])
    R = np.column_stack([x_axis, into_wall, [0, 0, 1.0]])
    new = [_bounds(shape, R, back) for shape in made.piece.collisions]
    if any(_overlap(a, b) for a in new for b in obstacles):
        return
    mesh.add_mesh(made.piece.mesh, R, back)
    obstacles += new
    yaw = float(np.arctan2(x_axis[1], x_axis[0]))
    for top in made.tops:
        x0, y0, x1, y1 = top.rect
        centre = back + R @ np.array([(x0 + x1) / 2, (y0 + y1) / 2, 0])
        if x1 - x0 > 0.05 and y1 - y0 > 0.05:
            half = ((x1 - x0) / 2, (y1 - y0) / 2)
            supports.append(Support((float(centre[0]), float(centre[1])), half, yaw, top.height_m, top.room_m))


def _bounds(shape: Shape, R: FloatArray, p: FloatArray) -> Obstacle:
    if isinstance(shape, Box):
        half = np.abs(R @ RotationMatrix(RollPitchYaw(*shape.rpy)).matrix()) @ np.array(shape.size) / 2
    elif isinstance(shape, Cylinder):
        half = np.array([shape.radius, shape.radius, shape.length / 2])
    else:
        raise TypeError(f"furniture has boxes and cylinders only, not a {type(shape).__name__}")
    centre = p + R @ np.array(shape.p)
    return Obstacle(centre - half, centre + half)


def _overlap(a: Obstacle, b: Obstacle) -> bool:
    return bool(np.all(a.low < b.high - 0.005) and np.all(b.low < a.high - 0.005))
