"""Things of no class and no name, made by chance of basic solids, for training alone.

What a robot meets is mostly none of what its maker modelled. A detector that knows only so many kinds of other things
takes an unknown one for the class that comes nearest; forms by chance teach it that a handle makes no tool and a neck
no bottle (Tobin et al., "Domain Randomization for Transferring Deep Neural Networks from Simulation to the Real
World", 2017, for the thought).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from plant.models.builder.mesh import Colour, Mesh
from plant.models.builder.outlines import arc, curve
from plant.models.builder.surfaces import add_ellipsoid, add_extruded, add_rounded_box, add_tube
from plant.models.families.draft import PLASTIC, STEEL, WOOD, Draft, Finished, varied
from plant.models.families.solids import add_drum, add_rod, paint_grey, paint_plain, some_shine

__all__ = ["ODDMENT", "oddment"]

Made = tuple[Finished, str]

ODDMENT = "oddment"
_BOTTLES = frozenset({"brown", "green", "red", "black"})
"""Colours in which a neck on a body, or a plain drum, may be a bottle or can of a class."""
_NO_BOTTLES: tuple[tuple[str, Colour], ...] = (
    ("white", (0.93, 0.93, 0.93)),
    ("yellow", (0.95, 0.80, 0.06)),
    ("blue", (0.07, 0.18, 0.75)),
    ("orange", (0.95, 0.45, 0.05)),
    ("pink", (0.85, 0.5, 0.65)),
    ("teal", (0.1, 0.55, 0.6)),
)
_NECK_SHARE = 0.6
"""Narrower than this share of what is below, the upper part of a turned thing is a neck."""
_PLAIN_DRUM = 1.35
"""A turned thing whose widest place is not so many times its narrowest could pass for a cylinder."""


def oddment(draft: Draft) -> tuple[Finished, str, str]:
    """A thing of one of a few kinds; its kind and colour."""
    rng = draft.rng
    kind = str(rng.choice(list(_KINDS), p=[share for share, _ in _KINDS.values()]))
    word = paint_plain(draft)
    paint_plain(draft, "second")
    if rng.random() < 0.3:
        paint_grey(draft, "second")
    _, make = _KINDS[kind]
    made, word = make(draft, word)
    return made, kind, word


def _between(draft: Draft, low: float, high: float) -> float:
    """A length or share between the two, small ones as often as large ones."""
    return float(np.exp(draft.rng.uniform(np.log(low), np.log(high))))


def _one_of_two(draft: Draft, second: float = 0.3) -> str:
    return "second" if draft.rng.random() < second else "colour"


def _no_bottle(draft: Draft) -> str:
    """Paint another colour than those of bottles and cans; what one would call it."""
    word, colour = _NO_BOTTLES[int(draft.rng.integers(len(_NO_BOTTLES)))]
    draft.paint("colour", varied(draft.rng, colour), shine=some_shine(draft))
    return word


def _turned(draft: Draft, word: str) -> Made:
    """Turned on a lathe: three to eight bands, straight or sloping; never a plain drum, never a bottle of a class."""
    rng, tall = draft.rng, _between(draft, 0.05, 0.30)
    wide = tall * _between(draft, 0.25, 0.9)
    bands, stepped = int(rng.integers(3, 9)), rng.random() < 0.4
    heights = tall * np.concatenate([[0.0], np.sort(rng.uniform(0.05, 0.95, bands - 1)), [1.0]])
    radii = wide / 2 * np.exp(rng.uniform(np.log(0.3), 0.0, bands + 1))
    if radii[:bands].max() < _PLAIN_DRUM * radii[:bands].min():
        radii[int(rng.integers(bands))] *= 0.5
    upper = heights > 0.6 * tall
    if word in _BOTTLES and (radii[upper].max() < _NECK_SHARE * radii[~upper].max() or wide < 0.3 * tall):
        word = _no_bottle(draft)
    for (low, bottom), (high, top) in pairwise(zip(heights, radii, strict=True)):
        band, end = draft.part(), bottom if stepped else top
        profile = [(0.0, low), (float(bottom), low), (float(end), high), (0.0, high)]
        band.add_lathe(_one_of_two(draft), profile, sides=28)
        draft.solid(band, PLASTIC * 0.5)
    return draft.finish(), word


def _handled(draft: Draft, word: str) -> Made:
    """A grip along x, and beyond it an end that is of no tool of a class."""
    rng, grip = draft.rng, _between(draft, 0.06, 0.16)
    thick, end = grip * float(rng.uniform(0.06, 0.14)), _between(draft, 0.04, 0.14)
    if rng.random() < 0.4:
        word = "grey"
        paint_grey(draft, "colour")
    add_rod(draft, "colour", -grip, 0.0, thick, WOOD)
    part, paint, neck = draft.part(), _one_of_two(draft, 0.8), end * float(rng.uniform(0.1, 1.2))
    add_tube(part, paint, [(-0.005, 0, 0), (neck / 2, 0, 0), (neck + 0.005, 0, 0)], thick * 0.4, sides=10)
    sizes = _End(neck, end, end * float(rng.uniform(0.2, 0.45)), float(rng.uniform(0.0008, 0.003)), thick)
    _ENDS[int(rng.integers(len(_ENDS)))](rng, part, paint, sizes)
    draft.solid(part, STEEL * 0.4)
    return draft.finish(), word


@dataclass(frozen=True)
class _End:
    """The end of a handled thing: where along x it begins, its length, half its width and height, half the grip's."""

    begin_m: float
    long_m: float
    wide_m: float
    flat_m: float
    thick_m: float

    @property
    def far_m(self) -> float:
        """Where along x it ends."""
        return self.begin_m + self.long_m


