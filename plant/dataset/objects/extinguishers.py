"""Fire extinguishers: powder, foam and water with a hose, carbon dioxide with a horn. They stand on z = 0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from plant.dataset.objects.draft import RUBBER, STEEL, Draft, Finished, pick, shade, turned
from plant.dataset.objects.lettering import bar_code, blend, brand, emblem, small_print, write_tall, write_word
from plant.dataset.objects.wear import dirty, plain, used
from plant.models.builder.mesh import Mesh
from plant.models.builder.outlines import curve
from plant.models.builder.surfaces import add_rounded_box, add_tube
from skills.robot import FloatArray


@dataclass(frozen=True)
class ExtinguisherForm:
    """Kind, radius and height of the cylinder (m), hose or short nozzle, base ring, wear 0..1."""

    kind: str
    radius_m: float
    height_m: float
    hose: bool
    base: bool
    wear: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Self:
        """From the 1 kg bottle in a car to the 12 kg one in a hall."""
        kind = str(rng.choice(["powder", "foam", "carbon dioxide", "water"], p=[0.5, 0.18, 0.24, 0.08]))
        size = float(rng.uniform(0, 1))
        slim = 0.82 if kind == "carbon dioxide" else 1.0
        radius = (0.042 + 0.055 * size) * slim * float(rng.uniform(0.95, 1.05))
        height = (0.22 + 0.30 * size) * (1.12 if kind == "carbon dioxide" else 1.0) * float(rng.uniform(0.93, 1.07))
        return cls(kind, radius, height, size > 0.18, bool(rng.random() < 0.35), float(rng.uniform(0, 0.6)))


def extinguisher(draft: Draft) -> tuple[Finished, str, str]:
    """An extinguisher of any kind."""
    rng = draft.rng
    form = ExtinguisherForm.drawn(rng)
    colour = _materials(draft, form)
    _vessel(draft, form)
    _valve(draft, form)
    if form.kind == "carbon dioxide":
        _horn(draft, form)
    else:
        _hose(draft, form)
    draft.collide_upright(form.radius_m, 0.0, form.height_m)
    top = form.height_m + 0.07
    draft.collide_box((-0.03, -0.015, form.height_m), (0.07, 0.015, top))
    return draft.finish(), form.kind, colour


def _materials(draft: Draft, form: ExtinguisherForm) -> str:
    rng = draft.rng
    colour, red = "red", shade(rng, pick(rng, (0.80, 0.05, 0.04), (0.70, 0.04, 0.05), (0.88, 0.10, 0.05)), 0.04)
    if form.kind == "water" and rng.random() < 0.6:
        colour, red = "silver", np.array([0.76, 0.77, 0.78])
    body = dirty(used(plain(red, (128, 256)), rng, form.wear * 0.6, (0.9, 0.8, 0.8)), rng, form.wear * 0.3)
    metal = float(colour == "silver")
    draft.picture("body", body, shine=0.6, metal=metal)
    draft.picture("label", _label(rng, form, red), shine=0.45)
    draft.picture("black", used(plain(shade(rng, (0.08, 0.08, 0.09))), rng, form.wear * 0.3), shine=0.25)
    draft.paint("brass", shade(rng, pick(rng, (0.75, 0.60, 0.25), (0.65, 0.66, 0.68))), shine=0.7, metal=1.0)
    draft.paint(
        "lever",
        shade(rng, pick(rng, (0.1, 0.1, 0.1), (0.72, 0.73, 0.75), (0.78, 0.06, 0.05), (0.15, 0.15, 0.16))),
        shine=0.4,
    )
    draft.paint("gauge", (0.93, 0.93, 0.92))
    draft.picture("dial", _dial())
    draft.paint("pin", shade(rng, pick(rng, (0.75, 0.75, 0.77), (0.9, 0.75, 0.1), (0.2, 0.5, 0.9))), shine=0.6)
    return colour


def _label(rng: np.random.Generator, form: ExtinguisherForm, red: FloatArray) -> FloatArray:
    """The middle of the vessel: instructions in front, the rest bare."""
    image = plain(red, (256, 512))
    paper = pick(rng, (0.94, 0.93, 0.90), (0.95, 0.90, 0.60), (0.94, 0.94, 0.94), (0.9, 0.9, 0.92))
    bands = {
        "powder": (0.10, 0.25, 0.70),
        "foam": (0.93, 0.86, 0.68),
        "carbon dioxide": (0.06, 0.06, 0.06),
        "water": (0.8, 0.06, 0.05),
    }
    left, right = (0.18, 0.82) if rng.random() < 0.7 else (0.05, 0.95)
    columns = slice(int(512 * left), int(512 * right))
    image[10:246, columns] = paper
    if rng.random() < 0.6:
        image[16:52, columns] = bands[form.kind]
    word = {"powder": "POWDER", "foam": "FOAM", "carbon dioxide": "CO2", "water": "WATER"}[form.kind]
    ink = (0.75, 0.05, 0.05) if rng.random() < 0.5 else (0.08, 0.08, 0.1)
    for middle in (0.34, 0.66) if rng.random() < 0.6 else (0.5,):
        write_word(image, "FIRE" if rng.random() < 0.7 else brand(rng), (0.22, middle - 0.13, 0.34, middle + 0.13), ink)
        write_word(
            image, str(rng.choice(["EXTINGUISHER", word, word])), (0.35, middle - 0.13, 0.46, middle + 0.13), ink
        )
        _pictograms(image, rng, middle)
        small_print(image, rng, (0.7, middle - 0.12, 0.9, middle + 0.12), (0.15, 0.15, 0.15))
    if rng.random() < 0.3:
        write_tall(image, "FIRE", (0.05, 0.0, 0.95, 0.05), (0.95, 0.95, 0.95), 0)
    bar_code(image, rng, (0.75, 0.72, 0.9, 0.78))
    return image


def _pictograms(image: FloatArray, rng: np.random.Generator, middle: float) -> None:
    for k, letter in enumerate("ABC"):
        row, column = 124, int(512 * (middle - 0.12) + k * 42)
        image[row : row + 36, column : column + 36] = (0.78, 0.08, 0.06) if k % 2 == 0 else (0.12, 0.3, 0.65)
        blend(image, emblem((26, 26), int(rng.choice([5, 6, 3])), rng), (0.96, 0.96, 0.96), (row + 5, column + 5))
        write_word(
            image, letter, ((row + 18) / 256, (column + 20) / 512, (row + 36) / 256, (column + 36) / 512), (1, 1, 1)
        )


def _dial() -> FloatArray:
    """Green and red sectors, a needle."""
    rows, columns = np.indices((64, 64)) - 31.5
    angle, radius = np.arctan2(columns, -rows), np.hypot(rows, columns)
    image = plain((0.93, 0.93, 0.92), (64, 64))
    band = (radius > 16) & (radius < 27)
    image[band & (np.abs(angle) < 0.6)] = (0.1, 0.6, 0.2)
    image[band & (np.abs(angle) >= 0.6) & (np.abs(angle) < 2.1)] = (0.8, 0.1, 0.1)
    image[(np.abs(columns) < 1.5) & (rows < 4) & (rows > -24)] = 0.05
    return image


def _vessel(draft: Draft, form: ExtinguisherForm) -> None:
    r, h = form.radius_m, form.height_m
    part = draft.part()
    round_ = 0.035 if form.kind == "carbon dioxide" else 0.022
    foot = 0.02 if form.base else 0.0
    bottom = [(0, foot + 0.004), (r * 0.7, foot), (r * 0.93, foot + 0.006), (r, foot + 0.02), (r, 0.24 * h)]
    part.add_lathe("body", bottom, sides=40)
    part.add_lathe("label", [(r, 0.24 * h), (r, 0.72 * h)], sides=40)
    dome = [
        (r, 0.72 * h),
        (r, h - round_ - 0.02),
        (r * 0.94, h - round_),
        (r * 0.72, h - 0.010),
        (r * 0.4, h),
        (0.016, h + 0.006),
    ]
    part.add_lathe("body", [(float(a), float(b)) for a, b in curve(dome, 4)], sides=40)
    part.add_lathe("body", [(0.016, h + 0.006), (0, h + 0.006)], sides=20)
    draft.shell(part, STEEL * (0.005 if form.kind == "carbon dioxide" else 0.0016))
    filling = draft.part()
    filling.add_lathe("body", [(0, 0.01), (r - 0.003, 0.012), (r - 0.003, 0.75 * h), (0, 0.75 * h)], sides=20)
    draft.content(filling, {"powder": 900.0, "carbon dioxide": 700.0}.get(form.kind, 1000.0))
    if form.base:
        ring = draft.part()
        ring.add_lathe("black", [(0, 0), (r * 1.03, 0), (r * 1.03, 0.035), (r * 0.98, 0.04), (0, 0.04)], sides=36)
        draft.look(ring)


def _valve(draft: Draft, form: ExtinguisherForm) -> None:
    """Neck, two levers, safety pin with its ring, gauge."""
    h = form.height_m + 0.004
    part = draft.part()
    part.add_lathe(
        "brass",
        [(0, h), (0.015, h), (0.015, h + 0.012), (0.012, h + 0.014), (0.012, h + 0.035), (0, h + 0.035)],
        sides=16,
    )
    draft.solid(part, 4000.0)
    levers = draft.part()
    reach = float(draft.rng.uniform(0.08, 0.115))
    for low, lift, thick in ((h + 0.026, 0.006, 0.007), (h + 0.044, 0.03, 0.006)):
        path = curve(
            [(-0.02, 0, low), (0.02, 0, low + 0.002), (reach * 0.7, 0, low + lift), (reach, 0, low + lift - 0.004)], 5
        )
        add_tube(
            levers,
            "lever",
            path,
            np.column_stack([np.full(len(path), thick * 0.5), np.full(len(path), 0.011)]),
            sides=12,
            up=(0, 0, 1),
        )
    add_rounded_box(levers, "lever", (-0.022, -0.012, h + 0.02), (0.012, 0.012, h + 0.052), 0.004)
    draft.solid(levers, 3500.0)
    trim = draft.part()
    ring = np.stack(
        [0.012 * np.cos(a := np.linspace(0, 2 * np.pi, 17)), 0 * a - 0.02, h + 0.034 + 0.012 * np.sin(a)], axis=1
    )
    add_tube(trim, "pin", ring, np.full(17, 0.0014), sides=6, caps=False)
    draft.look(trim)
    if form.kind != "carbon dioxide":
        _gauge(draft, h + 0.018)


def _gauge(draft: Draft, z: float) -> None:
    part = draft.part()
    r = float(draft.rng.uniform(0.012, 0.016))
    part.add_lathe("brass", [(0, 0), (r * 0.4, 0), (r * 0.4, 0.012), (r, 0.013), (r, 0.02)], sides=20)
    draft.look(part, turned("x", np.pi / 2), (0, -0.010, z))
    from_front = draft.part()
    from_front.add_rectangle("dial", (-r * 0.8, -0.0305, z - r * 0.8), (r * 1.6, 0, 0), (0, 0, r * 1.6))
    draft.look(from_front)


def _hose(draft: Draft, form: ExtinguisherForm) -> None:
    r, h, rng = form.radius_m, form.height_m, draft.rng
    part = draft.part()
    if not form.hose:
        add_tube(part, "black", [(-0.012, 0, h + 0.026), (-0.05, 0, h + 0.030)], [0.007, 0.010], sides=12)
        draft.solid(part, RUBBER)
        return
    thick, low = float(rng.uniform(0.007, 0.010)), float(rng.uniform(0.12, 0.5)) * h
    side = float(rng.choice([-1, 1]))
    y = side * r * float(rng.uniform(0.0, 0.5))
    out = r + thick + 0.002
    points = [
        (-0.012, 0, h + 0.028),
        (-0.05, y * 0.3, h + 0.03),
        (-out - 0.012, y * 0.7, h - 0.03),
        (-out, y, 0.72 * h),
        (-out, y, low + 0.09),
    ]
    add_tube(part, "black", curve(points, 7), thick, sides=12)
    _nozzle(part, np.array([-out, y, low]), thick)
    draft.solid(part, RUBBER)
    strap = draft.part()
    strap.add_lathe("black", [(r + 0.001, low + 0.05), (r + 0.002, low + 0.065)], sides=36)
    draft.look(strap)


def _nozzle(part: Mesh, at: FloatArray, thick: float) -> None:
    heights = [0.10, 0.08, 0.03, 0.0]
    add_tube(
        part,
        "black",
        [at + [0, 0, z] for z in heights],
        [thick * 1.25, thick * 1.35, thick * 1.0, thick * 1.5],
        sides=14,
    )


def _horn(draft: Draft, form: ExtinguisherForm) -> None:
    """A black horn, on a swivel arm or on a hose beside the vessel."""
    r, h, rng = form.radius_m, form.height_m, draft.rng
    part = draft.part()
    length, wide = float(rng.uniform(0.16, 0.24)), float(rng.uniform(0.03, 0.042))
    if rng.random() < 0.5:
        down = float(rng.uniform(0.2, 1.25))
        start = np.array([-0.012, 0, h + 0.028])
        elbow = start + [-0.03, 0, 0.01]
        way = np.array([-np.cos(down), 0, -np.sin(down)])
        shift = np.array([-max(0.0, r - 0.02) * np.sin(down), 0, 0])
        add_tube(part, "black", [start, elbow + shift, elbow + shift + way * 0.05], [0.008] * 3, sides=10)
        tip = elbow + shift + way * 0.05
    else:
        out = r + wide * 0.8
        add_tube(
            part,
            "black",
            curve([(-0.012, 0, h + 0.028), (-0.06, 0, h + 0.04), (-out - 0.02, 0, h - 0.03), (-out, 0, 0.75 * h)], 7),
            0.008,
            sides=10,
        )
        tip, way = np.array([-out, 0, 0.75 * h]), np.array([0.0, 0, -1.0])
        length = min(length, 0.6 * h)
    steps = [(0.0, 0.3), (0.25, 0.4), (0.3, 0.55), (0.6, 0.8), (1.0, 1.0)]
    add_tube(part, "black", [tip + way * s * length for s, _ in steps], [wide * w for _, w in steps], sides=20)
    draft.solid(part, RUBBER * 0.35)
