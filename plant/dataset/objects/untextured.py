"""Things as a simulator's user models them: in plain colours, without labels or wear, the classes of a few solids.

Models that others made are often no more than that, and a detector that has only seen detailed ones takes them for
something else.
"""

from __future__ import annotations

import colorsys
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from plant.dataset.objects.draft import (
    ALUMINIUM,
    FLESH,
    GLASS,
    PLASTIC,
    RUBBER,
    STEEL,
    UP_TO_X,
    WOOD,
    Draft,
    Finished,
    pick,
    turned,
    varied,
)
from plant.dataset.objects.solids import COLOURS, add_drum, add_rod, paint_grey, paint_plain, some_shine
from plant.models.builder.mesh import Mesh
from plant.models.builder.outlines import arc
from plant.models.builder.surfaces import add_ellipsoid, add_extruded, add_ring, add_tube
from skills.robot import FloatArray

__all__ = ["UNTEXTURED_MAKERS"]

Maker = Callable[[Draft], tuple[Finished, str, str]]

KIND = "untextured"
_ALONG_Y = turned("x", -np.pi / 2)


def _patch(part: Mesh, material: str, radius: float, z_m: tuple[float, float], about_deg: tuple[float, float]) -> None:
    """A label on a cylinder along z: over these heights, from one angle about it to another."""
    outer = arc((0, 0), radius * 1.006, about_deg[0], about_deg[1], 16)
    inner = arc((0, 0), radius * 0.99, about_deg[1], about_deg[0], 16)
    add_extruded(part, material, np.concatenate([outer, inner]), *z_m)


def hammer(draft: Draft) -> tuple[Finished, str, str]:
    """A handle along x, and across its +x end a block, a drum, one with larger ends, or a block with a wedge or claw.

    The handle is of one piece, or a grip on a shaft of the head's colour.
    """
    rng = draft.rng
    half, thick = float(rng.uniform(0.11, 0.20)), float(rng.uniform(0.008, 0.021))
    reach = float(rng.uniform(0.035, 0.075))
    wide = float(np.clip(rng.uniform(0.25, 0.55) * reach, 0.011, 0.04))
    word = paint_plain(draft)
    paint_grey(draft, "head")
    if rng.random() < 0.15:
        paint_plain(draft, "head")
    x = half - wide
    if rng.random() < 0.35:
        grip = half * float(rng.uniform(-0.5, 0.35))
        add_rod(draft, "colour", -half, grip, thick, RUBBER)
        add_rod(draft, "head", grip, x, thick * float(rng.uniform(0.45, 0.9)), STEEL * 0.6)
    else:
        add_rod(draft, "colour", -half, x if rng.random() < 0.7 else half + wide, thick, WOOD)
    for part, R in _hammer_head(draft, reach, wide):
        draft.solid(part, STEEL * 0.6, R, (x, 0, 0))
    draft.collide_box((-half, -thick, -thick), (x, thick, thick))
    draft.collide_box((x - wide, -reach, -wide), (x + wide, reach, wide))
    return draft.finish(), KIND, word


def _hammer_head(draft: Draft, reach: float, wide: float) -> list[tuple[Mesh, FloatArray]]:
    """Parts of a head about the origin, each with its turn."""
    rng, part = draft.rng, draft.part()
    style = str(rng.choice(["block", "drum", "ends", "wedge", "ball", "claw"], p=[0.18, 0.17, 0.2, 0.12, 0.1, 0.23]))
    if style == "block":
        part.add_box("head", (-wide, -reach, -wide), (wide, reach, wide))
        return [(part, np.eye(3))]
    if style == "wedge":
        part.add_box("head", (-wide, -reach * 0.3, -wide), (wide, reach, wide))
        claw = draft.part()
        outline = [(wide, -reach * 0.3), (-wide, -reach * 0.3), (-wide * rng.uniform(0.5, 1.6), -reach), (0.0, -reach)]
        add_extruded(claw, "head", outline, -wide, wide)
        return [(part, np.eye(3)), (claw, np.eye(3))]
    if style == "claw":
        return _clawed(draft, reach, wide)
    neck = 1.0 if style == "drum" else float(rng.uniform(0.45, 0.8))
    add_drum(part, "head", wide * neck, -reach, reach)
    if style == "ball":
        add_ellipsoid(part, "head", (0, 0, -reach), (wide * 1.1,) * 3)
    if style in ("ends", "ball"):
        add_drum(part, "head", wide * 1.1, reach * float(rng.uniform(0.45, 0.75)), reach * 1.02)
    if style == "ends":
        add_drum(part, "head", wide * 1.1, -reach * 1.02, -reach * float(rng.uniform(0.45, 0.75)))
    return [(part, _ALONG_Y)]