def _bowl(_: np.random.Generator, part: Mesh, paint: str, end: _End) -> None:
    add_ellipsoid(
        part, paint, (end.begin_m + end.long_m / 2, 0, 0), (end.long_m / 2, end.wide_m, max(0.2 * end.wide_m, 0.003))
    )


def _tines(rng: np.random.Generator, part: Mesh, paint: str, end: _End) -> None:
    count, root = int(rng.integers(3, 6)), end.begin_m + 0.4 * end.long_m
    part.add_box(paint, (end.begin_m, -end.wide_m, -end.flat_m), (root, end.wide_m, end.flat_m))
    half = 0.45 * end.wide_m / count
    for y in np.linspace(-0.85 * end.wide_m, 0.85 * end.wide_m, count):
        part.add_box(paint, (root, y - half, -end.flat_m), (end.far_m, y + half, end.flat_m))


def _blade(rng: np.random.Generator, part: Mesh, paint: str, end: _End) -> None:
    half, tip = end.wide_m / 2, float(rng.uniform(-0.5, 0.5)) * end.wide_m
    outline = [(end.begin_m, -half), (end.far_m, tip), (end.begin_m + 0.6 * end.long_m, half), (end.begin_m, half)]
    add_extruded(part, paint, outline, -end.flat_m, end.flat_m)


def _plate(_: np.random.Generator, part: Mesh, paint: str, end: _End) -> None:
    part.add_box(paint, (end.begin_m, -end.wide_m, -end.flat_m), (end.far_m, end.wide_m, end.flat_m))


def _brush(_: np.random.Generator, part: Mesh, paint: str, end: _End) -> None:
    root, wide, thick = end.begin_m + 0.35 * end.long_m, end.wide_m, end.thick_m
    part.add_box("colour", (end.begin_m, -wide, -thick), (root, wide, thick))
    part.add_box(paint, (root, -0.95 * wide, -0.9 * thick), (end.far_m, 0.95 * wide, 0.9 * thick))


def _ball(rng: np.random.Generator, part: Mesh, paint: str, end: _End) -> None:
    add_ellipsoid(
        part,
        paint,
        (end.begin_m + end.wide_m, 0, 0),
        (end.wide_m, end.wide_m, end.wide_m * float(rng.uniform(0.7, 1.0))),
    )


def _disc(_: np.random.Generator, part: Mesh, paint: str, end: _End) -> None:
    round_ = arc((end.begin_m + end.long_m / 2, 0), end.long_m / 2, 0, 345, 24)
    add_extruded(part, paint, round_, -2 * end.flat_m, 2 * end.flat_m)


def _hook(_: np.random.Generator, part: Mesh, paint: str, end: _End) -> None:
    bend = curve([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.3, 0.4, 0.0), (1.0, 0.8, 0.0), (0.7, 0.7, 0.0)], 5)
    add_tube(part, paint, np.asarray(bend) * end.long_m + [end.begin_m, 0, 0], end.thick_m * 0.4, sides=10)


_ENDS = (_bowl, _tines, _blade, _plate, _brush, _ball, _disc, _hook)
"""What a handled thing may end in."""


def _boxy(draft: Draft, word: str) -> Made:
    """A box that is no cube, sharp or rounded, now and then with a patch, a lid or another box on it."""
    rng, long = draft.rng, _between(draft, 0.05, 0.32)
    middle, short = np.sort(rng.uniform(0.08, 0.95, 2))[::-1]
    short = min(short, 0.5)
    half = rng.permutation([long, long * middle, long * short]) / 2
    part = draft.part()
    if rng.random() < 0.5:
        part.add_box("colour", -half, half)
    else:
        add_rounded_box(part, "colour", -half, half, float(rng.uniform(0.05, 0.5) * half.min()))
    draft.solid(part, 400.0)
    if rng.random() < 0.4:
        low, high = np.sort(rng.uniform(-0.9, 0.9, (2, 2)), axis=0) * half[:2]
        top = draft.part()
        rise = float(rng.choice([0.001, 0.2, 0.6]) * half[2])
        top.add_box("second", (*low, half[2]), (*np.maximum(high, low + 0.004), half[2] + rise))
        draft.solid(top, 400.0)
    if rng.random() < 0.4:
        side = draft.part()
        low, high = np.sort(rng.uniform(-0.9, 0.9, (2, 2)), axis=0) * half[1:]
        side.add_box("second", (half[0], *low), (half[0] + 0.001, *np.maximum(high, low + 0.004)))
        draft.solid(side, 400.0)
    return draft.finish(), word


