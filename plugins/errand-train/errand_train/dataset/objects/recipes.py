"""Recipes of objects: tables of parts with ranges in the YAML files beside this module, and their builder.

`plugins/errand-train/docs/training.md` describes the keys. A recipe draws its names (`let`), its colours and one of its
kinds at random, and adds its parts.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict

from errand_make.mesh import IDENTITY, Mesh
from errand_train.dataset.objects.draft import Draft, Finished, rotation
from errand_train.dataset.objects.finishes import Colours, Finish, apply_finish, draw_colour
from errand_train.models.expressions import Number, evaluate
from errand_train.models.outlines import arc, curve
from errand_train.models.surfaces import (
    add_ellipsoid,
    add_extruded,
    add_grid,
    add_ring,
    add_rounded_box,
    add_tube,
)
from skills.inputs.yaml_source import read_yaml
from skills.robot import FloatArray

_FOLDER: Final = Path(__file__).resolve().parent
_SMOOTH_STEPS: Final = 5

Names = dict[str, float]
Range = Number | tuple[Number, Number]
Vector = tuple[Number, ...]
Arc = dict[str, Vector]
"""`{arc: [x, y, radius, from_deg, to_deg]}`, in the place of points."""


class Part(BaseModel):
    """A shape under the key of its material, or a group of parts, with its pose and density."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    lathe: str | None = None
    box: str | None = None
    extrude: str | None = None
    tube: str | None = None
    ellipsoid: str | None = None
    ring: str | None = None
    parts: tuple[Part, ...] = ()
    one_of: tuple[tuple[Part, ...], ...] = ()
    weights: tuple[float, ...] | None = None

    points: tuple[Vector | Arc, ...] = ()
    smooth: bool = False
    sides: Number = 24
    bands: tuple[tuple[str, Number, Number], ...] = ()
    lobes: tuple[Number, Number] | None = None
    low: Vector = ()
    high: Vector = ()
    faces: dict[str, str | None] | None = None
    radius: Number = 0.0
    radii: tuple[Number | Vector, ...] = ()
    z: Vector = ()
    bevel: Number = 0.0
    top: str | None = None
    up: Vector = ()

    let: dict[str, Range] = {}
    chance: Number = 1.0
    each: dict[str, Number | tuple[Number, ...]] = {}
    turn: tuple[tuple[str, Number], ...] = ()
    at: Vector = (0, 0, 0)
    density: Number | None = None
    shell: Number | None = None


class Kind(BaseModel):
    """One kind of an object: additions to its recipe, and replacements."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    weight: float = 1.0
    colour: Colours | None = None
    let: dict[str, Range] = {}
    materials: dict[str, Finish] = {}
    parts: tuple[Part, ...] = ()


class Recipe(BaseModel):
    """Recipe of all instances of a category: names, colours, materials and parts, and its kinds."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    colour: Colours = "any"
    let: dict[str, Range] = {}
    materials: dict[str, Finish] = {}
    parts: tuple[Part, ...] = ()
    kinds: dict[str, Kind] = {}
    mass_kg: Number | None = None
    on_floor: bool = False
    may_be_plain: bool = True
    """Whether it differs from the classes even without its pictures."""


@cache
def load_recipes(name: str) -> Mapping[str, Recipe]:
    """Loads the recipes of a file beside this module, by category. Keys with an underscore hold shared parts."""
    table: dict[str, Any] = read_yaml(_FOLDER / f"{name}.yaml").data
    return {key: Recipe.model_validate(value) for key, value in table.items() if not key.startswith("_")}


def build(category: str, recipe: Recipe, draft: Draft) -> tuple[Finished, str, str]:
    """Makes an instance: the model, its kind and its main colour. Raises ValueError for a faulty recipe."""
    rng, name = draft.rng, category.replace("_", " ")
    kind = Kind()
    if recipe.kinds:
        weights = np.array([each.weight for each in recipe.kinds.values()])
        name = str(rng.choice(list(recipe.kinds), p=weights / weights.sum()))
        kind = recipe.kinds[name]
    names = {"wear": float(rng.uniform(0, 0.6)), "pi": float(np.pi)}
    for table in (kind.let, recipe.let):
        _draw(names, table, rng)
    main = draw_colour(rng, kind.colour or recipe.colour, ("", ()))
    for material, finish in {**recipe.materials, **kind.materials}.items():
        apply_finish(draft, material, finish, main, names)
    assembly = _Assembly(draft)
    for part in (*recipe.parts, *kind.parts):
        assembly.add(part, names, IDENTITY, np.zeros(3))
    mass = None if recipe.mass_kg is None else evaluate(recipe.mass_kg, names, rng)
    return draft.finish(mass, on_floor=recipe.on_floor), name, main[0]


