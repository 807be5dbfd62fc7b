"""A model while it is made: looks, pictures, collision shapes and mass, gathered from parts."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from plant.models.builder.inertia import scaled_to, shell_mass, solid_mass, together
from plant.models.builder.mesh import IDENTITY, Colour, Material, Mesh
from plant.models.builder.pictures import to_picture
from plant.models.builder.shapes import Box, Capsule, Cylinder, MassProperties, Shape, Sphere
from skills.robot import FloatArray, Picture

PROUD_M = 0.0003

STEEL, WOOD, GLASS, PLASTIC, RUBBER, WATER = 7850.0, 650.0, 2500.0, 1050.0, 1150.0, 1000.0
ALUMINIUM, CERAMIC, PAPER, FLESH = 2700.0, 2300.0, 700.0, 1000.0


@dataclass(frozen=True)
class Finished:
    """A model ready to be written; all in its own frame."""

    mesh: Mesh
    pictures: dict[str, Picture]
    collisions: tuple[Shape, ...]
    mass: MassProperties
    size_m: tuple[float, float, float]


class Draft:
    """Grows part by part. Lengths in metres, densities in kg/m^3 (solids) or kg/m^2 (shells)."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.materials: dict[str, Material] = {}
        self.mesh = Mesh(self.materials)
        self._pictures: dict[str, Picture] = {}
        self._bodies: list[MassProperties] = []
        self._collisions: list[Shape] = []

    def paint(self, name: str, colour: ArrayLike, *, shine: float = 0.3, metal: float = 0.0) -> str:
        """A plain material; its name."""
        r, g, b = (float(v) for v in np.clip(np.asarray(colour, dtype=float), 0.0, 1.0))
        self.materials[name] = Material((r, g, b), None, None, shine, metal)
        return name

    def picture(self, name: str, values: FloatArray, *, shine: float = 0.3, metal: float = 0.0) -> str:
        """A material that shows a picture (H, W, 3; 0..1), stretched over each surface; its name."""
        self._pictures[f"{name}.png"] = to_picture(values, 128)
        self.materials[name] = Material((1.0, 1.0, 1.0), f"{name}.png", None, shine, metal)
        return name

    def part(self) -> Mesh:
        """An empty mesh with this draft's materials."""
        return Mesh(self.materials)

    def solid(self, part: Mesh, density: float, R: ArrayLike = IDENTITY, p: ArrayLike = (0, 0, 0)) -> None:
        """Add a closed part of solid matter at a pose; one that is inside out is turned."""
        placed = outward(part, R, p)
        self.mesh.add_mesh(placed)
        self._bodies.append(solid_mass(placed, density))

    def shell(self, part: Mesh, density: float, R: ArrayLike = IDENTITY, p: ArrayLike = (0, 0, 0)) -> None:
        """Add a part that is a thin shell."""
        self._bodies.append(shell_mass(self.look(part, R, p), density))

    def look(self, part: Mesh, R: ArrayLike = IDENTITY, p: ArrayLike = (0, 0, 0)) -> Mesh:
        """Add a part that weighs nothing; the part as placed."""
        placed = Mesh(self.materials)
        placed.add_mesh(part, R, p)
        self.mesh.add_mesh(placed)
        return placed

    def content(self, part: Mesh, density: float) -> None:
        """Add a filling that has weight and is not seen."""
        self._bodies.append(solid_mass(part, density))

    def collide(self, *shapes: Shape) -> None:
        """Add collision shapes."""
        self._collisions += shapes

    def _feet(self) -> list[Shape]:
        """Small spheres at corners and rims, a little proud: a box or drum on a plane has but one contact point."""
        return [foot for shape in self._collisions for foot in feet_of(shape)]

    def collide_box(self, low: ArrayLike, high: ArrayLike) -> None:
        """Add a box between two corners."""
        a, b = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        x, y, z = (float(v) for v in (a + b) / 2)
        w, d, h = (float(v) for v in b - a)
        self.collide(Box(size=(w, d, h), p=(x, y, z)))

    def collide_upright(self, radius: float, z0: float, z1: float, xy: tuple[float, float] = (0.0, 0.0)) -> None:
        """Add an upright cylinder."""
        self.collide(Cylinder(radius=radius, length=z1 - z0, p=(*xy, (z0 + z1) / 2)))

    def collide_along_x(self, radius: float, x0: float, x1: float) -> None:
        """Add a lying cylinder about the x axis."""
        self.collide(Cylinder(radius=radius, length=x1 - x0, p=((x0 + x1) / 2, 0, 0), rpy=(0, np.pi / 2, 0)))

    def finish(self, mass_kg: float | None = None, *, on_floor: bool = False) -> Finished:
        """The model about the centre of its bounding box (`on_floor`: about the point below it).

        `mass_kg` replaces the mass reckoned from densities and keeps its distribution. Without any collision shape
        the bounding box becomes one.
        """
        points = np.concatenate([p for _, p, _, _ in self.mesh.groups()])
        low, high = points.min(axis=0), points.max(axis=0)
        if not self._collisions:
            self.collide_box(low, high)
        origin = (low + high) / 2
        if on_floor:
            origin = np.array([0.0, 0.0, low[2]])
        moved = Mesh(self.materials)
        moved.add_mesh(self.mesh, p=-origin)
        mass = together(self._bodies)
        mass = mass if mass_kg is None else scaled_to(mass, mass_kg)
        mass = MassProperties(mass.mass_kg, mass.com - origin, mass.inertia)
        x, y, z = (float(v) for v in high - low)
        used = {material.texture for name, material in self.materials.items() if name in _names(moved)}
        pictures = {name: picture for name, picture in self._pictures.items() if name in used}
        shapes = tuple(_moved(shape, -origin) for shape in [*self._collisions, *self._feet()])
        return Finished(moved, pictures, shapes, mass, (x, y, z))


