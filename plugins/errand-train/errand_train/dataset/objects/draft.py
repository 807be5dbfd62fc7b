"""Construction of a model from parts: visual geometry, pictures, collision shapes and mass."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from errand_make.mesh import IDENTITY, Colour, Material, Mesh
from errand_make.shapes import (
    Box,
    Cylinder,
    MassProperties,
    Shape,
    Sphere,
    scale_mass,
    shell_mass,
    solid_mass,
)
from errand_train.models.mass import join_masses
from errand_train.models.pictures import to_picture
from skills.robot import FloatArray, Picture

PROUD_M = 0.0003
RIM_POINTS = 8
SAME_RADIUS = 0.15
SHORTEST_M = 0.001


@dataclass(frozen=True)
class Finished:
    """A finished model in its own frame."""

    mesh: Mesh
    pictures: dict[str, Picture]
    collisions: tuple[Shape, ...]
    mass: MassProperties
    size_m: tuple[float, float, float]


class Draft:
    """A model under construction. Lengths in metres, densities in kg/m^3 (solids) or kg/m^2 (shells)."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.materials: dict[str, Material] = {}
        self.mesh = Mesh(self.materials)
        self._pictures: dict[str, Picture] = {}
        self._bodies: list[MassProperties] = []
        self._collisions: list[Shape] = []

    def paint(self, name: str, colour: ArrayLike, *, shine: float = 0.3, metal: float = 0.0) -> str:
        """Adds a plain material and returns its name."""
        r, g, b = (float(v) for v in np.clip(np.asarray(colour, dtype=float), 0.0, 1.0))
        self.materials[name] = Material((r, g, b), None, None, shine, metal)
        return name

    def picture(self, name: str, values: FloatArray, *, shine: float = 0.3, metal: float = 0.0) -> str:
        """Adds a material with a picture (H, W, 3; 0..1) stretched over each surface, and returns its name."""
        self._pictures[f"{name}.png"] = to_picture(values, 128)
        self.materials[name] = Material((1.0, 1.0, 1.0), f"{name}.png", None, shine, metal)
        return name

    def part(self) -> Mesh:
        """Makes an empty mesh with this draft's materials."""
        return Mesh(self.materials)

    def solid(
        self, part: Mesh, density: float, R: ArrayLike = IDENTITY, p: ArrayLike = (0, 0, 0), *, body: Mesh | None = None
    ) -> None:
        """Adds a solid part at a pose, with outward triangles. An open part needs its closed `body`."""
        placed = orient_outward(part, R, p)
        self.mesh.add_mesh(placed)
        self._bodies.append(solid_mass(orient_outward(body, R, p) if body else placed, density))
        self._collide(placed)

    def shell(self, part: Mesh, density: float, R: ArrayLike = IDENTITY, p: ArrayLike = (0, 0, 0)) -> None:
        """Adds a part that is a thin shell."""
        placed = self.visual(part, R, p)
        self._bodies.append(shell_mass(placed, density))
        self._collide(placed)

    def visual(self, part: Mesh, R: ArrayLike = IDENTITY, p: ArrayLike = (0, 0, 0)) -> Mesh:
        """Adds a part without mass, and returns it at its pose."""
        placed = Mesh(self.materials)
        placed.add_mesh(part, R, p)
        self.mesh.add_mesh(placed)
        return placed

    def _collide(self, part: Mesh) -> None:
        """What has weight collides: an upright round part as cylinders, any other as the box around it; small spheres
        stand proud at the rims or corners to rest on."""
        points = np.concatenate([p for _, p, _, _ in part.groups()])
        low, high = points.min(axis=0), points.max(axis=0)
        size, middle = np.maximum(high - low, 1e-3), (low + high) / 2
        if size[2] > 2 * SHORTEST_M and _is_round(points - middle, size):
            self._collisions += _cylinders(points, middle, low[2], high[2])
            return
        small = min(0.004, float(size.min()) / 4)
        self._collisions.append(Box(size=_tuple(size), p=_tuple(middle)))
        for signs in itertools.product((-1, 1), repeat=3):
            self._collisions.append(Sphere(radius=small, p=_tuple(middle + (size / 2 + PROUD_M - small) * signs)))

    def finish(self, mass_kg: float | None = None, *, on_floor: bool = False) -> Finished:
        """Finishes the model about the centre of its bounding box (`on_floor`: about the point below it).

        `mass_kg` replaces the mass that follows from densities and keeps its distribution.
        """
        points = np.concatenate([p for _, p, _, _ in self.mesh.groups()])
        low, high = points.min(axis=0), points.max(axis=0)
        origin = np.array([0.0, 0.0, low[2]]) if on_floor else (low + high) / 2
        moved = Mesh(self.materials)
        moved.add_mesh(self.mesh, p=-origin)
        mass = join_masses(self._bodies)
        mass = mass if mass_kg is None else scale_mass(mass, mass_kg)
        mass = MassProperties(mass.mass_kg, mass.com - origin, mass.inertia)
        used = {self.materials[name].texture for name, *_ in moved.groups()}
        pictures = {name: picture for name, picture in self._pictures.items() if name in used}
        shapes = tuple(replace(shape, p=_tuple(np.array(shape.p) - origin)) for shape in self._collisions)
        return Finished(moved, pictures, shapes, mass, _tuple(high - low))


