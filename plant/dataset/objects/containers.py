"""Cans and bottles for any drink, with the label that is given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from plant.dataset.objects.draft import ALUMINIUM, GLASS, WATER, Draft, Finished, pick, shade
from plant.dataset.objects.wear import plain, scratched, uneven
from plant.models.builder.mesh import Colour
from plant.models.builder.pictures import noise
from skills.robot import FloatArray

Profile = list[tuple[float, float]]


@dataclass(frozen=True)
class Can:
    """A drink can: radius and height of the whole, radius of the lid."""

    radius_m: float
    height_m: float
    lid_radius_m: float
    full: bool
    wear: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Self:
        """Standard 0.33 l, sleek, slim, small, or 0.5 l."""
        sizes = ((0.0331, 0.1155), (0.0289, 0.1456), (0.0265, 0.134), (0.0289, 0.090), (0.0331, 0.168), (0.0331, 0.122))
        radius, height = sizes[int(rng.choice(6, p=[0.45, 0.12, 0.08, 0.07, 0.16, 0.12]))]
        lid = radius - float(rng.uniform(0.0045, 0.007))
        return cls(
            radius, height * float(rng.uniform(0.98, 1.02)), lid, bool(rng.random() < 0.8), float(rng.uniform(0, 0.5))
        )


@dataclass(frozen=True)
class Bottle:
    """A bottle's outline, (radius, height) from the bottom up, where its label sits, and what it is made of."""

    outline: tuple[tuple[float, float], ...]
    label_m: tuple[float, float]
    neck_label_m: tuple[float, float] | None
    glass: bool
    full: bool


def make_can(draft: Draft, can: Can, label: FloatArray) -> Finished:
    """A can with a printed body; its lid has a tab."""
    rng, r, h, lid = draft.rng, can.radius_m, can.height_m, can.lid_radius_m
    label = scratched(uneven(label, rng, 0.01), rng, can.wear * 0.3)
    draft.picture("label", label, shine=0.6, metal=float(rng.choice([0.0, 0.5])))
    draft.paint("metal", shade(rng, (0.76, 0.77, 0.79), 0.04), shine=0.7, metal=1.0)
    draft.paint(
        "tab", shade(rng, pick(rng, (0.6, 0.6, 0.62), (0.6, 0.6, 0.62), (0.75, 0.1, 0.1)), 0.05), shine=0.6, metal=1.0
    )
    draft.paint("slot", (0.12, 0.12, 0.12) if not can.full else (0.66, 0.67, 0.69), shine=0.3)
    body, shoulder = draft.part(), (r - lid) * 1.5
    body.add_lathe("metal", [(0, 0.006), (lid * 0.8, 0.003), (lid * 0.94, 0), (lid, 0.001), (r, 0.009)], sides=36)
    body.add_lathe("label", [(r, 0.009), (r, h - 0.006 - shoulder), (lid + 0.002, h - 0.004)], sides=36)
    rim = [(lid + 0.002, h - 0.004), (lid + 0.0015, h), (lid - 0.001, h), (lid - 0.002, h - 0.004), (0, h - 0.004)]
    body.add_lathe("metal", rim, sides=36)
    draft.shell(body, ALUMINIUM * 0.00015)
    _tab(draft, h - 0.0035)
    _fill(draft, [(r - 0.0002, 0.009), (r - 0.0002, 0.9 * h if can.full else 0.011)], WATER)
    draft.collide_upright(r, 0.004, h - shoulder - 0.004)
    draft.collide_upright(lid, 0.0, h)
    return draft.finish()


def _tab(draft: Draft, z: float) -> None:
    part = draft.part()
    part.add_prism(
        "tab", [(0.010 * np.cos(a) * 1.4 + 0.004, 0.008 * np.sin(a)) for a in np.arange(12) * np.pi / 6], z, z + 0.001
    )
    part.add_prism(
        "slot", [(0.008 * np.cos(a) - 0.015, 0.006 * np.sin(a)) for a in np.arange(12) * np.pi / 6], z - 0.0003, z
    )
    draft.look(part)


