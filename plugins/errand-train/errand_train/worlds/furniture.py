"""Builder of the pieces in `furniture.yaml`, which describes their frame and their parts."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from errand_make.mesh import Material, Mesh
from errand_make.shapes import Box, Cylinder, Shape
from errand_train.models.expressions import evaluate
from skills.inputs.yaml_source import read_yaml

Names = dict[str, Any]
"""Numbers, and names of materials."""
Point = tuple[float, float, float]
Faces = Mapping[str, str | None]


@cache
def _pieces() -> Mapping[str, Any]:
    table: Mapping[str, Any] = read_yaml(Path(__file__).with_name("furniture.yaml")).data
    return table


class Piece:
    """A piece of furniture: visual geometry and primitive collision shapes."""

    def __init__(self, name: str, materials: Mapping[str, Material], **values: float | str) -> None:
        """Builds a piece by its parameters. Raises KeyError, ValueError for wrong parameters."""
        self.mesh, self.collisions = Mesh(materials), list[Shape]()
        defaults: Mapping[str, Any] = _pieces()[name].get("let", {})
        self._rng = np.random.default_rng(int({**defaults, **values}.get("seed", 0)))
        self._operations: Mapping[str, Callable[..., None]] = {
            "solid_box": self._solid_box,
            "look_box": self._look_box,
            "block": self._block,
            "solid_cylinder": self._solid_cylinder,
            "look_cylinder": self._look_cylinder,
            "block_cylinder": self._block_cylinder,
            "lathe": self._lathe,
            "rectangle": self.mesh.add_rectangle,
            "boxes": self._boxes,
            "leaves": self._leaves,
        }
        self._add([name, values], {})

    def _add(self, part: Any, names: Names) -> None:
        """Adds a call of an operation or of another piece, or a group of parts as often as it says."""
        if isinstance(part, Mapping):
            for scope in self._rounds(part.get("each", {}), names):
                self._let(scope, part.get("let", {}))
                for inner in part["parts"]:
                    self._add(inner, scope)
        elif part[0] in self._operations:
            self._operations[part[0]](*(self._value(argument, names) for argument in part[1:]))
        else:
            piece, scope = _pieces()[part[0]], dict[str, Any]()
            for key, value in part[1].items():
                scope[key] = self._value(value, names)
            self._let(scope, {key: value for key, value in piece.get("let", {}).items() if key not in scope})
            self._add({"parts": piece["parts"]}, scope)

    def _let(self, scope: Names, table: Mapping[str, Any]) -> None:
        for name, value in table.items():
            scope[name] = self._value(value, scope)

    def _rounds(self, each: Mapping[str, Any], names: Names) -> Iterator[Names]:
        """The names of each repetition: by a count, or by a list of values."""
        found = {name: self._value(value, names) for name, value in each.items()}
        rows = [value if isinstance(value, tuple) else range(round(value)) for value in found.values()]
        for combination in itertools.product(*rows):
            yield {**names, **dict(zip(found, combination, strict=True))}

    def _value(self, value: Any, names: Names) -> Any:
        """A material's name, a number by its expression, or tuples and mappings of these."""
        if isinstance(value, list):
            return tuple(self._value(each, names) for each in value)
        if isinstance(value, Mapping):
            return {key: self._value(each, names) for key, each in value.items()}
        named = names.get(value, value) if isinstance(value, str) else value
        if named is None or named in self.mesh.materials:
            return named
        numbers = {name: each for name, each in names.items() if not isinstance(each, str)}
        return evaluate(value, numbers, self._rng)

    def _solid_box(self, material: str, low: Point, high: Point, faces: Faces | None = None) -> None:
        self._look_box(material, low, high, faces)
        self._block(low, high)

    def _look_box(self, material: str, low: Point, high: Point, faces: Faces | None = None) -> None:
        self.mesh.add_box(material, low, high, faces=faces)

    def _block(self, low: Point, high: Point) -> None:
        size = (high[0] - low[0], high[1] - low[1], high[2] - low[2])
        centre = ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2)
        self.collisions.append(Box(size=size, p=centre))

    def _solid_cylinder(self, material: str, radius: float, low: Point, height: float, cap: str | None = None) -> None:
        self.mesh.add_cylinder(material, radius, low, height, cap=cap)
        self._block_cylinder(radius, low, height)

    def _look_cylinder(self, material: str, radius: float, low: Point, height: float, sides: float = 20) -> None:
        self.mesh.add_cylinder(material, radius, low, height, sides=round(sides))

    def _block_cylinder(self, radius: float, low: Point, height: float) -> None:
        centre = (low[0], low[1], low[2] + height / 2)
        self.collisions.append(Cylinder(radius=radius, length=height, p=centre))

    def _lathe(self, material: str, profile: Sequence[tuple[float, float]], centre: Point) -> None:
        self.mesh.add_lathe(material, profile, centre=centre)

    def _boxes(self, half: float, depth: float, z: float) -> None:
        """A row of boxes on a board at a height."""
        x, rng = -half + 0.06, self._rng
        while x < half - 0.35:
            wide, tall = rng.uniform(0.22, 0.34), rng.uniform(0.2, 0.42)
            colour = str(rng.choice(["carton", "grey", "teal", "charcoal"]))
            self._look_box(colour, (x, -depth + 0.03, z), (x + wide, -0.05, z + tall))
            x += wide + 0.03

    def _leaves(self, height: float) -> None:
        """Foliage about a stem."""
        rng = self._rng
        for k in range(46):
            angle, z = rng.uniform(0, 2 * np.pi), 0.42 + (height - 0.50) * rng.uniform(0, 1)
            reach = 0.06 + 0.15 * rng.uniform(0.4, 1)
            out = np.array([np.cos(angle), np.sin(angle), 0.0])
            across, base = np.array([-out[1], out[0], 0.0]) * 0.05, np.array([0, -0.2, z]) + out * (reach - 0.15)
            tip = out * 0.14 + np.array([0, 0, rng.uniform(0.01, 0.09)])
            colour = "leaf" if k % 3 else "leaf_dark"
            self.mesh.add_rectangle(colour, base - across, 2 * across, tip)
            self.mesh.add_rectangle(colour, base + across, -2 * across, tip)