def _clawed(draft: Draft, reach: float, wide: float) -> list[tuple[Mesh, FloatArray]]:
    """A drum to the +y side, and to the other two bent prongs, side by side, that grow thin."""
    rng, face, level = draft.rng, draft.part(), np.eye(3)
    wide = min(wide, 0.02)
    add_drum(face, "head", wide * float(rng.uniform(0.8, 1.1)), reach * 0.35, reach)
    add_drum(face, "head", wide * float(rng.uniform(0.5, 0.8)), -0.2 * reach, reach * 0.36)
    bend, parts = float(rng.uniform(0.1, 0.6)) * reach, [(face, _ALONG_Y)]
    along = np.linspace(0.0, 1.0, 9)
    y, x = -reach * (0.1 + 0.9 * along), -bend * along**2
    thick = wide * (0.75 - 0.6 * along)
    outline = np.concatenate([np.stack([x + thick, y], axis=1), np.stack([x - thick, y], axis=1)[::-1]])
    gap = wide * float(rng.uniform(0.05, 0.3))
    for low, high in ((-wide, -gap), (gap, wide)):
        prong = draft.part()
        add_extruded(prong, "head", outline, low, high)
        parts.append((prong, level))
    return parts


def screwdriver(draft: Draft) -> tuple[Finished, str, str]:
    """A thick rod, a thin one, and a flat or pointed tip at the +x end."""
    rng = draft.rng
    handle, radius = float(rng.uniform(0.06, 0.13)), float(rng.uniform(0.009, 0.019))
    shaft, thin = float(rng.uniform(0.05, 0.20)), float(rng.uniform(0.0022, 0.005))
    word = paint_plain(draft)
    paint_grey(draft, "steel")
    start = -(handle + shaft) / 2
    add_rod(draft, "colour", start, start + handle, radius, PLASTIC)
    part, end = draft.part(), start + handle + shaft
    add_drum(part, "steel", thin, start + handle, end, sides=16)
    if rng.random() < 0.5:
        part.add_lathe("steel", [(0, end), (thin, end), (thin * 0.2, end + 3 * thin)], sides=16)
    draft.solid(part, STEEL, UP_TO_X)
    if rng.random() < 0.4:
        blade = draft.part()
        blade.add_box("steel", (end, -1.5 * thin, -0.3 * thin), (end + 4 * thin, 1.5 * thin, 0.3 * thin))
        draft.solid(blade, STEEL)
    draft.collide_along_x(radius, start, start + handle)
    draft.collide_along_x(thin, start + handle, end)
    return draft.finish(), KIND, word


def wrench(draft: Draft) -> tuple[Finished, str, str]:
    """A flat bar with a fork at one end, and a fork, a ring or nothing at the other."""
    rng = draft.rng
    half, thick = float(rng.uniform(0.06, 0.15)), float(rng.uniform(0.002, 0.005))
    head = half * float(rng.uniform(0.15, 0.24))
    bar = head * float(rng.uniform(0.3, 0.5))
    paint_grey(draft, "steel")
    word = "grey"
    if rng.random() < 0.25:
        word = paint_plain(draft, "steel")
    shaft = draft.part()
    shaft.add_box("steel", (-half + head, -bar, -thick), (half - 1.5 * head, bar, thick))
    draft.solid(shaft, STEEL)
    other = str(rng.choice(["fork", "ring", "none"], p=[0.35, 0.5, 0.15]))
    _fork(draft, half - head, 1.0, head, thick)
    if other == "fork":
        _fork(draft, -half + head, -1.0, head * 0.9, thick)
    if other == "ring":
        ring = draft.part()
        add_ring(ring, "steel", head * 0.55, head * 0.95, -thick, thick)
        draft.solid(ring, STEEL, p=(-half + head * 0.9, 0, 0))
    draft.collide_box((-half, -bar, -thick), (half, bar, thick))
    draft.collide_box((half - 2 * head, -head, -thick), (half, head, thick))
    return draft.finish(), KIND, word