def _fill(draft: Draft, profile: Profile, density: float) -> None:
    """A filling that has weight: the profile closed at both ends."""
    draft.paint("filling", (0, 0, 0))
    content = draft.part()
    content.add_lathe("filling", [(0, profile[0][1]), *profile, (0, profile[-1][1])], sides=16)
    draft.content(content, density)


def make_bottle(
    draft: Draft,
    bottle: Bottle,
    *,
    label: FloatArray,
    neck: FloatArray | None,
    glass: Colour,
    cap: Colour,
    wide_cap: bool,
) -> Finished:
    """A bottle with a paper or plastic label and a crown or screw cap."""
    rng, line = draft.rng, list(bottle.outline)
    draft.picture("label", uneven(label, rng, 0.01), shine=0.35)
    if neck is not None:
        draft.picture("neck_label", neck, shine=0.35)
    draft.picture("glass", _glass_picture(rng, glass), shine=0.85)
    draft.paint("cap", cap, shine=0.5, metal=0.0 if wide_cap else 0.6)
    draft.paint("bottom", np.array(glass) * 0.8, shine=0.6)
    body = draft.part()
    body.add_lathe("bottom", [(0, line[0][1] + 0.004), (line[0][0] * 0.8, line[0][1]), line[0]], sides=28)
    for material, low, high in _bands(bottle, neck is not None):
        piece = _between(line, low, high)
        if len(piece) > 1:
            body.add_lathe(material, piece, sides=36)
    body.add_lathe("bottom", [line[-1], (0, line[-1][1])], sides=20)
    draft.shell(body, GLASS * 0.0027 if bottle.glass else 1380.0 * 0.0004)
    _cap(draft, line[-1], wide_cap)
    top = 0.78 if bottle.full else 0.3
    wall = 0.003 if bottle.glass else 0.0005
    inside = [(max(r - wall, 0.002), z) for r, z in _between(line, 0.004, top * line[-1][1])]
    _fill(draft, inside, WATER)
    _collide_turned(draft, line)
    return draft.finish()


def _glass_picture(rng: np.random.Generator, colour: Colour) -> FloatArray:
    """Light and dark streaks that pass for light in thick glass."""
    shape = (64, 128)
    image = plain(colour, shape) * (1 + 0.10 * noise(rng, shape, (30, 4)))[..., None]
    return np.asarray(image)


def _bands(bottle: Bottle, neck: bool) -> list[tuple[str, float, float]]:
    low, high = bottle.label_m
    bands = [("glass", 0.0, low), ("label", low, high)]
    if bottle.neck_label_m is None or not neck:
        return [*bands, ("glass", high, 9.0)]
    first, last = bottle.neck_label_m
    return [*bands, ("glass", high, first), ("neck_label", first, last), ("glass", last, 9.0)]


def _between(line: Profile, low: float, high: float) -> Profile:
    """The part of an outline between two heights, cut there."""
    z, r = np.array([p[1] for p in line]), np.array([p[0] for p in line])
    low, high = max(low, float(z[0])), min(high, float(z[-1]))
    if high - low < 1e-5:
        return []
    inner = [p for p in line if low + 1e-5 < p[1] < high - 1e-5]
    return [(float(np.interp(low, z, r)), low), *inner, (float(np.interp(high, z, r)), high)]


def _cap(draft: Draft, top: tuple[float, float], wide: bool) -> None:
    r, z = top
    part = draft.part()
    if wide:
        profile = [(0, z - 0.014), (r + 0.0022, z - 0.014), (r + 0.002, z + 0.002), (0, z + 0.002)]
    else:
        profile = [(0, z - 0.005), (r + 0.003, z - 0.005), (r + 0.001, z + 0.001), (0, z + 0.0015)]
    part.add_lathe("cap", profile, sides=24)
    draft.shell(part, 0.9)


def _collide_turned(draft: Draft, line: Profile) -> None:
    """A cylinder for the body, one for the neck."""
    top, widest = line[-1][1], max(r for r, _ in line)
    shoulder = max(z for r, z in line if r > widest * 0.93)
    draft.collide_upright(widest, 0.0, shoulder)
    neck = [r for r, z in line if z > (shoulder + top) / 2]
    draft.collide_upright(max(neck), shoulder, top + 0.001)
