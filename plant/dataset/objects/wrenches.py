"""Wrenches: combination, open-ended, ring, adjustable and pipe. They lie flat along x, main jaw at the +x end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from plant.dataset.objects.draft import RUBBER, STEEL, Draft, Finished, pick, shade, turned
from plant.dataset.objects.wear import brushed, plain, rusty, used
from plant.models.builder.mesh import Mesh
from plant.models.builder.outlines import arc
from plant.models.builder.surfaces import add_extruded, add_ring, add_tube


@dataclass(frozen=True)
class WrenchForm:
    """Kind, whole length, half thickness and half width of the shaft, radius of the head (m), finish, wear 0..1."""

    kind: str
    length_m: float
    half_thick_m: float
    shaft_m: float
    head_m: float
    finish: str
    wear: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Self:
        """A usual size of one of the kinds."""
        kind = str(
            rng.choice(["combination", "open-ended", "ring", "adjustable", "pipe"], p=[0.34, 0.14, 0.09, 0.27, 0.16])
        )
        span = {"adjustable": (0.15, 0.32), "pipe": (0.22, 0.42)}.get(kind, (0.12, 0.30))
        length = float(rng.uniform(*span))
        head = length * float(rng.uniform(0.075, 0.10))
        shaft = length * float(rng.uniform(0.028, 0.040))
        thick = length * float(rng.uniform(0.015, 0.022))
        finish = str(rng.choice(["chrome", "satin", "black", "rusty", "painted"], p=[0.4, 0.22, 0.14, 0.12, 0.12]))
        return cls(
            kind,
            length,
            thick,
            shaft,
            head,
            "painted" if kind == "pipe" and rng.random() < 0.8 else finish,
            float(rng.uniform(0, 0.8)),
        )


def wrench(draft: Draft) -> tuple[Finished, str, str]:
    """A wrench of any kind."""
    form = WrenchForm.drawn(draft.rng)
    colour = _materials(draft, form)
    makers: dict[str, Callable[[Draft, WrenchForm], None]] = {
        "combination": _combination,
        "open-ended": _open_ended,
        "ring": _ring_ended,
        "adjustable": _adjustable,
        "pipe": _pipe,
    }
    makers[form.kind](draft, form)
    half, t = form.length_m / 2, form.half_thick_m
    draft.collide_box((-half + form.head_m, -form.shaft_m, -t), (half - form.head_m, form.shaft_m, t))
    wide = form.head_m * (1.3 if form.kind in ("pipe", "adjustable") else 1.0)
    for sign in (-1, 1):
        end = sign * (half - form.head_m)
        draft.collide_box((end - form.head_m, -wide, -t), (end + form.head_m, wide, t))
    return draft.finish(), form.kind, colour


def _materials(draft: Draft, form: WrenchForm) -> str:
    rng = draft.rng
    tones = {
        "chrome": (0.78, 0.79, 0.81),
        "satin": (0.60, 0.61, 0.62),
        "black": (0.13, 0.13, 0.14),
        "rusty": (0.42, 0.38, 0.34),
    }
    bare = tones.get(form.finish, (0.55, 0.56, 0.57))
    image = used(brushed(rng, shade(rng, bare, 0.03)), rng, form.wear * 0.6)
    image = rusty(image, rng, 0.5 + 0.5 * form.wear) if form.finish == "rusty" else image
    draft.picture("steel", image, shine=0.8 if form.finish == "chrome" else 0.5, metal=1.0)
    draft.picture("jaw", used(brushed(rng, shade(rng, (0.5, 0.51, 0.52))), rng, form.wear), shine=0.55, metal=1.0)
    draft.paint("dark", (0.12, 0.12, 0.12))
    options = (
        ("red", (0.76, 0.09, 0.07)),
        ("blue", (0.09, 0.24, 0.58)),
        ("yellow", (0.92, 0.72, 0.08)),
        ("green", (0.1, 0.42, 0.2)),
    )
    name, colour = options[int(rng.choice(4, p=[0.5, 0.22, 0.16, 0.12]))]
    draft.picture("paint", used(plain(shade(rng, colour)), rng, form.wear, bare), shine=0.45)
    draft.picture(
        "sleeve", used(plain(shade(rng, pick(rng, colour, (0.1, 0.1, 0.1)))), rng, form.wear * 0.4), shine=0.2
    )
    return (
        name
        if form.finish == "painted"
        else {"chrome": "silver", "satin": "grey", "black": "black", "rusty": "brown"}[form.finish]
    )


def _body(form: WrenchForm) -> str:
    return "paint" if form.finish == "painted" else "steel"


def _shaft(draft: Draft, form: WrenchForm, x0: float, x1: float, *, taper: float = 0.85) -> None:
    """A flat bar, with a raised or sunken field."""
    w, t = form.shaft_m, form.half_thick_m * 0.75
    part = draft.part()
    add_extruded(part, _body(form), [(x0, -w * taper), (x1, -w), (x1, w), (x0, w * taper)], -t, t, bevel=t * 0.5)
    draft.solid(part, STEEL)
    if draft.rng.random() < 0.5:
        field = draft.part()
        a, b, v = x0 + 0.2 * (x1 - x0), x0 + 0.8 * (x1 - x0), w * 0.5
        add_extruded(field, "jaw", [(a, -v), (b, -v), (b, v), (a, v)], -t - 0.0003, t + 0.0003)
        draft.look(field)


def _open_end(draft: Draft, form: WrenchForm, x: float, direction: float, scale: float = 1.0) -> None:
    """A forked jaw about (x, 0) that opens to the right, turned by `direction` (rad)."""
    r = form.head_m * scale
    jaw, deep = r * float(draft.rng.uniform(0.46, 0.56)), r * 0.35
    outer = arc((0, 0), r, 42, 318, 26)
    mouth = [
        (r * 0.92, -jaw),
        (-deep * 0.4, -jaw),
        (-deep, -jaw * 0.4),
        (-deep, jaw * 0.4),
        (-deep * 0.4, jaw),
        (r * 0.92, jaw),
    ]
    part = draft.part()
    add_extruded(
        part,
        _body(form),
        np.concatenate([outer, mouth]),
        -form.half_thick_m,
        form.half_thick_m,
        bevel=form.half_thick_m * 0.35,
    )
    draft.solid(part, STEEL, turned("z", direction), (x, 0, 0))


def _ring_end(draft: Draft, form: WrenchForm, x: float, scale: float = 1.0) -> None:
    r = form.head_m * scale * 0.9
    part = draft.part()
    t = form.half_thick_m * 1.25
    add_ring(part, _body(form), r * 0.60, r, -t, t)
    draft.solid(part, STEEL, p=(x, 0, 0))


def _combination(draft: Draft, form: WrenchForm) -> None:
    half, r = form.length_m / 2, form.head_m
    _shaft(draft, form, -half + r * 1.5, half - r * 1.6)
    _open_end(draft, form, half - r, float(draft.rng.choice([-1, 1])) * np.radians(15))
    _ring_end(draft, form, -half + r * 0.85)


def _open_ended(draft: Draft, form: WrenchForm) -> None:
    half, r = form.length_m / 2, form.head_m
    _shaft(draft, form, -half + r * 1.5, half - r * 1.6)
    _open_end(draft, form, half - r, np.radians(15))
    _open_end(draft, form, -half + r, np.pi + np.radians(15), 0.88)


def _ring_ended(draft: Draft, form: WrenchForm) -> None:
    half, r = form.length_m / 2, form.head_m
    _shaft(draft, form, -half + r * 1.4, half - r * 1.4)
    _ring_end(draft, form, half - r, 1.05)
    _ring_end(draft, form, -half + r, 0.9)


def _adjustable(draft: Draft, form: WrenchForm) -> None:
    """A fixed jaw that is one with the handle, a sliding jaw and a knurled screw."""
    half, r, t = form.length_m / 2, form.head_m * 1.15, form.half_thick_m * 1.15
    _tapered_handle(draft, form, -half, half - 1.7 * r)
    opening = r * float(draft.rng.uniform(0.1, 0.75))
    fixed = [
        (-2.2 * r, -0.45 * r),
        (-0.9 * r, -0.62 * r),
        (-0.35 * r, -0.55 * r),
        (-0.1 * r, 0.25 * r),
        (0.1 * r, 0.42 * r),
    ]
    fixed += [
        (1.02 * r, 0.55 * r),
        (1.05 * r, 0.8 * r),
        (0.5 * r, 1.18 * r),
        (-0.4 * r, 1.2 * r),
        (-1.2 * r, 0.9 * r),
        (-2.2 * r, 0.45 * r),
    ]
    sliding = [(-0.32 * r, 0.0), (-0.5 * r, -0.75 * r), (0.1 * r, -0.78 * r), (1.0 * r, -0.25 * r), (1.05 * r, 0.0)]
    turn, at = turned("z", -np.radians(float(draft.rng.uniform(10, 24)))), np.array([half - 1.05 * r, 0, 0])
    for outline, shift in ((fixed, 0.0), (sliding, 0.42 * r - opening)):
        part = draft.part()
        moved = [(x, y + shift) for x, y in outline]
        add_extruded(part, _body(form) if shift == 0 else "jaw", moved, -t, t, bevel=t * 0.3)
        draft.solid(part, STEEL, turn, at)
    screw = draft.part()
    length = r * 0.8
    add_tube(
        screw,
        "dark",
        [(-0.62 * r, -0.52 * r, 0), (-0.62 * r + length * 0.2, -0.52 * r + length, 0)],
        [0.17 * r, 0.17 * r],
        sides=12,
    )
    _knurls(screw, r)
    draft.solid(screw, STEEL, turn, at)


def _knurls(part: Mesh, r: float) -> None:
    for k in range(5):
        y = -0.42 * r + 0.14 * r * k
        x = -0.62 * r + 0.2 * (y + 0.52 * r)
        add_tube(part, "jaw", [(x, y, 0), (x + 0.01 * r, y + 0.07 * r, 0)], [0.24 * r, 0.24 * r], sides=12)


def _tapered_handle(draft: Draft, form: WrenchForm, x0: float, x1: float) -> None:
    """A handle that widens towards its end, with a hole there or a plastic sleeve over it."""
    w, t = form.shaft_m, form.half_thick_m * 0.8
    part = draft.part()
    end = arc((x0 + w * 1.2, 0), w * 1.2, 90, 270, 12)
    add_extruded(part, _body(form), np.concatenate([end, [(x1, -w * 1.05), (x1, w * 1.05)]]), -t, t, bevel=t * 0.5)
    draft.solid(part, STEEL)
    if draft.rng.random() < 0.45:
        sleeve = draft.part()
        line = np.linspace(x0 - 0.002, x0 + (x1 - x0) * 0.75, 8)
        radii = np.column_stack([w * np.linspace(1.45, 1.2, 8), np.full(8, t * 1.6)])
        add_tube(sleeve, "sleeve", np.column_stack([line, 0 * line, 0 * line]), radii, sides=16, up=(0, 1, 0))
        draft.solid(sleeve, RUBBER * 0.5)
    else:
        hole = draft.part()
        hole.add_cylinder("dark", w * 0.5, (x0 + w * 1.4, 0, -t - 0.0004), 2 * t + 0.0008)
        draft.look(hole)


def _pipe(draft: Draft, form: WrenchForm) -> None:
    """A heavy handle with a hook jaw through a housing, teeth on both jaws, and a nut."""
    half, r, t = form.length_m / 2, form.head_m, form.half_thick_m * 1.7
    neck = half - 2.4 * r
    part = draft.part()
    w = form.shaft_m * 1.1
    end = arc((-half + w, 0), w, 90, 270, 10)
    add_extruded(
        part,
        _body(form),
        np.concatenate([end, [(neck, -w * 0.75), (neck + r, -w), (neck + r, w), (neck, w * 0.75)]]),
        -t,
        t,
        bevel=t * 0.4,
    )
    draft.solid(part, STEEL * 0.8)
    heel = [
        (neck + 0.6 * r, -0.9 * r),
        (neck + 1.75 * r, -0.8 * r),
        (neck + 1.75 * r, 0.1 * r),
        (neck + 0.6 * r, 0.35 * r),
    ]
    housing = [
        (neck + 0.5 * r, 0.1 * r),
        (neck + 1.3 * r, 0.1 * r),
        (neck + 1.3 * r, 1.0 * r),
        (neck + 0.5 * r, 0.9 * r),
    ]
    for outline, material, deep in ((heel, _body(form), 1.0), (housing, _body(form), 1.25)):
        piece = draft.part()
        add_extruded(piece, material, outline, -t * deep, t * deep, bevel=t * 0.25)
        draft.solid(piece, STEEL)
    _hook(draft, form, neck, t)
    nut = draft.part()
    nut.add_lathe("dark", [(0, 0), (0.42 * r, 0), (0.42 * r, 0.45 * r), (0, 0.45 * r)], sides=16)
    draft.solid(nut, STEEL, turned("y", np.pi / 2), (neck - 0.05 * r, 0.5 * r, 0))


def _hook(draft: Draft, form: WrenchForm, neck: float, t: float) -> None:
    r, gap = form.head_m, form.head_m * float(draft.rng.uniform(0.25, 0.75))
    far, top = neck + 1.75 * r + gap, 0.9 * r
    outline = [(neck - 0.9 * r, 0.35 * r), (neck - 0.9 * r, 0.7 * r), (far + 0.1 * r, top), (far + 0.65 * r, 0.5 * r)]
    outline += [(far + 0.5 * r, -0.7 * r), (far, -0.85 * r), (far, 0.1 * r), (far - 0.15 * r, 0.35 * r)]
    hook = draft.part()
    add_extruded(hook, "jaw" if form.finish == "painted" else "steel", outline, -t * 0.8, t * 0.8, bevel=t * 0.25)
    draft.solid(hook, STEEL)
    teeth = draft.part()
    for k in range(7):
        y = -0.75 * r + k * 0.12 * r
        for x, way in ((neck + 1.75 * r, 1), (far, -1)):
            add_extruded(
                teeth, "dark", [(x, y), (x + way * 0.06 * r, y + 0.05 * r), (x, y + 0.1 * r)], -t * 0.78, t * 0.78
            )
    draft.look(teeth)
