"""Hammers: claw, ball-peen, cross-peen, sledge, club hammers and mallets.

A hammer lies along x with its head at the +x end; the head runs along y.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from plant.dataset.objects.draft import RUBBER, STEEL, WOOD, Draft, Finished, pick, shade, turned
from plant.dataset.objects.wear import brushed, plain, rusty, used
from plant.models.builder.mesh import Mesh
from plant.models.builder.outlines import curve
from plant.models.builder.pictures import wood
from plant.models.builder.surfaces import add_ellipsoid, add_extruded, add_grid, add_rounded_box, add_tube

ALONG_Y = turned("x", -np.pi / 2)
"""Turns a part made along z so that it lies along y."""


@dataclass(frozen=True)
class HammerForm:
    """Whole length, length and half thickness of the head, half thickness of the handle (m), wear 0..1."""

    kind: str
    length_m: float
    head_m: float
    head_half_m: float
    handle_half_m: float
    wear: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Self:
        """One of the kinds, at a size that is usual for it."""
        kinds = ("claw", "ball-peen", "cross-peen", "sledge", "club", "mallet")
        sizes = {
            "claw": ((0.27, 0.36), (0.105, 0.135), (0.012, 0.015)),
            "ball-peen": ((0.26, 0.38), (0.075, 0.115), (0.012, 0.017)),
            "cross-peen": ((0.24, 0.36), (0.085, 0.12), (0.010, 0.015)),
            "sledge": ((0.50, 0.92), (0.13, 0.19), (0.026, 0.036)),
            "club": ((0.23, 0.30), (0.08, 0.12), (0.019, 0.025)),
            "mallet": ((0.26, 0.38), (0.09, 0.14), (0.027, 0.042)),
        }
        kind = str(rng.choice(kinds, p=[0.42, 0.13, 0.10, 0.13, 0.10, 0.12]))
        length, head, half = (float(rng.uniform(*span)) for span in sizes[kind])
        return cls(
            kind,
            length,
            head,
            half,
            float(rng.uniform(0.010, 0.0135)) * (1.35 if kind == "sledge" else 1),
            float(rng.uniform(0, 0.8)),
        )


def hammer(draft: Draft) -> tuple[Finished, str, str]:
    """A hammer of any kind."""
    rng = draft.rng
    form = HammerForm.drawn(rng)
    _head_materials(draft, form)
    colour = _handle(draft, form)
    heads: dict[str, Callable[[Draft, HammerForm], None]] = {
        "claw": _claw_head,
        "ball-peen": _ball_head,
        "cross-peen": _cross_head,
        "sledge": _sledge_head,
        "club": _sledge_head,
        "mallet": _mallet_head,
    }
    heads[form.kind](draft, form)
    x, half = _head_x(form), form.head_half_m
    draft.collide_box(
        (-form.length_m / 2, -form.handle_half_m * 1.2, -form.handle_half_m),
        (x, form.handle_half_m * 1.2, form.handle_half_m),
    )
    draft.collide_box((x - half, -form.head_m / 2, -half), (x + half, form.head_m / 2, half))
    return draft.finish(), form.kind, colour


def _head_x(form: HammerForm) -> float:
    return form.length_m / 2 - form.head_half_m


def _head_materials(draft: Draft, form: HammerForm) -> None:
    rng = draft.rng
    tone = pick(rng, (0.22, 0.23, 0.25), (0.35, 0.36, 0.38), (0.60, 0.61, 0.63), (0.12, 0.12, 0.13), (0.45, 0.46, 0.48))
    if rng.random() < 0.18:
        tone = pick(rng, (0.62, 0.10, 0.09), (0.12, 0.25, 0.50), (0.75, 0.55, 0.08), (0.10, 0.36, 0.20))
    image = used(brushed(rng, tone), rng, form.wear)
    draft.picture("steel", rusty(image, rng, form.wear * 0.5) if rng.random() < 0.4 else image, shine=0.55, metal=0.8)
    draft.picture("face", used(brushed(rng, shade(rng, (0.58, 0.59, 0.61))), rng, form.wear), shine=0.65, metal=0.9)


def _handle(draft: Draft, form: HammerForm) -> str:
    """A wooden, fibreglass or steel handle; its colour."""
    rng, end, x = draft.rng, -form.length_m / 2, _head_x(form)
    style = (
        "wood"
        if form.kind == "mallet" and rng.random() < 0.7
        else str(rng.choice(["wood", "fibre", "steel"], p=[0.5, 0.36, 0.14]))
    )
    if style == "wood":
        return _wooden_handle(draft, form, end, x)
    name, colour = _grip_colour(rng)
    draft.picture(
        "core",
        used(
            plain(colour if rng.random() < 0.5 else pick(rng, (0.9, 0.75, 0.1), (0.1, 0.1, 0.1))), rng, form.wear * 0.5
        ),
    )
    if style == "steel":
        draft.picture("core", used(brushed(rng, (0.62, 0.63, 0.65)), rng, form.wear), shine=0.7, metal=1.0)
    grip = pick(rng, (0.08, 0.08, 0.09), (0.13, 0.13, 0.14), colour)
    draft.picture("grip", used(plain(shade(rng, grip)), rng, form.wear * 0.4), shine=0.15)
    draft.picture("band", used(plain(shade(rng, colour)), rng, form.wear * 0.4), shine=0.25)
    split, half = end + form.length_m * float(rng.uniform(0.32, 0.45)), form.handle_half_m
    part = draft.part()
    _bar(part, "core", [(split - 0.01, half * 0.85, half * 0.7), (x, half * 0.75, half * 0.65)])
    draft.solid(part, STEEL * 0.6 if style == "steel" else 1600.0)
    _rubber_grip(draft, end, split, half)
    return name


def _rubber_grip(draft: Draft, end: float, split: float, half: float) -> None:
    swell = float(draft.rng.uniform(1.05, 1.3))
    stations = [(0.0, 1.18), (0.06, 1.25), (0.25, swell), (0.5, 1.12), (0.75, 1.2), (0.95, 1.0), (1.0, 0.9)]
    part = draft.part()
    rows = [(end + s * (split - end), half * w, half * min(w, 1.12)) for s, w in stations]
    _bar(part, "grip", rows[:5])
    _bar(part, "band" if draft.rng.random() < 0.6 else "grip", rows[4:])
    for s in np.linspace(0.2, 0.7, int(draft.rng.integers(0, 7))):
        x = end + s * (split - end)
        _bar(part, "band", [(x, half * 1.26, half * 1.15), (x + 0.004, half * 1.26, half * 1.15)])
    draft.solid(part, RUBBER)


def _wooden_handle(draft: Draft, form: HammerForm, end: float, x: float) -> str:
    rng = draft.rng
    tone = pick(rng, (0.83, 0.62, 0.34), (0.76, 0.53, 0.28), (0.88, 0.72, 0.46), (0.55, 0.34, 0.18))
    draft.picture("wood", used(wood(rng, (128, 256), tone, 0.08), rng, form.wear * 0.7, (0.5, 0.35, 0.2)), shine=0.3)
    swell, half = float(rng.uniform(0.95, 1.3)), form.handle_half_m
    stations = [(0.0, 1.15), (0.03, 1.25), (0.15, swell), (0.4, 1.2), (0.65, 0.85), (0.85, 0.82), (1.0, 0.9)]
    part = draft.part()
    _bar(part, "wood", [(end + s * (x - end), half * w, half * (0.55 + 0.3 * w)) for s, w in stations])
    draft.solid(part, WOOD + 50)
    if rng.random() < 0.3:
        colour = pick(rng, (0.7, 0.1, 0.1), (0.1, 0.1, 0.12), (0.12, 0.3, 0.6), (0.85, 0.7, 0.1))
        draft.picture("dip", used(plain(colour), rng, form.wear))
        dipped = draft.part()
        _bar(
            dipped,
            "dip",
            [(end - 0.001, half * 1.18, half * 0.92), (end + 0.3 * form.length_m, half * swell * 1.06, half * 0.92)],
        )
        draft.look(dipped)
    return "brown"


def _grip_colour(rng: np.random.Generator) -> tuple[str, tuple[float, float, float]]:
    options = (
        ("red", (0.78, 0.08, 0.07)),
        ("blue", (0.08, 0.24, 0.62)),
        ("yellow", (0.93, 0.75, 0.06)),
        ("black", (0.09, 0.09, 0.10)),
        ("orange", (0.92, 0.40, 0.05)),
        ("green", (0.10, 0.45, 0.18)),
        ("grey", (0.45, 0.46, 0.47)),
    )
    return options[int(rng.integers(len(options)))]


def _bar(part: Mesh, material: str, stations: list[tuple[float, float, float]]) -> None:
    """An oval bar along x through (x, half width in y, half thickness in z)."""
    rows = np.array(stations if len(stations) < 3 else curve(stations, 4))
    add_tube(
        part,
        material,
        np.column_stack([rows[:, 0], 0 * rows[:, 0], 0 * rows[:, 0]]),
        rows[:, 1:],
        sides=16,
        up=(0, 1, 0),
    )


def _striker(part: Mesh, half: float, reach: float, share: float = 0.62) -> None:
    """A round neck and face towards +z, from the middle of the head."""
    face = half * 1.02
    part.add_lathe(
        "steel", [(0, 0), (half * share, 0.0), (half * share, reach * 0.55), (face, reach * 0.72), (face, reach * 0.97)]
    )
    part.add_lathe("face", [(face, reach * 0.97), (face * 0.9, reach), (0, reach * 1.005)])


def _claw_head(draft: Draft, form: HammerForm) -> None:
    x, half, reach = _head_x(form), form.head_half_m, form.head_m
    part = draft.part()
    _striker(part, half, reach * 0.46)
    draft.solid(part, STEEL, ALONG_Y, (x, 0, 0))
    middle = draft.part()
    add_rounded_box(middle, "steel", (x - half * 1.1, -half, -half * 0.85), (x + half, half, half * 0.85), half * 0.3)
    draft.solid(middle, STEEL)
    bend = float(draft.rng.uniform(0.05, 0.6))
    for side in (-1, 1):
        draft.solid(_prong(draft, form, side, bend), STEEL)


def _prong(draft: Draft, form: HammerForm, side: int, bend: float) -> Mesh:
    """One half of the claw: it curves towards the handle and comes to an edge; the two leave a gap."""
    x, half, reach = _head_x(form), form.head_half_m, form.head_m * 0.56
    rings = []
    for s in np.linspace(0, 1, 9):
        middle = np.array([x - bend * reach * s * s, -half * 0.5 - reach * s, 0.0])
        thick = half * (0.95 - 0.8 * s)
        gap, wide = half * (0.02 + 0.22 * s), half * (0.85 + 0.1 * s)
        low, high = sorted((side * gap, side * wide))
        corners = [(thick, low), (thick, high), (-thick, high), (-thick, low), (thick, low)]
        ring = [middle + [c[0] * 0.8, 0.25 * bend * c[0], c[1]] for c in corners]
        rings.append(ring)
    part = draft.part()
    grid = np.array(rings)
    for k in range(4):
        add_grid(part, "steel", grid[::-1, k : k + 2])
    for ring, order in ((grid[0], 1), (grid[-1], -1)):
        points = ring[:4][:: order * -1]
        normal = np.cross(points[1] - points[0], points[2] - points[0])
        normal /= np.linalg.norm(normal)
        part.add_triangles("steel", points[[0, 1, 2, 0, 2, 3]], [normal] * 6, [(0.1, 0.1)] * 6)
    return part


def _ball_head(draft: Draft, form: HammerForm) -> None:
    x, half, reach = _head_x(form), form.head_half_m, form.head_m / 2
    part = draft.part()
    _striker(part, half, reach, 0.7)
    part.add_lathe("steel", [(0, -reach + half * 0.9), (half * 0.55, -reach + half * 0.9), (half * 0.7, 0), (0, 0)])
    add_ellipsoid(part, "face", (0, 0, -reach + half), (half * 0.95,) * 3)
    add_ellipsoid(part, "steel", (0, 0, 0), (half * 0.95, half * 0.95, half * 1.3))
    draft.solid(part, STEEL, ALONG_Y, (x, 0, 0))


def _cross_head(draft: Draft, form: HammerForm) -> None:
    x, half, reach = _head_x(form), form.head_half_m, form.head_m / 2
    part = draft.part()
    add_rounded_box(part, "steel", (x - half, -half, -half), (x + half, reach * 0.95, half), half * 0.2)
    add_rounded_box(
        part, "face", (x - half * 0.95, reach * 0.93, -half * 0.95), (x + half * 0.95, reach, half * 0.95), half * 0.15
    )
    draft.solid(part, STEEL)
    wedge = draft.part()
    outline = [
        (x + half, -half * 0.5),
        (x - half, -half * 0.5),
        (x - half * 0.15 + 0.2 * half, -reach),
        (x + half * 0.35, -reach),
    ]
    add_extruded(wedge, "steel", outline, -half * 0.95, half * 0.95, bevel=0.001)
    draft.solid(wedge, STEEL)


def _sledge_head(draft: Draft, form: HammerForm) -> None:
    """Eight-sided with slight chamfers at both faces."""
    x, half, reach = _head_x(form), form.head_half_m, form.head_m / 2
    sides = 8 if draft.rng.random() < 0.75 else 4
    turn = np.pi / sides
    grow = half / np.cos(np.pi / sides)
    rows = [
        (-1.0, 0.82, "face"),
        (-0.92, 1.0, "steel"),
        (0.0, 0.97, "steel"),
        (0.92, 1.0, "steel"),
        (1.0, 0.82, "face"),
    ]
    part = draft.part()
    angle = np.linspace(0, 2 * np.pi, sides + 1) + turn
    for (s0, w0, _), (s1, w1, _) in itertools.pairwise(rows):
        ring = [
            np.stack([w * grow * np.cos(angle), w * grow * np.sin(angle), 0 * angle + s * reach], axis=1)
            for s, w in ((s0, w0), (s1, w1))
        ]
        for k in range(sides):
            add_grid(part, "steel", np.stack([ring[0][k : k + 2], ring[1][k : k + 2]]))
    outline = np.stack([0.82 * grow * np.cos(angle[:-1]), 0.82 * grow * np.sin(angle[:-1])], axis=1)
    for z in (-reach, reach - 1e-4):
        add_extruded(part, "face", outline, z, z + 1e-4)
    draft.solid(part, STEEL, ALONG_Y, (x, 0, 0))


def _mallet_head(draft: Draft, form: HammerForm) -> None:
    """A drum of rubber, wood or plastic; or a wooden block."""
    x, half, reach, rng = _head_x(form), form.head_half_m, form.head_m / 2, draft.rng
    style = str(rng.choice(["rubber", "white rubber", "wood", "two faces"]))
    tone = {
        "rubber": (0.07, 0.07, 0.07),
        "white rubber": (0.88, 0.87, 0.84),
        "two faces": (0.35, 0.36, 0.38),
        "wood": (0.8, 0.6, 0.36),
    }[style]
    image = (
        wood(rng, (128, 128), tone, 0.08) if style == "wood" else used(plain(shade(rng, tone)), rng, form.wear * 0.5)
    )
    draft.picture("drum", image, shine=0.25)
    part = draft.part()
    if style == "wood" and rng.random() < 0.6:
        add_rounded_box(part, "drum", (x - half, -reach, -half * 0.8), (x + half, reach, half * 0.8), 0.004)
        return draft.solid(part, WOOD)
    profile = [
        (0, -reach),
        (half * 0.9, -reach),
        (half, -reach * 0.9),
        (half * 0.97, 0),
        (half, reach * 0.9),
        (half * 0.9, reach),
        (0, reach),
    ]
    part.add_lathe("drum", profile, sides=28)
    if style == "two faces":
        for sign in (-1, 1):
            draft.picture(
                f"tip{sign}",
                plain(pick(rng, (0.8, 0.1, 0.1), (0.95, 0.8, 0.1), (0.1, 0.1, 0.1), (0.9, 0.5, 0.1), (0.9, 0.9, 0.85))),
            )
            low, high = sorted((sign * reach * 0.7, sign * reach * 1.01))
            part.add_lathe(f"tip{sign}", [(0, low), (half * 1.05, low), (half * 1.05, high), (0, high)])
    return draft.solid(part, WOOD if style == "wood" else RUBBER, ALONG_Y, (x, 0, 0))
