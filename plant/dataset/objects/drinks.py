"""Coke and beer: cans and bottles with labels of our own."""

from __future__ import annotations

import numpy as np

from plant.dataset.objects.containers import Bottle, Can, Profile, make_bottle, make_can
from plant.dataset.objects.draft import Draft, Finished, pick, shade, varied
from plant.dataset.objects.lettering import (
    SCRIPT_FACES,
    bar_code,
    blend,
    brand,
    emblem,
    small_print,
    write_tall,
    write_word,
)
from plant.dataset.objects.wear import plain
from plant.models.builder.mesh import Colour
from plant.models.builder.outlines import curve
from skills.robot import FloatArray

LABEL_SHAPE = (256, 512)
WHITE: Colour = (0.96, 0.96, 0.95)
COLA_WORDS = ("COLA", "Cola", "Kola", "COKE", "Coke", "cola", "Coke", "Cola")


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