def _slab(draft: Draft, word: str) -> Made:
    """An outline by chance, extruded: a star of five to nine corners, or a clamp's C, sometimes with a boss on it."""
    rng, wide = draft.rng, _between(draft, 0.05, 0.26)
    thick = wide * float(rng.uniform(0.04, 0.25))
    if rng.random() < 0.3:
        gap, bar = float(rng.uniform(30, 80)), float(rng.uniform(0.55, 0.85))
        outer, inner = arc((0, 0), wide / 2, gap, 360 - gap, 20), arc((0, 0), bar * wide / 2, 360 - gap, gap, 20)
        outline = np.concatenate([outer, inner])
    else:
        corners = int(rng.integers(5, 10))
        angle = np.linspace(0, 2 * np.pi, corners, endpoint=False) + rng.uniform(-0.2, 0.2, corners)
        radius = wide / 2 * rng.uniform(0.35, 1.0, corners)
        outline = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    part = draft.part()
    add_extruded(part, "colour", outline * [1.0, float(rng.uniform(0.45, 1.0))], 0.0, thick)
    draft.solid(part, PLASTIC)
    if rng.random() < 0.4:
        boss, r = draft.part(), wide * float(rng.uniform(0.06, 0.15))
        add_drum(boss, "second", r, thick, thick + wide * float(rng.uniform(0.02, 0.3)), sides=20)
        draft.solid(boss, PLASTIC)
    return draft.finish(), word


def _bent(draft: Draft, word: str) -> Made:
    """A rod or cable bent by chance, mostly in a plane, sometimes with knobs at its ends."""
    rng, size = draft.rng, _between(draft, 0.06, 0.30)
    knots = np.cumsum(rng.normal(0, 1, (int(rng.integers(3, 7)), 3)) * [1.0, 1.0, 0.05], axis=0)
    line = np.asarray(curve(knots * size / np.ptp(knots, axis=0).max(), 6))
    radius = size * float(rng.uniform(0.015, 0.07))
    part = draft.part()
    add_tube(part, "colour", line, radius, sides=10)
    draft.solid(part, PLASTIC)
    for end in (line[0], line[-1]):
        if rng.random() < 0.35:
            knob, wide = draft.part(), radius * float(rng.uniform(1.2, 2.5))
            add_ellipsoid(knob, "second", end, (wide,) * 3)
            draft.solid(knob, PLASTIC)
    return draft.finish(), word


def _sprayer(draft: Draft, word: str) -> Made:
    """A bottle of any cleaner: an oval or round body, a neck, and a head with a trigger or a pump."""
    rng, tall = draft.rng, _between(draft, 0.12, 0.22)
    if word in _BOTTLES:
        word = _no_bottle(draft)
    r = tall * float(rng.uniform(0.16, 0.28))
    oval, neck = float(rng.uniform(0.5, 1.0)), r * float(rng.uniform(0.25, 0.5))
    body = draft.part()
    shoulder = tall * float(rng.uniform(0.5, 0.85))
    upper = r * float(rng.uniform(0.8, 1.0))
    body.add_lathe("colour", [(0, 0), (r, 0), (upper, shoulder), (neck, tall), (0, tall)], sides=28)
    draft.solid(body, PLASTIC * 0.6, np.diag([1.0, oval, 1.0]))
    head, high = draft.part(), tall + r * float(rng.uniform(0.4, 1.2))
    add_drum(head, "second", neck * 1.1, tall * 0.98, high, sides=16)
    reach = r * float(rng.uniform(0.7, 1.5))
    head.add_box("second", (-reach * 0.6, -neck, high), (reach, neck, high + neck * 1.4))
    if rng.random() < 0.6:
        trigger = [(reach * 0.5, 0, high), (reach * 0.6, 0, high - 0.3 * r), (reach * 0.3, 0, tall * 0.97)]
        add_tube(head, "second", trigger, neck * 0.4, sides=8)
    draft.solid(head, PLASTIC)
    return draft.finish(), word


_KINDS: Mapping[str, tuple[float, Callable[[Draft, str], Made]]] = {
    "turned": (0.20, _turned),
    "handled": (0.30, _handled),
    "box": (0.18, _boxy),
    "slab": (0.14, _slab),
    "bent": (0.08, _bent),
    "sprayer": (0.10, _sprayer),
}
"""Kinds: how often, and how they are made, given the first colour's name; they may take another."""