def _draw(names: Names, table: Mapping[str, Range], rng: np.random.Generator) -> None:
    """Adds names: even draws between two bounds, or the values of expressions."""
    for name, value in table.items():
        if isinstance(value, tuple):
            low, high = (evaluate(bound, names, rng) for bound in value)
            names[name] = float(rng.uniform(low, high))
        else:
            names[name] = evaluate(value, names, rng)


@dataclass(frozen=True)
class _Assembly:
    """Builder that adds parts to a draft."""

    draft: Draft

    def add(self, part: Part, names: Names, R: ArrayLike, p: FloatArray) -> None:
        """Adds a part at a pose, with its repetitions."""
        rng = self.draft.rng
        for scope in self._rounds(part, names):
            if rng.random() >= evaluate(part.chance, scope, rng):
                continue
            _draw(scope, part.let, rng)
            at = p + np.asarray(R) @ self._vector(part.at, scope)
            turn = np.asarray(R)
            for axis, angle in part.turn:
                turn = turn @ rotation(axis, float(np.radians(evaluate(angle, scope, rng))))
            for child in self._children(part):
                self.add(child, scope, turn, at)
            self._shape(part, scope, turn, at)

    def _rounds(self, part: Part, names: Names) -> Iterator[Names]:
        """The names of each repetition."""
        rng, values = self.draft.rng, list[list[float]]()
        for each in part.each.values():
            if isinstance(each, tuple):
                values.append([evaluate(value, names, rng) for value in each])
            else:
                values.append([float(k) for k in range(round(evaluate(each, names, rng)))])
        for combination in itertools.product(*values):
            yield {**names, **dict(zip(part.each, combination, strict=True))}

    def _children(self, part: Part) -> tuple[Part, ...]:
        if not part.one_of:
            return part.parts
        p = None if part.weights is None else np.array(part.weights) / sum(part.weights)
        return (*part.parts, *part.one_of[int(self.draft.rng.choice(len(part.one_of), p=p))])

    def _shape(self, part: Part, names: Names, R: FloatArray, p: FloatArray) -> None:
        makers = {
            "lathe": self._lathe,
            "box": self._box,
            "extrude": self._extrude,
            "tube": self._tube,
            "ellipsoid": self._ellipsoid,
            "ring": self._ring,
        }
        for key, maker in makers.items():
            material = getattr(part, key)
            if material is None:
                continue
            mesh = self.draft.part()
            body = maker(material, part, names, mesh)
            if part.density is not None:
                self.draft.solid(mesh, self._number(part.density, names), R, p, body=body)
            elif part.shell is not None:
                self.draft.shell(mesh, self._number(part.shell, names), R, p)
            else:
                self.draft.visual(mesh, R, p)

    def _lathe(self, material: str, part: Part, names: Names, mesh: Mesh) -> Mesh:
        """Turns the profile about z; `bands` of heights have materials of their own. Returns the closed body."""
        line = np.maximum(self._points(part, names, 2), [0.0, -np.inf])
        sides = round(self._number(part.sides, names))
        bands = [(name, self._number(low, names), self._number(high, names)) for name, low, high in part.bands]
        for name, piece in _banded(line, material, bands):
            if part.lobes is None:
                mesh.add_lathe(name, [(float(r), float(z)) for r, z in piece], sides=sides)
            else:
                count, depth = (self._number(value, names) for value in part.lobes)
                angle = np.linspace(0, 2 * np.pi, 49)
                wide = piece[:, :1] * (1 - depth * (0.5 - 0.5 * np.cos(count * angle)))
                height = np.broadcast_to(piece[:, 1:], wide.shape)
                add_grid(mesh, name, np.stack([wide * np.cos(angle), wide * np.sin(angle), height], axis=-1), ring=True)
        profile, body = [(float(r), float(z)) for r, z in line], self.draft.part()
        bottom, top = ([(0.0, z)] if r > 0 else [] for r, z in (profile[0], profile[-1]))
        body.add_lathe(material, [*bottom, *profile, *top], sides=sides)
        return body

    def _box(self, material: str, part: Part, names: Names, mesh: Mesh) -> None:
        corners = self._vector(part.low, names), self._vector(part.high, names)
        low, high, radius = np.minimum(*corners), np.maximum(*corners), self._number(part.radius, names)
        if radius:
            add_rounded_box(mesh, material, low, high, radius, top=part.top)
        else:
            mesh.add_box(material, low, high, faces=part.faces)

    def _extrude(self, material: str, part: Part, names: Names, mesh: Mesh) -> None:
        z0, z1 = sorted(self._vector(part.z, names))
        bevel = self._number(part.bevel, names)
        add_extruded(mesh, material, self._points(part, names, 2), z0, z1, bevel=bevel, top=part.top)

    def _tube(self, material: str, part: Part, names: Names, mesh: Mesh) -> None:
        """A tube along the points; `radii` are at these points, oval where two are given, the first along `up`."""
        line = self._points(part, names, 3, smooth=False)
        radii = [self._vector(r if isinstance(r, tuple) else (r,), names) for r in part.radii]
        wide = np.array(radii) if radii else np.full((len(line), 1), self._number(part.radius, names))
        rows = np.column_stack([line, np.broadcast_to(wide, (len(line), wide.shape[1]))])
        rows = curve([tuple(row) for row in rows], _SMOOTH_STEPS) if part.smooth else rows
        sides = round(self._number(part.sides, names))
        shape = rows[:, 3:] if wide.shape[1] == 2 else rows[:, 3]
        add_tube(mesh, material, rows[:, :3], shape, sides=min(sides, 16), up=self._vector(part.up, names))

    def _ellipsoid(self, material: str, part: Part, names: Names, mesh: Mesh) -> None:
        radii = [self._number(r, names) for r in part.radii if not isinstance(r, tuple)]
        add_ellipsoid(mesh, material, (0, 0, 0), radii * 3 if len(radii) == 1 else radii)

    def _ring(self, material: str, part: Part, names: Names, mesh: Mesh) -> None:
        inner, outer = (self._number(r, names) for r in part.radii if not isinstance(r, tuple))
        z0, z1 = self._vector(part.z, names)
        add_ring(mesh, material, inner, outer, z0, z1)

    def _number(self, value: Number, names: Names) -> float:
        return evaluate(value, names, self.draft.rng)

    def _vector(self, values: Vector, names: Names) -> FloatArray:
        return np.array([evaluate(value, names, self.draft.rng) for value in values])

    def _points(self, part: Part, names: Names, size: int, *, smooth: bool | None = None) -> FloatArray:
        """The points of a profile, outline or path; arcs become points, and a missing z is 0."""
        rows = list[FloatArray]()
        for entry in part.points:
            if isinstance(entry, dict):
                x, y, radius, start, end = self._vector(entry["arc"], names)
                rows += list(arc((x, y), radius, start, end, 20))
            else:
                rows.append(self._vector(entry, names))
        line = np.array([np.append(row, np.zeros(size - len(row))) for row in rows])
        return (
            curve([tuple(row) for row in line], _SMOOTH_STEPS) if (part.smooth if smooth is None else smooth) else line
        )


def _banded(line: FloatArray, material: str, bands: list[tuple[str, float, float]]) -> Iterator[tuple[str, FloatArray]]:
    """Pieces of a profile with their materials: a band's between its heights, else the main one."""
    if not bands:
        yield material, line
        return
    z = np.maximum.accumulate(line[:, 1])
    cuts = np.unique(np.clip([z[0], z[-1], *(height for _, *span in bands for height in span)], z[0], z[-1]))
    for low, high in itertools.pairwise(cuts):
        middle = (low + high) / 2
        name = next((band for band, start, end in bands if start < middle < end), material)
        first, last = (float(np.interp(height, z, line[:, 0])) for height in (low, high))
        inner = line[(z > low + 1e-6) & (z < high - 1e-6)]
        start = line[z <= low + 1e-6] if low == cuts[0] else np.array([[first, low]])
        end = line[z >= high - 1e-6] if high == cuts[-1] else np.array([[last, high]])
        yield name, np.concatenate([start, inner, end])