def _fork(draft: Draft, x: float, way: float, head: float, thick: float) -> None:
    """Two prongs on a block, or a disc with a notch; it opens along x, to the side of `way`."""
    part, gap = draft.part(), head * float(draft.rng.uniform(0.4, 0.6))
    if draft.rng.random() < 0.5:
        part.add_box("steel", (-head, -head, -thick), (-0.3 * head, head, thick))
        for side in (-1, 1):
            low, high = sorted((side * gap, side * head))
            part.add_box("steel", (-0.3 * head, low, -thick), (head, high, thick))
    else:
        mouth = [(0.9 * head, -gap), (-0.2 * head, -gap), (-0.2 * head, gap), (0.9 * head, gap)]
        add_extruded(part, "steel", np.concatenate([arc((0, 0), head, 40, 320, 22), mouth]), -thick, thick)
    lean = np.radians(float(draft.rng.choice([0.0, 0.0, 15.0, -15.0])))
    draft.solid(part, STEEL, turned("z", lean + (np.pi if way < 0 else 0.0)), (x, 0, 0))


def extinguisher(draft: Draft) -> tuple[Finished, str, str]:
    """A red cylinder with a dome, a neck, a black handle, and sometimes a hose, a horn or a band."""
    rng = draft.rng
    r = float(rng.uniform(0.045, 0.095))
    h = r * float(rng.uniform(3.4, 5.6))
    draft.paint(
        "red",
        varied(rng, pick(rng, (0.80, 0.05, 0.04), (0.90, 0.03, 0.03), (0.62, 0.04, 0.05))),
        shine=some_shine(draft),
    )
    draft.paint("black", varied(rng, (0.07, 0.07, 0.07)), shine=some_shine(draft))
    draft.paint("band", pick(rng, (0.93, 0.93, 0.92), (0.95, 0.85, 0.3), (0.1, 0.2, 0.65), (0.08, 0.08, 0.08)))
    vessel, dome = draft.part(), r * float(rng.uniform(0.3, 1.0))
    add_drum(vessel, "red", r, 0.0, h - dome, sides=40)
    if rng.random() < 0.7:
        add_ellipsoid(vessel, "red", (0, 0, h - dome), (r, r, dome), sides=28)
    else:
        vessel.add_lathe("red", [(r, h - dome), (0.25 * r, h)], sides=40)
    draft.solid(vessel, STEEL * 0.3)
    top = h + float(rng.uniform(0.04, 0.08))
    draft.solid(_valve(draft, r, h, top), STEEL * 0.5)
    if rng.random() < 0.6:
        low, high = sorted(rng.uniform(0.15, 0.75, 2) * (h - dome))
        band = draft.part()
        band.add_lathe("band", [(r * 1.004, low), (r * 1.004, max(high, low + 0.04))], sides=40)
        draft.look(band)
    if rng.random() < 0.6:
        hose = draft.part()
        y, low = r * float(rng.uniform(-0.4, 0.4)), h * float(rng.uniform(0.1, 0.6))
        points = [(0, 0, h + 0.02), (-r * 0.8, y, h + 0.02), (-r * 1.2, y, h * 0.85), (-r * 1.15, y, low)]
        add_tube(hose, "black", points, float(rng.uniform(0.007, 0.014)), sides=12)
        if rng.random() < 0.4:
            add_tube(hose, "black", [(-r * 1.15, y, low + 0.01), (-r * 1.2, y, low - 0.10)], [0.012, 0.035], sides=16)
        draft.solid(hose, RUBBER * 0.5)
    draft.collide_upright(r, 0.0, h)
    draft.collide_box((-0.03, -0.015, h), (0.06, 0.015, top))
    return draft.finish(), KIND, "red"


