"""Screwdrivers: slotted, cross-head and hex tips, with many handles. They lie along x, tip at the +x end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from plant.dataset.objects.draft import PLASTIC, STEEL, UP_TO_X, WOOD, Draft, Finished, shade
from plant.dataset.objects.wear import plain, used
from plant.models.builder.mesh import Mesh
from plant.models.builder.outlines import curve
from plant.models.builder.pictures import wood
from plant.models.builder.surfaces import add_fan, add_grid

_COLOURS = (
    ("red", (0.80, 0.07, 0.06)),
    ("yellow", (0.95, 0.76, 0.05)),
    ("blue", (0.07, 0.22, 0.62)),
    ("green", (0.08, 0.45, 0.20)),
    ("orange", (0.94, 0.42, 0.05)),
    ("black", (0.08, 0.08, 0.09)),
    ("clear", (0.86, 0.62, 0.20)),
    ("purple", (0.36, 0.16, 0.50)),
    ("grey", (0.42, 0.43, 0.44)),
)
_SHAPES = {
    "fluted": [(0.0, 0.75), (0.04, 0.98), (0.15, 1.0), (0.7, 1.0), (0.82, 0.8), (0.92, 0.95), (1.0, 0.6)],
    "bulb": [(0.0, 0.55), (0.06, 0.9), (0.25, 1.05), (0.5, 0.95), (0.72, 0.66), (0.86, 0.86), (1.0, 0.55)],
    "straight": [(0.0, 0.9), (0.03, 1.0), (0.5, 0.95), (0.9, 0.9), (1.0, 0.65)],
    "soft": [(0.0, 0.7), (0.05, 0.95), (0.2, 1.1), (0.45, 0.9), (0.65, 1.02), (0.8, 0.72), (0.9, 0.9), (1.0, 0.62)],
    "wooden": [(0.0, 0.7), (0.06, 1.0), (0.3, 1.1), (0.6, 0.85), (0.85, 0.95), (1.0, 0.6)],
}


@dataclass(frozen=True)
class ScrewdriverForm:
    """Tip, handle's form and lobes, lengths and radii (m), wear 0..1."""

    tip: str
    shape: str
    lobes: int
    lobe_depth: float
    handle_m: float
    radius_m: float
    shaft_m: float
    shaft_radius_m: float
    wear: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Self:
        """Stubby, usual or long."""
        size = str(rng.choice(["stubby", "usual", "long", "fine"], p=[0.12, 0.58, 0.18, 0.12]))
        handle = {"stubby": (0.045, 0.06), "usual": (0.085, 0.12), "long": (0.11, 0.13), "fine": (0.07, 0.095)}[size]
        shaft = {"stubby": (0.03, 0.04), "usual": (0.075, 0.15), "long": (0.17, 0.28), "fine": (0.05, 0.09)}[size]
        radius = float(rng.uniform(0.008, 0.010) if size == "fine" else rng.uniform(0.0135, 0.0185))
        shape = str(rng.choice(list(_SHAPES)))
        lobes = int(rng.choice([3, 4, 6, 8])) if shape != "wooden" else 2
        thick = float(rng.uniform(0.0016, 0.0024) if size == "fine" else rng.uniform(0.0026, 0.0046))
        tip = str(rng.choice(["slotted", "cross-head", "hex"], p=[0.42, 0.36, 0.22]))
        depth = float(rng.uniform(0.06, 0.2)) if lobes > 2 else 0.12
        return cls(
            tip,
            shape,
            lobes,
            depth,
            float(rng.uniform(*handle)),
            radius,
            float(rng.uniform(*shaft)),
            thick,
            float(rng.uniform(0, 0.7)),
        )


def screwdriver(draft: Draft) -> tuple[Finished, str, str]:
    """A screwdriver of any kind."""
    rng = draft.rng
    form = ScrewdriverForm.drawn(rng)
    name = _materials(draft, form)
    handle = draft.part()
    _handle(handle, form, two_tone=form.shape != "wooden" and rng.random() < 0.6)
    draft.solid(handle, WOOD + 50 if form.shape == "wooden" else PLASTIC * 1.1, UP_TO_X)
    shaft = draft.part()
    _shaft(shaft, form)
    draft.solid(shaft, STEEL, UP_TO_X)
    draft.collide_along_x(form.radius_m * 0.98, 0.0, form.handle_m)
    draft.collide_along_x(form.shaft_radius_m, form.handle_m, form.handle_m + form.shaft_m)
    return draft.finish(), form.tip, name