def outward(part: Mesh, R: ArrayLike = IDENTITY, p: ArrayLike = (0, 0, 0)) -> Mesh:
    """The closed part at a pose, each triangle wound as its normals say, all of them looking outward."""
    placed, groups, volume = Mesh(part.materials), [], 0.0
    placed.add_mesh(part, R, p)
    for name, points, normals, uvs in placed.groups():
        corners, sides = points.reshape(-1, 3, 3), normals.reshape(-1, 3, 3)
        faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        wrong = np.sum(faces * sides.sum(axis=1), axis=1) < 0
        order = np.where(wrong[:, None], [0, 2, 1], [0, 1, 2])
        rows = np.arange(len(corners))[:, None]
        corners, sides = corners[rows, order], sides[rows, order]
        volume += float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])))
        groups.append((name, corners, sides, uvs.reshape(-1, 3, 2)[rows, order]))
    whole, sign = Mesh(part.materials), slice(None, None, 1 if volume >= 0 else -1)
    for name, corners, sides, texture in groups:
        whole.add_triangles(name, corners[:, sign], sides[:, sign] * (1 if volume >= 0 else -1), texture[:, sign])
    return whole


def _names(mesh: Mesh) -> set[str]:
    return {name for name, *_ in mesh.groups()}


def feet_of(shape: Shape) -> list[Shape]:
    """Spheres that reach `PROUD_M` beyond the corners of a box or the rims of a cylinder."""
    match shape:
        case Box(size=size):
            half = np.array(size) / 2
            small = min(0.004, float(half.min()) / 2)
            places = [(half + PROUD_M - small) * signs for signs in itertools.product((-1, 1), repeat=3)]
        case Cylinder(radius=radius, length=length):
            small = min(0.004, radius / 2, length / 4)
            up, out, angles = length / 2 + PROUD_M - small, radius - small, np.arange(8) * np.pi / 4
            places = [np.array([out * np.cos(a), out * np.sin(a), z]) for z in (-up, up) for a in angles]
        case _:
            return []
    centres = [shape.rotation() @ place + np.array(shape.p) for place in places]
    return [Sphere(radius=small, p=(float(c[0]), float(c[1]), float(c[2]))) for c in centres]


def _moved(shape: Shape, by: FloatArray) -> Shape:
    x, y, z = (float(v) for v in np.array(shape.p) + by)
    match shape:
        case Box(size=size):
            return Box(size=size, p=(x, y, z), rpy=shape.rpy)
        case Cylinder(radius=radius, length=length):
            return Cylinder(radius=radius, length=length, p=(x, y, z), rpy=shape.rpy)
        case Capsule(radius=radius, length=length):
            return Capsule(radius=radius, length=length, p=(x, y, z), rpy=shape.rpy)
        case Sphere(radius=radius):
            return Sphere(radius=radius, p=(x, y, z))
    raise TypeError(f"no such collision shape: {type(shape).__name__}")


def turned(axis: str, angle_rad: float) -> FloatArray:
    """The (3, 3) rotation about x, y or z."""
    c, s = float(np.cos(angle_rad)), float(np.sin(angle_rad))
    k = "xyz".index(axis)
    R = np.eye(3)
    i, j = (k + 1) % 3, (k + 2) % 3
    R[i, i], R[j, j], R[i, j], R[j, i] = c, c, -s, s
    return R


UP_TO_X = turned("y", np.pi / 2)
"""Turns a part made along z so that it lies along x."""

Profile = Sequence[tuple[float, float]]


def pick(rng: np.random.Generator, *options: Colour) -> Colour:
    """One of several colours."""
    return options[int(rng.integers(len(options)))]


def shade(rng: np.random.Generator, colour: ArrayLike, spread: float = 0.05) -> FloatArray:
    """A colour a little beside the one given."""
    base = np.asarray(colour, dtype=float)
    return np.asarray(np.clip(base * (1 + spread * rng.standard_normal()) + spread * rng.normal(0, 0.4, 3), 0, 1))


def varied(rng: np.random.Generator, colour: ArrayLike, spread: float = 0.05) -> Colour:
    """The same as a tuple of numbers."""
    r, g, b = (float(v) for v in shade(rng, colour, spread))
    return (r, g, b)