def _valve(draft: Draft, r: float, h: float, top: float) -> Mesh:
    part, rng = draft.part(), draft.rng
    add_drum(part, "black", r * 0.25, h - 0.02, top - 0.02, sides=20)
    length = r * float(rng.uniform(0.8, 1.5))
    part.add_box("black", (-r * 0.3, -0.012, top - 0.02), (length, 0.012, top))
    if rng.random() < 0.6:
        part.add_box("black", (0.0, -0.011, top - 0.045), (length * 0.9, 0.011, top - 0.032))
    return part


def beer(draft: Draft) -> tuple[Finished, str, str]:
    """A bottle of brown or green glass, bare or with a plain label, with or without a cap."""
    rng = draft.rng
    word, glass = ("green", (0.06, 0.28, 0.10)) if rng.random() < 0.35 else ("brown", (0.30, 0.15, 0.05))
    draft.paint("glass", varied(rng, np.array(glass) * rng.uniform(0.5, 1.3), 0.05), shine=some_shine(draft))
    draft.paint(
        "label", pick(rng, (0.94, 0.93, 0.9), (0.9, 0.8, 0.4), (0.75, 0.1, 0.1), (0.1, 0.3, 0.15), (0.1, 0.15, 0.4))
    )
    draft.paint("cap", pick(rng, (0.75, 0.62, 0.2), (0.75, 0.75, 0.77), (0.7, 0.1, 0.1), (0.08, 0.08, 0.08)))
    r, h = float(rng.uniform(0.028, 0.037)), float(rng.uniform(0.19, 0.27))
    mouth = r * float(rng.uniform(0.35, 0.45))
    shoulder, neck = float(rng.uniform(0.5, 0.66)), float(rng.uniform(0.7, 0.8))
    part = draft.part()
    part.add_lathe("glass", [(0, 0), (r, 0), (r, shoulder * h), (mouth, neck * h), (mouth, h), (0, h)], sides=32)
    draft.solid(part, 0.5 * GLASS)
    looks = draft.part()
    low = float(rng.uniform(0.08, 0.25)) * h
    if (label := rng.random()) < 0.55:
        looks.add_lathe("label", [(r * 1.006, low), (r * 1.006, (shoulder - 0.06) * h)], sides=32)
    elif label < 0.75:
        wide = float(rng.uniform(40, 110))
        _patch(looks, "label", r, (low, (shoulder - 0.06) * h), (-wide, wide))
    if rng.random() < 0.6:
        looks.add_lathe("cap", [(mouth * 1.12, h - 0.008), (mouth * 1.12, h + 0.001), (0, h + 0.001)], sides=24)
    draft.look(looks)
    draft.collide_upright(r, 0.0, shoulder * h)
    draft.collide_upright(mouth, shoulder * h, h)
    return draft.finish(), KIND, word


