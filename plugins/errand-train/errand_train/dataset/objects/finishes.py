"""Surfaces in recipes: colours by name, and the pictures of paint, metal, wood, cloth, labels and the like."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict

from errand_make.mesh import Colour
from errand_train.dataset.objects.draft import Draft, vary_shade
from errand_train.dataset.objects.lettering import COLOURS, crest_label, printed_label, script_label, write_word
from errand_train.dataset.objects.wear import add_rust, add_wear, brushed_metal, plain_picture
from errand_train.models.expressions import Number, evaluate
from errand_train.models.pictures import cloth, noise, speckle, wood
from skills.robot import FloatArray

Colours = str | tuple[Any, ...] | dict[str, Any]
"""A name, "any", "main", three numbers, several of these to choose from, or those by a name of the recipe's own."""


class Finish(BaseModel):
    """A surface: its colour (darkened or lightened by `dim`), its texture, and the words on a label."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    colour: Colours = "main"
    dim: float = 1.0
    texture: str = "painted"
    shine: float = 0.3
    metal: float = 0.0
    wear: Number = "wear"
    words: tuple[str, ...] = ()
    brands: tuple[str, ...] = ()
    repeats: int = 2


def draw_colour(rng: np.random.Generator, colours: Colours, main: tuple[str, ArrayLike]) -> tuple[str, FloatArray]:
    """Draws one of the colours, a little varied, with its name. Raises ValueError for an unknown name."""
    if isinstance(colours, dict):
        name = str(rng.choice(list(colours)))
        return name, draw_colour(rng, colours[name], main)[1]
    if isinstance(colours, tuple | list):
        if all(isinstance(each, int | float) for each in colours):
            return _called(colours), vary_shade(rng, colours)
        return draw_colour(rng, colours[int(rng.integers(len(colours)))], main)
    if colours == "main":
        return main[0], np.asarray(main[1], dtype=float)
    if colours != "any" and colours not in COLOURS:
        raise ValueError(f"no colour {colours!r}; there are any, main, {', '.join(COLOURS)}")
    name = str(rng.choice(list(COLOURS))) if colours == "any" else colours
    return name, vary_shade(rng, COLOURS[name])


def _called(colour: ArrayLike) -> str:
    """Name nearest to a colour."""
    return min(COLOURS, key=lambda name: float(np.sum((np.array(COLOURS[name]) - np.asarray(colour, float)) ** 2)))


def apply_finish(
    draft: Draft, name: str, finish: Finish, main: tuple[str, ArrayLike], names: Mapping[str, float]
) -> None:
    """Gives the draft a material by its finish. Raises ValueError for an unknown texture or colour."""
    _, colour = draw_colour(draft.rng, finish.colour, main)
    colour = np.clip(colour * finish.dim, 0, 1)
    if finish.texture == "plain":
        draft.paint(name, colour, shine=finish.shine, metal=finish.metal)
        return
    if finish.texture not in _TEXTURES:
        raise ValueError(f"no texture {finish.texture!r}; there are plain, {', '.join(_TEXTURES)}")
    picture = _TEXTURES[finish.texture](draft.rng, colour, finish)
    wear = evaluate(finish.wear, names, draft.rng)
    draft.picture(name, add_wear(picture, draft.rng, wear) if wear else picture, shine=finish.shine, metal=finish.metal)


def _rgb(colour: FloatArray) -> Colour:
    return (float(colour[0]), float(colour[1]), float(colour[2]))


def _striped(rng: np.random.Generator, colour: FloatArray, _: Finish) -> FloatArray:
    image = plain_picture(colour)
    image[(np.indices((128, 128))[int(rng.integers(2))] // int(rng.integers(8, 40))) % 2 == 0] = _second(rng)
    return image


def _checked(rng: np.random.Generator, colour: FloatArray, _: Finish) -> FloatArray:
    image, size = plain_picture(colour), 128 // int(rng.integers(2, 9))
    image[(np.indices((128, 128)) // size).sum(axis=0) % 2 == 0] = _second(rng)
    return image


def _second(rng: np.random.Generator) -> FloatArray:
    return draw_colour(rng, "any", ("", ()))[1]


def _lettered(rng: np.random.Generator, colour: FloatArray, _: Finish) -> FloatArray:
    image, letter = plain_picture(colour), str(rng.choice(list("ABCDEFGHKMRSTX123456789")))
    write_word(image, letter, (0.12, 0.12, 0.88, 0.88), _second(rng), face=int(rng.integers(9)))
    return image


def _screen(rng: np.random.Generator, colour: FloatArray, _: Finish) -> FloatArray:
    image = plain_picture(colour, (160, 256))
    for _window in range(int(rng.integers(0, 7))):
        y, x = int(rng.integers(0, 110)), int(rng.integers(0, 180))
        image[y : y + int(rng.integers(15, 60)), x : x + int(rng.integers(20, 90))] = rng.uniform(0.05, 0.95, 3)
    return image


def _keys(rng: np.random.Generator, colour: FloatArray, _: Finish) -> FloatArray:
    image, (rows, columns) = plain_picture(colour * 0.8, (96, 256)), np.indices((96, 256))
    image[(rows % 18 > 3) & (columns % 17 > 3)] = rng.choice([0.08, 0.9, 0.3])
    return image


def _dial(_: np.random.Generator, colour: FloatArray, __: Finish) -> FloatArray:
    """A clock's or a gauge's face: marks all around and two hands."""
    image, (rows, columns) = plain_picture(colour), np.indices((128, 128)) - 63.5
    angle, radius = np.arctan2(rows, columns), np.hypot(rows, columns)
    image[(np.abs((angle * 6 / np.pi + 0.05) % 1 - 0.05) < 0.05) & (radius > 44) & (radius < 56)] = 0.1
    image[(np.abs(columns) < 2) & (rows < 0) & (rows > -42)] = 0.1
    image[(np.abs(rows) < 3) & (columns > 0) & (columns < 28)] = (0.7, 0.1, 0.1)
    return image


def _streaked(rng: np.random.Generator, colour: FloatArray, _: Finish) -> FloatArray:
    """Light and dark streaks: thick glass, leaves, hair."""
    return np.asarray(plain_picture(colour) * (1 + 0.13 * noise(rng, (128, 128), (20, 3)))[..., None])


_TEXTURES: Final[Mapping[str, Callable[[np.random.Generator, FloatArray, Finish], FloatArray]]] = {
    "painted": lambda rng, colour, _: plain_picture(colour),
    "brushed": lambda rng, colour, _: brushed_metal(rng, colour),
    "rusty": lambda rng, colour, _: add_rust(brushed_metal(rng, colour), rng, 0.7),
    "wood": lambda rng, colour, _: wood(rng, (128, 256), _rgb(colour), 0.08),
    "cloth": lambda rng, colour, _: cloth(rng, (128, 128), _rgb(colour), 0.12),
    "speckled": lambda rng, colour, _: speckle(rng, (128, 128), _rgb(colour), 0.03),
    "streaked": _streaked,
    "striped": _striped,
    "checked": _checked,
    "lettered": _lettered,
    "screen": _screen,
    "keys": _keys,
    "dial": _dial,
    "crest": lambda rng, colour, finish: crest_label(rng, colour, _second(rng), words=finish.words),
    "script": lambda rng, colour, finish: script_label(
        rng, colour, _second(rng), words=finish.words, brands=finish.brands
    ),
    "label": lambda rng, colour, finish: printed_label(
        rng, colour, _second(rng), words=finish.words, brands=finish.brands, repeats=finish.repeats
    ),
}
