"""Coke and beer: cans and bottles with labels of our own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from plant.models.builder.mesh import Colour
from plant.models.builder.outlines import curve
from plant.models.builder.pictures import noise
from plant.models.families.draft import ALUMINIUM, GLASS, WATER, Draft, Finished, pick, shade, varied
from plant.models.families.lettering import (
    SCRIPT_FACES,
    bar_code,
    blend,
    brand,
    emblem,
    small_print,
    write_tall,
    write_word,
)
from plant.models.families.wear import plain, scratched, uneven

FloatArray = NDArray[np.float64]
Profile = list[tuple[float, float]]

LABEL_SHAPE = (256, 512)
WHITE: Colour = (0.96, 0.96, 0.95)
COLA_WORDS = ("COLA", "Cola", "Kola", "COKE", "Coke", "cola", "Coke", "Cola")


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


# --- coke ---


def coke(draft: Draft) -> tuple[Finished, str, str]:
    """A can, a plastic bottle or a small glass bottle of cola."""
    rng = draft.rng
    form = str(rng.choice(["can", "plastic bottle", "glass bottle"], p=[0.62, 0.24, 0.14]))
    scheme = int(rng.choice(4, p=[0.72, 0.12, 0.08, 0.08]))
    colours = (
        ("red", (0.80, 0.03, 0.05), WHITE),
        ("black", (0.07, 0.06, 0.07), (0.85, 0.06, 0.08)),
        ("silver", (0.80, 0.81, 0.83), (0.82, 0.05, 0.08)),
        ("white", (0.94, 0.94, 0.93), (0.80, 0.05, 0.07)),
    )
    name, base, ink = colours[scheme]
    ground = varied(rng, base)
    label = _cola_label(rng, ground, ink, wide=form == "can")
    if form == "can":
        return make_can(draft, Can.drawn(rng), label), form, name
    cap = ground if rng.random() < 0.8 else pick(rng, WHITE, (0.1, 0.1, 0.1), (0.8, 0.05, 0.05))
    brown = pick(rng, (0.13, 0.05, 0.03), (0.17, 0.07, 0.04), (0.10, 0.04, 0.03))
    bottle = _plastic_cola(rng) if form == "plastic bottle" else _glass_cola(rng)
    done = make_bottle(draft, bottle, label=label, neck=None, glass=brown, cap=cap, wide_cap=form == "plastic bottle")
    return done, form, name


def _cola_label(rng: np.random.Generator, ground: FloatArray | Colour, ink: Colour, *, wide: bool) -> FloatArray:
    image = plain(ground, LABEL_SHAPE)
    if rng.random() < 0.3:
        image *= np.linspace(1.08, 0.82, LABEL_SHAPE[0])[:, None, None]
    style = int(rng.integers(4))
    if style == 0:
        _wave(image, rng, ink)
    elif style == 1:
        _ribbon(image, rng, ink)
    elif style == 2:
        blend(image, emblem((170, 170), 0, rng) * 0.9, ink, (int(rng.integers(30, 60)), int(rng.integers(0, 60))))
    word, face = str(rng.choice(COLA_WORDS)), int(rng.choice(SCRIPT_FACES if rng.random() < 0.7 else (0, 1, 2)))
    top = float(rng.uniform(0.12, 0.4))
    for left in (0.03, 0.53):
        if (wide and rng.random() < 0.4) or rng.random() < 0.15:
            write_tall(image, word, (0.06, left + 0.12, 0.94, left + 0.34), ink, face)
        else:
            write_word(image, word, (top, left, top + 0.42, left + 0.44), ink, face=face)
    if rng.random() < 0.5:
        write_word(
            image,
            str(rng.choice(["ZERO", "light", "CLASSIC", "original taste", "CHERRY"])),
            (0.8, 0.08, 0.92, 0.4),
            ink,
        )
    write_word(image, str(rng.choice(["330 ml", "0.5 L", "12 FL OZ", "355 ml"])), (0.9, 0.44, 0.96, 0.54), ink)
    small_print(image, rng, (0.3, 0.9, 0.6, 0.99), np.array(ink) * 0.9)
    bar_code(image, rng, (0.65, 0.9, 0.85, 0.99))
    return image


def _wave(image: FloatArray, rng: np.random.Generator, ink: Colour) -> None:
    """A band in waves around the can."""
    height, width = image.shape[:2]
    rows, columns = np.indices((height, width))
    middle = height * (
        rng.uniform(0.55, 0.85) + rng.uniform(0.05, 0.16) * np.sin(columns * 4 * np.pi / width + rng.uniform(0, 6))
    )
    thick = height * rng.uniform(0.02, 0.06)
    blend(image, np.clip(thick - np.abs(rows - middle), 0, 1), ink)
    blend(image, 0.6 * np.clip(thick / 4 - np.abs(rows - middle - 1.7 * thick), 0, 1), ink)


def _ribbon(image: FloatArray, rng: np.random.Generator, ink: Colour) -> None:
    """A ribbon that runs up the can."""
    height, width = image.shape[:2]
    rows, columns = np.indices((height, width))
    across = (columns + width * 0.08 * np.sin(rows * 2 * np.pi / height)) % (width / 2) - width * rng.uniform(0.2, 0.25)
    blend(image, np.clip(width * rng.uniform(0.015, 0.04) - np.abs(across), 0, 1), ink)


def _plastic_cola(rng: np.random.Generator) -> Bottle:
    """0.5 to 1.5 l, with a waist or straight."""
    r, h = ((0.0325, 0.225), (0.036, 0.25), (0.0445, 0.32))[int(rng.choice(3, p=[0.55, 0.25, 0.2]))]
    waist = float(rng.uniform(0.80, 1.0))
    points = [(r * 0.86, 0.0), (r, 0.05 * h), (r, 0.22 * h), (r * waist, 0.36 * h), (r * (waist + 0.05), 0.45 * h)]
    points += [(r, 0.58 * h), (r, 0.66 * h), (r * 0.86, 0.76 * h), (r * 0.5, 0.88 * h), (0.0135, 0.93 * h), (0.0135, h)]
    smooth = [(float(p[0]), float(p[1])) for p in curve(points, 4)]
    low = float(rng.uniform(0.36, 0.42))
    return Bottle(tuple(_rising(smooth)), (low * h, (low + rng.uniform(0.2, 0.27)) * h), None, False, True)


def _glass_cola(rng: np.random.Generator) -> Bottle:
    """A waisted glass bottle."""
    r, h = float(rng.uniform(0.028, 0.031)), float(rng.uniform(0.19, 0.235))
    points = [(r * 0.88, 0.0), (r * 0.95, 0.06 * h), (r * 0.82, 0.22 * h), (r * 0.9, 0.35 * h), (r, 0.47 * h)]
    points += [(r * 0.96, 0.56 * h), (r * 0.7, 0.70 * h), (r * 0.48, 0.84 * h), (0.0125, 0.93 * h), (0.0132, h)]
    smooth = [(float(p[0]), float(p[1])) for p in curve(points, 4)]
    return Bottle(tuple(_rising(smooth)), (0.40 * h, 0.60 * h), None, True, True)


def _rising(line: Profile) -> Profile:
    """The outline without points that go down again."""
    kept = [line[0]]
    for point in line[1:]:
        if point[1] > kept[-1][1] + 1e-4:
            kept.append(point)
    return kept


# --- beer ---


def beer(draft: Draft) -> tuple[Finished, str, str]:
    """A bottle or a can of beer."""
    rng = draft.rng
    form = "can" if rng.random() < 0.27 else "bottle"
    ground, ink, accent = _beer_colours(rng)
    if form == "can":
        label = _beer_label(rng, ground, ink, accent)
        return make_can(draft, Can.drawn(rng), label), form, _colour_name(ground)
    glass_name, glass = (
        ("brown", (0.20, 0.09, 0.03)),
        ("green", (0.06, 0.26, 0.10)),
        ("brown", (0.28, 0.13, 0.04)),
        ("clear", (0.72, 0.55, 0.18)),
    )[int(rng.choice(4, p=[0.38, 0.32, 0.2, 0.1]))]
    bottle = _beer_bottle(rng)
    label = _paper(_beer_label(rng, ground, ink, accent), glass, rng)
    neck = plain(ground, (64, 128))
    blend(neck, emblem((48, 48), int(rng.integers(9)), rng), accent, (8, 20))
    glass = varied(rng, glass)
    cap = varied(rng, pick(rng, accent, ground, (0.78, 0.66, 0.30), (0.75, 0.75, 0.77)))
    has_neck = neck if bottle.neck_label_m is not None else None
    return (
        make_bottle(draft, bottle, label=label, neck=has_neck, glass=glass, cap=cap, wide_cap=False),
        form,
        glass_name,
    )


def _beer_colours(rng: np.random.Generator) -> tuple[Colour, Colour, Colour]:
    """Ground, ink and accent of a label."""
    schemes = (
        ((0.93, 0.90, 0.80), (0.10, 0.26, 0.14), (0.72, 0.58, 0.22)),
        ((0.95, 0.94, 0.90), (0.62, 0.08, 0.08), (0.75, 0.62, 0.28)),
        ((0.08, 0.32, 0.16), (0.95, 0.94, 0.90), (0.80, 0.68, 0.30)),
        ((0.82, 0.66, 0.24), (0.25, 0.10, 0.05), (0.95, 0.93, 0.86)),
        ((0.10, 0.17, 0.42), (0.95, 0.95, 0.95), (0.80, 0.68, 0.32)),
        ((0.94, 0.94, 0.95), (0.12, 0.22, 0.50), (0.70, 0.14, 0.14)),
        ((0.86, 0.87, 0.88), (0.12, 0.32, 0.20), (0.62, 0.10, 0.10)),
        ((0.10, 0.09, 0.09), (0.90, 0.78, 0.42), (0.90, 0.88, 0.82)),
        ((0.88, 0.45, 0.10), (0.97, 0.95, 0.88), (0.22, 0.12, 0.06)),
    )
    return schemes[int(rng.integers(len(schemes)))]


def _beer_label(rng: np.random.Generator, ground: Colour, ink: Colour, accent: Colour) -> FloatArray:
    image = plain(shade(rng, ground, 0.03), LABEL_SHAPE)
    edge = rng.uniform(0.03, 0.09)
    for rows in (slice(0, int(256 * edge)), slice(-int(256 * edge), None)):
        image[rows] = accent
    maker, kind = (
        brand(rng),
        str(rng.choice(["BEER", "PILS", "LAGER", "ALE", "Beer", "BREW", "Weizen", "IPA", "Export"])),
    )
    face, figure, high = int(rng.integers(9)), int(rng.integers(9)), float(rng.uniform(0.28, 0.36))
    for left in (0.02, 0.52):
        size = int(rng.integers(60, 100))
        blend(
            image, emblem((size, size), figure, rng), accent, (int(256 * edge) + 4, int(512 * (left + 0.2)) - size // 2)
        )
        write_word(image, maker, (high, left, high + 0.24, left + 0.42), ink, face=face)
        write_word(image, kind, (high + 0.26, left + 0.05, high + 0.46, left + 0.36), ink, face=int(face + 2))
        small_print(image, rng, (0.84, left + 0.08, 0.9, left + 0.34), ink)
    bar_code(image, rng, (0.4, 0.93, 0.75, 0.99))
    return image


def _paper(image: FloatArray, glass: Colour, rng: np.random.Generator) -> FloatArray:
    """A paper label that leaves glass free at its seam, and sometimes is oval."""
    height, width = image.shape[:2]
    rows, columns = np.indices((height, width))
    free = rng.uniform(0.0, 0.06)
    outside = np.abs(columns % (width // 2) - width / 4) > width * (0.25 - free)
    if rng.random() < 0.3:
        outside = ((columns % (width // 2) - width / 4) / (width * 0.24)) ** 2 + (
            (rows - height / 2) / (height * 0.5)
        ) ** 2 > 1
    image[outside] = glass
    return image


def _beer_bottle(rng: np.random.Generator) -> Bottle:
    """Long neck, 0.5 l, stubby or steep-shouldered."""
    forms = (
        ((0.0305, 0.230), (0.55, 0.66, 0.80)),
        ((0.0335, 0.265), (0.52, 0.66, 0.78)),
        ((0.0365, 0.165), (0.58, 0.72, 0.82)),
        ((0.0300, 0.240), (0.60, 0.67, 0.74)),
    )
    (r, h), (shoulder, slope, neck) = forms[int(rng.choice(4, p=[0.4, 0.3, 0.12, 0.18]))]
    r, h = r * float(rng.uniform(0.95, 1.05)), h * float(rng.uniform(0.95, 1.05))
    mouth = float(rng.uniform(0.0125, 0.0140))
    points = [(r * 0.9, 0.0), (r, 0.03 * h), (r, 0.3 * h), (r, shoulder * h), (r * 0.8, slope * h - 0.02 * h)]
    points += [
        (r * 0.56, neck * h - 0.04 * h),
        (mouth + 0.0015, (neck + 0.06) * h),
        (mouth, 0.95 * h),
        (mouth + 0.001, h),
    ]
    smooth = _rising([(float(min(p[0], r)), float(p[1])) for p in curve(points, 4)])
    low = float(rng.uniform(0.10, 0.2))
    collar = ((neck + 0.02) * h, 0.93 * h) if rng.random() < 0.6 else None
    return Bottle(
        tuple(smooth), (low * h, float(shoulder - rng.uniform(0.02, 0.08)) * h), collar, True, bool(rng.random() < 0.8)
    )


def _colour_name(colour: Colour) -> str:
    names = {
        "white": (0.93, 0.92, 0.88),
        "green": (0.08, 0.32, 0.16),
        "gold": (0.82, 0.66, 0.24),
        "blue": (0.1, 0.17, 0.42),
    }
    names |= {"black": (0.1, 0.09, 0.09), "orange": (0.88, 0.45, 0.1), "silver": (0.86, 0.87, 0.88)}
    return min(names, key=lambda name: float(np.sum((np.array(names[name]) - np.array(colour)) ** 2)))
