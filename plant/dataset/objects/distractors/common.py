"""What the distractors share: colours, turned parts, printed boxes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from plant.dataset.objects.draft import Draft, Finished, Profile, pick, shade
from plant.dataset.objects.lettering import bar_code, blend, brand, emblem, small_print, write_word
from plant.dataset.objects.wear import brushed, plain, rusty, used
from plant.models.builder.mesh import Colour
from plant.models.builder.outlines import curve
from plant.models.builder.surfaces import add_rounded_box
from skills.robot import FloatArray

Made = tuple[Finished, str, str]

COLOURS: dict[str, Colour] = {
    "white": (0.92, 0.92, 0.90),
    "black": (0.08, 0.08, 0.09),
    "grey": (0.50, 0.51, 0.53),
    "red": (0.76, 0.10, 0.09),
    "blue": (0.12, 0.28, 0.66),
    "green": (0.14, 0.48, 0.24),
    "yellow": (0.94, 0.80, 0.14),
    "orange": (0.92, 0.45, 0.10),
    "brown": (0.42, 0.28, 0.17),
    "pink": (0.90, 0.55, 0.66),
    "cream": (0.90, 0.86, 0.74),
    "teal": (0.15, 0.52, 0.54),
    "purple": (0.40, 0.22, 0.52),
}


def any_colour(draft: Draft, *names: str) -> tuple[str, FloatArray]:
    """One of the colours by name, a little varied."""
    chosen = str(draft.rng.choice(names or list(COLOURS)))
    return chosen, shade(draft.rng, COLOURS[chosen], 0.06)


def surface_of(
    draft: Draft, name: str, colour: ArrayLike, *, shine: float = 0.3, metal: float = 0.0, wear: float | None = None
) -> str:
    """A used surface of one colour; its name."""
    amount = float(draft.rng.uniform(0, 0.5)) if wear is None else wear
    return draft.picture(name, used(plain(colour), draft.rng, amount), shine=shine, metal=metal)


def turn(
    draft: Draft,
    material: str,
    profile: Profile,
    *,
    smooth: bool = False,
    sides: int = 32,
    shell: float | None = None,
    density: float = 900.0,
) -> None:
    """A turned part about z; `shell` (kg/m^2) makes it hollow."""
    line = [(max(float(r), 0.0), float(z)) for r, z in (curve(profile, 5) if smooth else profile)]
    part = draft.part()
    part.add_lathe(material, line, sides=sides)
    if shell is None:
        closed, axis = draft.part(), [(0.0, line[0][1])] if line[0][0] > 0 else []
        end = [(0.0, line[-1][1])] if line[-1][0] > 0 else []
        closed.add_lathe(material, [*axis, *line, *end], sides=sides)
        draft.content(closed, density)
        draft.look(part)
    else:
        draft.shell(part, shell)


def print_on(
    draft: Draft, ground: ArrayLike, *, words: tuple[str, ...], shape: tuple[int, int] = (256, 512), repeats: int = 2
) -> FloatArray:
    """A printed label: a name, what is inside, an emblem, fine print."""
    rng = draft.rng
    image = plain(ground, shape)
    dark = float(np.mean(np.asarray(ground))) < 0.5
    ink = np.array((0.95, 0.95, 0.93) if dark else (0.1, 0.1, 0.12))
    _, accent = any_colour(draft)
    if rng.random() < 0.6:
        band = slice(int(shape[0] * rng.uniform(0.5, 0.7)), int(shape[0] * rng.uniform(0.75, 1.0)))
        image[band] = accent
    name, face, kind = brand(rng), int(rng.integers(9)), int(rng.integers(9))
    step = 1.0 / repeats
    for k in range(repeats):
        left, right = k * step + 0.06 * step, (k + 1) * step - 0.14 * step
        write_word(image, name, (0.10, left, 0.34, right), ink, face=face)
        write_word(image, str(rng.choice(words)), (0.40, left, 0.56, right), accent if not dark else ink, face=face + 1)
        size = int(shape[0] * 0.28)
        blend(
            image,
            emblem((size, size), kind, rng),
            accent * 0.8,
            (int(shape[0] * 0.62), int(shape[1] * (left + right) / 2) - size // 2),
        )
        small_print(image, rng, (0.92, left, 0.98, right), ink)
    bar_code(image, rng, (0.7, 1 - 0.11 * step, 0.9, 0.99))
    return image


def printed_box(
    draft: Draft, size: tuple[float, float, float], ground: ArrayLike, words: tuple[str, ...], density: float
) -> None:
    """A carton with print on all its faces, standing on z = 0."""
    w, d, h = size
    draft.picture("front", print_on(draft, ground, words=words, shape=(256, 192), repeats=1))
    draft.picture("side", print_on(draft, shade(draft.rng, ground), words=words, shape=(256, 128), repeats=1))
    draft.picture("top", used(plain(ground), draft.rng, 0.2))
    part = draft.part()
    faces: dict[str, str | None] = {"-x": "side", "+x": "side", "-z": "top", "+z": "top"}
    part.add_box("front", (-w / 2, -d / 2, 0), (w / 2, d / 2, h), faces=faces)
    draft.solid(part, density)


def box(
    draft: Draft, material: str, low: ArrayLike, high: ArrayLike, *, radius: float = 0.003, density: float = 600.0
) -> None:
    """A solid box with rounded edges."""
    part = draft.part()
    add_rounded_box(part, material, low, high, radius)
    draft.solid(part, density)


def between(draft: Draft, low: float, high: float) -> float:
    """An even draw."""
    return float(draft.rng.uniform(low, high))


def steel(draft: Draft, name: str = "steel") -> str:
    """A bare, used, sometimes rusty metal; its name."""
    tone = pick(draft.rng, (0.62, 0.63, 0.65), (0.4, 0.41, 0.43), (0.2, 0.2, 0.22))
    image = used(brushed(draft.rng, tone), draft.rng, 0.4)
    return draft.picture(
        name, rusty(image, draft.rng, 0.3) if draft.rng.random() < 0.3 else image, shine=0.6, metal=1.0
    )