def _is_round(points: FloatArray, size: FloatArray) -> bool:
    """Returns whether points (N, 3) about their middle fill a circle seen from above."""
    widest = float(np.hypot(points[:, 0], points[:, 1]).max())
    return bool(abs(size[0] - size[1]) < 0.02 * size[0] and widest < 0.52 * size[0])


def _cylinders(points: FloatArray, middle: FloatArray, low_m: float, high_m: float) -> list[Shape]:
    """A round part about the vertical through `middle` as cylinders, one on the other, with spheres at both rims."""
    radius = np.hypot(points[:, 0] - middle[0], points[:, 1] - middle[1])
    levels, ring = np.unique(np.round(points[:, 2], 4), return_inverse=True)
    widest = np.zeros(len(levels))
    np.maximum.at(widest, ring, radius)
    sections: list[tuple[float, float, float]] = []
    for z0, z1, r in zip(levels, levels[1:], np.maximum(widest[1:], widest[:-1]), strict=False):
        last = sections[-1] if sections else None
        if last is not None and abs(r - last[2]) < SAME_RADIUS * last[2]:
            sections[-1] = (last[0], float(z1), max(float(r), last[2]))
        else:
            sections.append((float(z0), float(z1), float(r)))
    shapes: list[Shape] = [
        Cylinder(radius=r, length=z1 - z0, p=_tuple((middle[0], middle[1], (z0 + z1) / 2)))
        for z0, z1, r in sections
        if z1 - z0 >= SHORTEST_M
    ]
    for z, inward, r in ((low_m, 1.0, sections[0][2]), (high_m, -1.0, sections[-1][2])):
        small = min(0.003, r / 4)
        for angle in np.arange(RIM_POINTS) * 2 * np.pi / RIM_POINTS:
            xy = middle[:2] + (r - 2 * small) * np.array([np.cos(angle), np.sin(angle)])
            shapes.append(Sphere(radius=small, p=_tuple((*xy, z + inward * (small - PROUD_M)))))
    return shapes


def _tuple(values: ArrayLike) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in np.asarray(values))
    return (x, y, z)


def orient_outward(part: Mesh, R: ArrayLike = IDENTITY, p: ArrayLike = (0, 0, 0)) -> Mesh:
    """Moves a closed part to a pose, with every triangle and normal facing outward."""
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


def rotation(axis: str, angle_rad: float) -> FloatArray:
    """Rotation (3, 3) about x, y or z."""
    c, s = float(np.cos(angle_rad)), float(np.sin(angle_rad))
    k = "xyz".index(axis)
    R = np.eye(3)
    i, j = (k + 1) % 3, (k + 2) % 3
    R[i, i], R[j, j], R[i, j], R[j, i] = c, c, -s, s
    return R


def pick(rng: np.random.Generator, *options: Colour) -> Colour:
    """Picks one of several colours."""
    return options[int(rng.integers(len(options)))]


def vary_shade(rng: np.random.Generator, colour: ArrayLike, spread: float = 0.05) -> FloatArray:
    """Varies a colour a little, as an array."""
    base = np.asarray(colour, dtype=float)
    return np.asarray(np.clip(base * (1 + spread * rng.standard_normal()) + spread * rng.normal(0, 0.4, 3), 0, 1))


def vary_colour(rng: np.random.Generator, colour: ArrayLike, spread: float = 0.05) -> Colour:
    """Varies a colour a little, as a tuple of numbers."""
    r, g, b = (float(v) for v in vary_shade(rng, colour, spread))
    return (r, g, b)