def _materials(draft: Draft, form: ScrewdriverForm) -> str:
    rng = draft.rng
    name, colour = _COLOURS[int(rng.integers(len(_COLOURS)))]
    _, second = _COLOURS[int(rng.choice([5, 5, 5, 8, 1, 0]))]
    if form.shape == "wooden":
        name, body = "brown", wood(rng, (96, 96), ((0.72, 0.42, 0.18), (0.85, 0.62, 0.34))[int(rng.integers(2))], 0.08)
    else:
        body = plain(shade(rng, colour))
    draft.picture("body", used(body, rng, form.wear * 0.6), shine=0.6 if name == "clear" else 0.4)
    draft.picture("grip", used(plain(shade(rng, second)), rng, form.wear * 0.5), shine=0.15)
    bright = (0.70, 0.71, 0.73) if rng.random() < 0.75 else (0.25, 0.25, 0.27)
    draft.picture("steel", used(plain(shade(rng, bright)), rng, form.wear), shine=0.75, metal=1.0)
    draft.picture(
        "tip", used(plain((0.18, 0.18, 0.19) if rng.random() < 0.6 else bright), rng, form.wear), shine=0.5, metal=0.8
    )
    return name


def _handle(part: Mesh, form: ScrewdriverForm, *, two_tone: bool) -> None:
    """The handle along z, with lobes around it that fade at both ends."""
    line = np.array(curve(_SHAPES[form.shape], 5))
    angle = np.linspace(0, 2 * np.pi, 41)
    wave = 0.5 - 0.5 * np.cos(form.lobes * angle)
    fade = np.clip(np.minimum(line[:, 0], (0.8 - line[:, 0]).clip(0)) * 8, 0, 1)
    radius = form.radius_m * line[:, 1][:, None] * (1 - form.lobe_depth * fade[:, None] * wave)
    z = np.broadcast_to(line[:, :1] * form.handle_m, radius.shape)
    grid = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)
    low, high = (np.searchsorted(line[:, 0], share) for share in ((0.22, 0.68) if two_tone else (0.0, 0.0)))
    for material, first, last in (("body", 0, low), ("grip", low, high), ("body", high, len(grid) - 1)):
        if last > first:
            add_grid(part, material, grid[first : last + 1], ring=True)
    add_fan(part, "body", grid[0, ::-1])
    add_fan(part, "body", grid[-1])


def _shaft(part: Mesh, form: ScrewdriverForm) -> None:
    r, z0 = form.shaft_radius_m, form.handle_m - 0.004
    z1 = form.handle_m + form.shaft_m
    tip = min(0.018, form.shaft_m * 0.3)
    part.add_lathe(
        "steel",
        [(0, z0), (r * 1.5, z0), (r * 1.5, z0 + 0.008), (r, z0 + 0.012), (r, z1 - tip)],
        sides=6 if r > 0.0042 else 16,
    )
    makers = {"slotted": _slotted, "cross-head": _cross, "hex": _hex}
    makers[form.tip](part, r, z1 - tip, z1)


def _slotted(part: Mesh, r: float, z0: float, z1: float) -> None:
    """A flared, flat blade."""
    stations = [(0.0, 1.0, 1.0), (0.35, 1.35, 0.8), (0.7, 1.45, 0.35), (1.0, 1.35, 0.14)]
    angle = np.linspace(0, 2 * np.pi, 25)
    squeeze = np.sign(np.cos(angle)) * np.abs(np.cos(angle)) ** 0.6
    rings = [
        np.stack([w * r * squeeze, t * r * np.sin(angle), 0 * angle + z0 + s * (z1 - z0)], axis=1)
        for s, w, t in stations
    ]
    add_grid(part, "tip", np.array(rings), ring=True)
    add_fan(part, "tip", rings[0][::-1])
    add_fan(part, "tip", rings[-1])


def _cross(part: Mesh, r: float, z0: float, z1: float) -> None:
    """Four wings that come to a point."""
    angle = np.linspace(0, 2 * np.pi, 33)
    rings = []
    for s, w, deep in ((0.0, 1.0, 0.0), (0.3, 1.0, 0.1), (0.55, 0.85, 0.45), (0.85, 0.5, 0.5), (1.0, 0.18, 0.2)):
        radius = w * r * (1 - deep * (0.5 - 0.5 * np.cos(4 * angle)))
        rings.append(np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle + z0 + s * (z1 - z0)], axis=1))
    add_grid(part, "tip", np.array(rings), ring=True)
    add_fan(part, "tip", rings[0][::-1])
    add_fan(part, "tip", rings[-1])


def _hex(part: Mesh, r: float, z0: float, z1: float) -> None:
    """A six-sided tip, or with a ball end a socket's key."""
    part.add_lathe("tip", [(0, z0), (r * 1.02, z0), (r * 0.9, z1 - 0.001), (r * 0.7, z1), (0, z1)], sides=6)
