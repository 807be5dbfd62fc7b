"""Boxes, cylinders and blocks of random size and proportion, as imported objects of a class that no detector knows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from plant.models.builder.importing import ImportOptions, import_object
from skills.robot import FloatArray

__all__ = ["Shape", "random_shape", "written_shape"]

KINDS: Final = ("box", "cylinder", "block")
WIDTH_M, LENGTH_M, DENSITY_KG_M3 = (0.02, 0.10), (0.02, 0.30), (300.0, 900.0)
SLENDER: Final = 4.0
_SIDES, _STREAM = 32, 11


@dataclass(frozen=True)
class Shape:
    """A box or cylinder that stands, or a block that lies: full lengths along x, y and z (m), and its density."""

    kind: str
    size_m: tuple[float, float, float]
    density_kg_m3: float

    def outline(self) -> FloatArray:
        """Its section (N, 2), counter-clockwise."""
        x, y, _ = self.size_m
        if self.kind != "cylinder":
            return np.array([[-x, -y], [x, -y], [x, y], [-x, y]]) / 2.0
        turns = np.linspace(0.0, 2.0 * math.pi, _SIDES, endpoint=False)
        return np.column_stack([np.cos(turns), np.sin(turns)]) * x / 2.0

    @property
    def mass_kg(self) -> float:
        """That of the body filled evenly."""
        x, y = self.outline().T
        area_m2 = float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0
        return area_m2 * self.size_m[2] * self.density_kg_m3

    def triangles(self) -> FloatArray:
        """Its surface (T, 3, 3), looking outward."""
        low = np.column_stack([self.outline(), np.full(len(self.outline()), -self.size_m[2] / 2.0)])
        high = low + [0.0, 0.0, self.size_m[2]]
        found = list[list[FloatArray]]()
        for k in range(len(low)):
            after = (k + 1) % len(low)
            found += [[low[k], low[after], high[after]], [low[k], high[after], high[k]]]
        for k in range(1, len(low) - 1):
            found += [[high[0], high[k], high[k + 1]], [low[0], low[k + 1], low[k]]]
        return np.array(found)


def random_shape(seed: int) -> Shape:
    """The shape of a seed: 20 to 100 mm wide and 20 to 300 mm long, none more than four times as high as wide."""
    rng = np.random.default_rng([seed, _STREAM])
    kind, width = KINDS[int(rng.integers(len(KINDS)))], float(rng.uniform(*WIDTH_M))
    other, density = float(rng.uniform(*WIDTH_M)), float(rng.uniform(*DENSITY_KG_M3))
    if kind == "block":
        return Shape(kind, (float(rng.uniform(max(width, other), LENGTH_M[1])), width, other), density)
    across = (width, width if kind == "cylinder" else other)
    high = float(rng.uniform(LENGTH_M[0], min(LENGTH_M[1], SLENDER * min(across))))
    return Shape(kind, (*across, high), density)


def written_shape(seed: int, folder: Path) -> Path:
    """Write the shape of a seed as an imported object into a folder of its own within `folder`; that folder."""
    shape = random_shape(seed)
    name = f"{shape.kind}_{seed}"
    made = folder / name
    made.mkdir(parents=True)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in shape.triangles().reshape(-1, 3)]
    faces = [f"f {3 * k + 1} {3 * k + 2} {3 * k + 3}" for k in range(len(lines) // 3)]
    mesh = folder / f"{name}_mesh.obj"
    mesh.write_text("\n".join([*lines, *faces]) + "\n", encoding="utf-8")
    import_object(mesh, ImportOptions(name, round(shape.mass_kg, 4)), made)
    return made