def coke(draft: Draft) -> tuple[Finished, str, str]:
    """A red can with a white stripe or patch, seldom with bare ends alone, or a dark bottle with red label and cap."""
    rng = draft.rng
    draft.paint(
        "red",
        varied(rng, pick(rng, (0.82, 0.03, 0.05), (0.9, 0.05, 0.04), (0.70, 0.02, 0.04))),
        shine=some_shine(draft),
    )
    draft.paint("white", (0.95, 0.95, 0.94))
    draft.paint("metal", varied(rng, (0.74, 0.75, 0.77), 0.04), shine=0.6)
    draft.paint("cola", (0.12, 0.05, 0.03), shine=0.5)
    if rng.random() < 0.3:
        return _cola_bottle(draft), KIND, "red"
    r, h = float(rng.uniform(0.028, 0.034)), float(rng.uniform(0.10, 0.16))
    bare = rng.random() < 0.12
    part, ends = draft.part(), 0.06 * h if bare else float(rng.choice([0.0, 0.03, 0.06])) * h
    edge = r * float(rng.uniform(0.8, 0.9 if bare else 1.0))
    rim = "metal" if bare or rng.random() < 0.75 else "red"
    part.add_lathe(rim, [(0, 0), (edge, 0), (r, ends + 1e-4)], sides=36)
    part.add_lathe("red", [(r, ends + 1e-4), (r, h - ends - 1e-4)], sides=36)
    part.add_lathe(rim, [(r, h - ends - 1e-4), (edge, h), (0, h)], sides=36)
    draft.solid(part, 0.4 * ALUMINIUM)
    if not bare:
        low, tall = float(rng.uniform(0.2, 0.6)), float(rng.uniform(0.06, 0.25))
        stripe = draft.part()
        if rng.random() < 0.6:
            stripe.add_lathe("white", [(r * 1.005, low * h), (r * 1.005, (low + tall) * h)], sides=36)
        else:
            wide, heights = float(rng.uniform(15, 70)), (0.12 * h, float(rng.uniform(0.5, 0.88)) * h)
            for middle in (0.0, 180.0):
                _patch(stripe, "white", r, heights, (middle - wide, middle + wide))
        draft.look(stripe)
    draft.collide_upright(r, 0.0, h)
    return draft.finish(), KIND, "red"


def _cola_bottle(draft: Draft) -> Finished:
    rng = draft.rng
    r, h = float(rng.uniform(0.03, 0.042)), float(rng.uniform(0.2, 0.3))
    part, low = draft.part(), float(rng.uniform(0.3, 0.4))
    part.add_lathe(
        "cola", [(0, 0), (r, 0), (r, 0.68 * h), (0.013, 0.88 * h), (0.013, 0.96 * h), (0, 0.96 * h)], sides=32
    )
    draft.solid(part, PLASTIC)
    looks = draft.part()
    looks.add_lathe("red", [(r * 1.006, low * h), (r * 1.006, (low + 0.22) * h)], sides=32)
    add_drum(looks, "red" if rng.random() < 0.8 else "white", 0.015, 0.94 * h, h, sides=20)
    draft.look(looks)
    draft.collide_upright(r, 0.0, 0.7 * h)
    draft.collide_upright(0.015, 0.7 * h, h)
    return draft.finish()


def person(draft: Draft) -> tuple[Finished, str, str]:
    """A standing figure of capsules, balls and boxes, which looks along x; the origin is on the floor."""
    rng, h = draft.rng, float(draft.rng.uniform(1.5, 1.95))
    word = paint_plain(draft, "top")
    paint_plain(draft, "bottom")
    draft.paint("skin", varied(rng, pick(rng, (0.9, 0.72, 0.6), (0.7, 0.5, 0.36), (0.4, 0.26, 0.18), (0.8, 0.8, 0.8))))
    draft.paint("dark", pick(rng, (0.07, 0.06, 0.05), (0.3, 0.2, 0.1), (0.6, 0.45, 0.2)))
    part, wide = draft.part(), h * float(rng.uniform(0.10, 0.135))
    if rng.random() < 0.4:
        part.add_box("top", (-0.5 * wide, -wide, 0.5 * h), (0.5 * wide, wide, 0.83 * h))
    else:
        add_ellipsoid(part, "top", (0, 0, 0.665 * h), (0.65 * wide, wide, 0.19 * h))
    head = 0.062 * h
    _capsule(part, "skin", (0, 0, 0.8 * h), (0, 0, 0.88 * h), 0.03 * h)
    add_ellipsoid(part, "skin", (0, 0, h - 1.15 * head), (head, 0.85 * head, 1.15 * head))
    if rng.random() < 0.7:
        add_ellipsoid(part, "dark", (-0.2 * head, 0, h - 0.75 * head), (head, 0.95 * head, 0.85 * head))
    bare = "skin" if rng.random() < 0.4 else "top"
    for side in (-1, 1):
        swing, out = rng.uniform(-0.12, 0.12, 2) * h, float(rng.uniform(0.02, 0.12)) * h
        shoulder = np.array([0, side * wide * 1.05, 0.79 * h])
        elbow = shoulder + [swing[0] * 0.5, side * out * 0.7, -0.16 * h]
        wrist = elbow + [swing[0] + 0.02 * h, side * out * 0.1, -0.14 * h]
        _capsule(part, "top", shoulder, elbow, 0.03 * h)
        _capsule(part, bare, elbow, wrist, 0.025 * h)
        add_ellipsoid(part, "skin", wrist, (0.028 * h, 0.022 * h, 0.04 * h))
        foot = np.array([swing[1], side * wide * 0.55, 0.03 * h])
        _capsule(
            part, "bottom", (0, side * wide * 0.5, 0.5 * h), (swing[1] * 0.5, side * wide * 0.55, 0.27 * h), 0.05 * h
        )
        _capsule(part, "bottom", (swing[1] * 0.5, side * wide * 0.55, 0.27 * h), foot + [0, 0, 0.02 * h], 0.038 * h)
        part.add_box("dark", foot - [0.04 * h, 0.025 * h, 0.03 * h], foot + [0.1 * h, 0.025 * h, 0.015 * h])
    draft.solid(part, FLESH)
    draft.collide_upright(wide * 1.3, 0.0, h)
    return draft.finish(float(22.0 * h * h), on_floor=True), KIND, word


