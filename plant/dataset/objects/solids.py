"""Basic solids in plain colours: the parts of untextured models."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from plant.dataset.objects.draft import UP_TO_X, Draft, pick, varied
from plant.models.builder.mesh import Colour, Mesh
from plant.models.builder.surfaces import add_ellipsoid

__all__ = ["COLOURS", "GREYS", "add_drum", "add_rod", "any_plain", "paint_grey", "paint_plain", "some_shine"]

COLOURS: tuple[tuple[str, Colour], ...] = (
    ("red", (0.82, 0.06, 0.05)),
    ("blue", (0.07, 0.18, 0.75)),
    ("green", (0.08, 0.50, 0.15)),
    ("yellow", (0.95, 0.80, 0.06)),
    ("orange", (0.95, 0.45, 0.05)),
    ("black", (0.06, 0.06, 0.06)),
    ("brown", (0.45, 0.28, 0.13)),
    ("brown", (0.72, 0.52, 0.30)),
    ("grey", (0.45, 0.45, 0.46)),
    ("white", (0.93, 0.93, 0.93)),
)
GREYS: tuple[Colour, ...] = (
    (0.50, 0.50, 0.51),
    (0.65, 0.65, 0.67),
    (0.78, 0.78, 0.80),
    (0.33, 0.33, 0.35),
    (0.20, 0.20, 0.21),
    (0.08, 0.08, 0.08),
)


def any_plain(rng: np.random.Generator) -> tuple[str, Colour]:
    """One of the colours, and what one would call it."""
    return COLOURS[int(rng.integers(len(COLOURS)))]


def paint_plain(draft: Draft, name: str = "colour") -> str:
    """Paint any plain colour; what one would call it."""
    word, colour = any_plain(draft.rng)
    draft.paint(name, varied(draft.rng, colour, 0.06), shine=some_shine(draft))
    return word


def paint_grey(draft: Draft, name: str) -> None:
    """Paint any grey."""
    draft.paint(name, varied(draft.rng, pick(draft.rng, *GREYS), 0.04), shine=some_shine(draft))


def some_shine(draft: Draft) -> float:
    """Dull to rather shiny."""
    return float(draft.rng.uniform(0.0, 0.6))


def add_drum(part: Mesh, material: str, radius: float, z0: float, z1: float, *, sides: int = 32) -> None:
    """A closed cylinder along z."""
    part.add_lathe(material, [(0, z0), (radius, z0), (radius, z1), (0, z1)], sides=sides)


def add_rod(draft: Draft, material: str, x0: float, x1: float, radius: float, density: float) -> None:
    """A box, a cylinder, a prism, a capsule or a stack of drums along x."""
    part, style = draft.part(), str(draft.rng.choice(["cylinder", "capsule", "box", "flat", "prism", "stack"]))
    if style == "stack":
        return _stack(draft, material, x0, x1, radius, density)
    if style in ("box", "flat"):
        half = radius * (0.55 if style == "flat" else 0.9)
        part.add_box(material, (x0, -radius, -half), (x1, radius, half))
        return draft.solid(part, density)
    if style == "capsule":
        add_ellipsoid(part, material, (0, 0, x0 + radius), (radius,) * 3)
        add_ellipsoid(part, material, (0, 0, x1 - radius), (radius,) * 3)
        add_drum(part, material, radius, x0 + radius, x1 - radius)
    else:
        add_drum(part, material, radius, x0, x1, sides=32 if style == "cylinder" else int(draft.rng.choice([6, 8])))
    return draft.solid(part, density, UP_TO_X)


def _stack(draft: Draft, material: str, x0: float, x1: float, radius: float, density: float) -> None:
    """Two to five drums along x, of other radii; some of another colour."""
    rng = draft.rng
    paint_plain(draft, "collar")
    inner = np.sort(rng.uniform(0.1, 0.9, int(rng.integers(1, 5))))
    breaks = x0 + (x1 - x0) * np.concatenate([[0.0], inner, [1.0]])
    for low, high in pairwise(breaks):
        part = draft.part()
        add_drum(part, "collar" if rng.random() < 0.3 else material, radius * float(rng.uniform(0.6, 1.15)), low, high)
        draft.solid(part, density, UP_TO_X)
