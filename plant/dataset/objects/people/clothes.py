"""What people wear: fields cut from the body, thicker than it, and the pictures on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from plant.dataset.objects.draft import shade
from plant.dataset.objects.lettering import blend, brand, emblem, write_word
from plant.dataset.objects.people.body import lower_limbs, trunk, upper_limbs
from plant.dataset.objects.people.form import Build, Skeleton
from plant.models.builder.implicit import Field, ball, both, cut, grown, half_space, join, limb
from plant.models.builder.mesh import Colour
from plant.models.builder.pictures import cloth, noise
from skills.robot import FloatArray

CLOTH_COLOURS: tuple[Colour, ...] = (
    (0.14, 0.16, 0.24),
    (0.08, 0.08, 0.09),
    (0.55, 0.56, 0.58),
    (0.90, 0.90, 0.88),
    (0.25, 0.36, 0.55),
    (0.50, 0.10, 0.12),
    (0.20, 0.36, 0.24),
    (0.62, 0.52, 0.38),
    (0.80, 0.62, 0.12),
    (0.42, 0.28, 0.46),
    (0.78, 0.38, 0.42),
    (0.35, 0.52, 0.62),
    (0.33, 0.24, 0.18),
    (0.85, 0.40, 0.10),
)
TROUSER_COLOURS: tuple[Colour, ...] = (
    (0.13, 0.17, 0.28),
    (0.20, 0.27, 0.42),
    (0.10, 0.10, 0.11),
    (0.33, 0.33, 0.35),
    (0.55, 0.47, 0.35),
    (0.28, 0.26, 0.20),
    (0.42, 0.50, 0.62),
)


@dataclass(frozen=True)
class Outfit:
    """Kinds of top and bottom, their colours, sleeve length (share of the arm), looseness (m)."""

    top: str
    bottom: str
    top_colour: Colour
    bottom_colour: Colour
    sleeve: float
    loose_m: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Self:
        """Any usual clothes, also work clothes."""
        top = str(
            rng.choice(["t-shirt", "sweater", "shirt", "jacket", "vest", "coat"], p=[0.26, 0.22, 0.18, 0.14, 0.1, 0.1])
        )
        bottom = str(rng.choice(["trousers", "shorts", "skirt"], p=[0.8, 0.11, 0.09]))
        sleeve = float(rng.uniform(0.26, 0.45)) if top == "t-shirt" else 0.97
        sleeve = float(rng.uniform(0.5, 0.97)) if top == "shirt" else sleeve
        top_colour = CLOTH_COLOURS[int(rng.integers(len(CLOTH_COLOURS)))]
        if top == "vest":
            top_colour = ((0.85, 0.92, 0.10), (0.97, 0.45, 0.05))[int(rng.integers(2))]
        bottom_colour = TROUSER_COLOURS[int(rng.integers(len(TROUSER_COLOURS)))]
        return cls(top, bottom, top_colour, bottom_colour, sleeve, float(rng.uniform(0.006, 0.016)))


def folded(field: Field, rng: np.random.Generator, amount_m: float) -> Field:
    """The field with soft folds."""
    waves = [(rng.normal(0, 1, 3) * [14, 14, 22], float(rng.uniform(0, 6.3))) for _ in range(4)]

    def wavy(p: FloatArray) -> FloatArray:
        folds = sum(np.sin(p @ direction + phase) for direction, phase in waves)
        return np.asarray(field(p) - amount_m * np.asarray(folds) / 2)

    return wavy


def top_field(build: Build, s: Skeleton, outfit: Outfit, rng: np.random.Generator) -> Field:
    """The garment over trunk and arms."""
    h = build.height_m
    hem = -0.05 * h if outfit.top != "coat" else -0.20 * h
    thick = max(outfit.loose_m, 0.008) + (0.008 if outfit.top in ("jacket", "coat", "sweater", "vest") else 0.004)
    sleeves = grown(_sleeves(build, s, outfit.sleeve), thick * 0.75)
    skirt = (
        []
        if outfit.top != "coat"
        else [limb(s.pelvis, s.pelvis - [0, 0, 0.18 * h], 0.085 * h * build.girth, 0.10 * h * build.girth)]
    )
    body = grown(join([trunk(build, s), *skirt], 0.05), thick)
    whole = folded(join([body, sleeves], 0.025), rng, 0.004)
    whole = both(whole, half_space(s.pelvis + [0, 0, hem], (0, 0, -1)))
    collar = ball(s.neck + [0.035 * h, 0, 0.022 * h], (0.045 * h, 0.042 * h, 0.040 * h))
    return cut(whole, collar, 0.01)


def _sleeves(build: Build, s: Skeleton, share: float) -> Field:
    """The arms as far as the sleeves reach (share of the way to the wrist)."""
    arms = upper_limbs(build, s)
    far = []
    for arm in s.arms:
        upper, lower = np.linalg.norm(arm.middle - arm.root), np.linalg.norm(arm.end - arm.middle)
        reach = share * (upper + lower)
        start, end = (arm.root, arm.middle) if reach < upper else (arm.middle, arm.end)
        left = reach if reach < upper else reach - upper
        way = (end - start) / np.linalg.norm(end - start)
        far.append(
            both(
                half_space(start + way * left, -way),
                ball(start + way * (left + 0.14 * build.height_m), 0.15 * build.height_m),
            )
        )
    return cut(arms, join(far))


def bottom_field(build: Build, s: Skeleton, outfit: Outfit, rng: np.random.Generator) -> Field:
    """Trousers, shorts or a skirt."""
    h = build.height_m
    waist = half_space(s.pelvis + [0, 0, 0.055 * h], (0, 0, 1))
    if outfit.bottom == "skirt" and build.stance != "sitting":
        length = float(rng.uniform(0.16, 0.32)) * h
        cone = limb(s.pelvis + [0, 0, 0.03 * h], s.pelvis - [0, 0, length], 0.085 * h, 0.125 * h)
        body = both(
            join([cone, grown(trunk(build, s), 0.006)], 0.03), half_space(s.pelvis - [0, 0, length], (0, 0, -1))
        )
        return both(folded(body, rng, 0.006), waist)
    legs = grown(lower_limbs(build, s), min(outfit.loose_m, 0.009) + 0.002)
    body = folded(join([grown(trunk(build, s), 0.002), legs], 0.03), rng, 0.004)
    body = both(body, waist)
    if outfit.bottom == "shorts":
        ends = [
            both(half_space(0.3 * leg.root + 0.7 * leg.middle, leg.root - leg.middle), ball(leg.end, 0.40 * h))
            for leg in s.legs
        ]
        ends = [
            cut(end, half_space(leg.middle + (leg.root - leg.middle) * 0.3, leg.middle - leg.root))
            for end, leg in zip(ends, s.legs, strict=True)
        ]
        return cut(body, join(ends))
    soles = [half_space((0, 0, 0.035 * h), (0, 0, 1))]
    return cut(body, join(soles)) if build.stance != "walking" else body


def top_picture(rng: np.random.Generator, outfit: Outfit) -> FloatArray:
    """Front (left half) and back (right half) of the top."""
    shape = (256, 512)
    r, g, b = (float(v) for v in shade(rng, outfit.top_colour, 0.05))
    image = cloth(rng, shape, (r, g, b), 0.06) * (1 + 0.06 * noise(rng, shape, (14, 8)))[..., None]
    rows, columns = np.indices(shape)
    front = columns < 256
    pattern = str(rng.choice(["none", "stripes", "checks", "print", "block"], p=[0.45, 0.18, 0.13, 0.16, 0.08]))
    second = shade(rng, CLOTH_COLOURS[int(rng.integers(len(CLOTH_COLOURS)))], 0.05)
    if outfit.top == "vest":
        _reflexes(image, rows)
    elif pattern == "stripes" and outfit.top in ("t-shirt", "sweater", "shirt"):
        image[(rows // int(rng.integers(6, 22))) % 2 == 0] *= second / np.array([r, g, b]).clip(0.2)
    elif pattern == "checks" and outfit.top == "shirt":
        size = int(rng.integers(8, 20))
        image[(rows // size) % 2 == 0] *= 0.8
        image[(columns // size) % 2 == 0] *= 0.85
    elif pattern == "print" and outfit.top in ("t-shirt", "sweater"):
        blend(image, emblem((60, 60), int(rng.integers(9)), rng), second, (90, 98))
        write_word(image, brand(rng), (0.62, 0.17, 0.72, 0.33), second, face=int(rng.integers(5)))
    elif pattern == "block":
        image[rows < int(rng.integers(80, 150))] = second
    if outfit.top in ("shirt", "jacket", "coat", "vest"):
        image[front & (np.abs(columns - 128) < 2)] *= 0.55
        image[front & (np.abs(columns - 131) < 1) & (rows % 28 < 4)] = (
            (0.85, 0.85, 0.85) if outfit.top == "shirt" else (0.2, 0.2, 0.2)
        )
    return np.asarray(image)


def _reflexes(image: FloatArray, rows: NDArray[np.int64]) -> None:
    """The bright bands of a safety vest."""
    for low in (120, 165):
        image[(rows > low) & (rows < low + 16)] = (0.82, 0.83, 0.84)


def bottom_picture(rng: np.random.Generator, outfit: Outfit) -> FloatArray:
    """Front and back of the bottom."""
    shape = (192, 384)
    r, g, b = (float(v) for v in shade(rng, outfit.bottom_colour, 0.05))
    image = cloth(rng, shape, (r, g, b), 0.08) * (1 + 0.08 * noise(rng, shape, (16, 5)))[..., None]
    image[4:12] *= 0.7
    for middle in (96, 288):
        image[12:80, middle - 1 : middle + 1] *= 0.75
    return np.asarray(image)