def _capsule(part: Mesh, material: str, low: ArrayLike, high: ArrayLike, radius: float) -> None:
    a, b = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    add_tube(part, material, [a, (a + b) / 2, b], radius, sides=14)
    for end in (a, b):
        add_ellipsoid(part, material, end, (radius,) * 3, sides=14)


def _block_colour(draft: Draft) -> str:
    """A plain colour of any hue, or half the time black, white or grey."""
    rng = draft.rng
    if rng.random() < 0.5:
        word, tone = (("black", 0.06), ("white", 0.93), ("grey", float(rng.uniform(0.2, 0.8))))[int(rng.integers(3))]
        draft.paint("colour", varied(rng, (tone, tone, tone), 0.04), shine=some_shine(draft))
        return word
    hue, value = float(rng.random()), float(rng.uniform(0.3, 0.95))
    colour = colorsys.hsv_to_rgb(hue, float(rng.uniform(0.5, 1.0)), value)
    draft.paint("colour", colour, shine=some_shine(draft))
    return min(COLOURS, key=lambda each: float(np.sum((np.array(each[1]) - np.array(colour)) ** 2)))[0]


def cube(draft: Draft) -> tuple[Finished, str, str]:
    """A cube of one colour with sharp edges."""
    word, half = _block_colour(draft), float(np.exp(draft.rng.uniform(np.log(0.015), np.log(0.11))))
    part = draft.part()
    part.add_box("colour", (-half,) * 3, (half,) * 3)
    draft.solid(part, 500.0)
    return draft.finish(), KIND, word


def cylinder(draft: Draft) -> tuple[Finished, str, str]:
    """A cylinder of one colour with sharp edges."""
    rng, word = draft.rng, _block_colour(draft)
    radius = float(np.exp(rng.uniform(np.log(0.015), np.log(0.075))))
    half = min(0.40, max(0.03, radius * float(np.exp(rng.uniform(np.log(0.9), np.log(8.0)))))) / 2
    part = draft.part()
    add_drum(part, "colour", radius, -half, half, sides=40)
    draft.solid(part, 500.0)
    draft.collide_upright(radius, -half, half)
    return draft.finish(), KIND, word


UNTEXTURED_MAKERS: Mapping[str, Maker] = {
    "beer": beer,
    "coke": coke,
    "extinguisher": extinguisher,
    "hammer": hammer,
    "screwdriver": screwdriver,
    "wrench": wrench,
    "person": person,
    "cylinder": cylinder,
    "cube": cube,
}
"""Makers by class."""
