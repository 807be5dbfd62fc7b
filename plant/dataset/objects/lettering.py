"""Words and emblems on pictures, and names that we invent for them."""

from __future__ import annotations

import importlib.util
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike

from skills.robot import FloatArray

_FACES = (
    "DejaVuSans-Bold.ttf",
    "DejaVuSans-BoldOblique.ttf",
    "DejaVuSerif-Bold.ttf",
    "DejaVuSerif-BoldItalic.ttf",
    "DejaVuSerif-Italic.ttf",
    "STIXGeneralBolIta.ttf",
    "STIXGeneralBol.ttf",
    "DejaVuSansMono-Bold.ttf",
    "cmb10.ttf",
)
SCRIPT_FACES = (3, 4, 5)
_STARTS = ("Al", "Bro", "Cas", "Dun", "El", "Far", "Gol", "Hal", "Kra", "Lor", "Mon", "Nor", "Ost", "Pel", "Rav", "Sol")
_MIDDLES = ("", "a", "de", "en", "i", "ko", "lo", "ma", "ri", "ta", "ve")
_ENDS = (
    "berg",
    "do",
    "feld",
    "field",
    "hof",
    "ia",
    "ka",
    "land",
    "lin",
    "mar",
    "na",
    "rado",
    "stein",
    "ton",
    "vik",
    "za",
)


@cache
def _font_folder() -> Path:
    """The fonts that come with matplotlib, which Drake needs anyway."""
    spec = importlib.util.find_spec("matplotlib")
    if spec is None or spec.origin is None:
        raise FileNotFoundError("matplotlib, which Drake brings along, is not installed; its fonts are needed")
    return Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf"


@cache
def _face(index: int) -> cv2.FontFace:
    return cv2.FontFace(str(_font_folder() / _FACES[index % len(_FACES)]))


def brand(rng: np.random.Generator) -> str:
    """An invented name."""
    return str(rng.choice(_STARTS)) + str(rng.choice(_MIDDLES)) + str(rng.choice(_ENDS))


def word_mask(text: str, shape: tuple[int, int], *, face: int = 0, fill: float = 0.9) -> FloatArray:
    """The word's coverage (0..1) of a picture (H, W), as large as fits into the share `fill` of it."""
    height, width = shape
    size = 100
    (_, _, w, h), font = cv2.getTextSize((1, 1), text, (0, 0), _face(face), size), _face(face)
    size = max(4, int(size * fill * min(width / max(w, 1), height / max(h, 1))))
    x, y, w, h = cv2.getTextSize((1, 1), text, (0, 0), font, size)
    canvas = np.zeros((height, width, 3), np.uint8)
    cv2.putText(canvas, text, ((width - w) // 2 - x, (height - h) // 2 - y), (255, 255, 255), font, size)
    return np.asarray(canvas[..., 0] / 255.0)


def blend(image: FloatArray, mask: FloatArray, colour: ArrayLike, corner: tuple[int, int] = (0, 0)) -> None:
    """Lay a colour over a picture (in place) where the mask covers; `corner` is the mask's (row, column)."""
    rows = slice(max(corner[0], 0), min(corner[0] + mask.shape[0], image.shape[0]))
    columns = slice(max(corner[1], 0), min(corner[1] + mask.shape[1], image.shape[1]))
    if rows.start >= rows.stop or columns.start >= columns.stop:
        return
    part = mask[rows.start - corner[0] : rows.stop - corner[0], columns.start - corner[1] : columns.stop - corner[1]]
    image[rows, columns] += part[..., None] * (np.asarray(colour, dtype=float) - image[rows, columns])


def write_word(
    image: FloatArray, text: str, box: tuple[float, float, float, float], colour: ArrayLike, *, face: int = 0
) -> None:
    """Write a word (in place) into a box (top, left, bottom, right) given as shares of the picture."""
    h, w = image.shape[:2]
    top, left, bottom, right = (round(v * s) for v, s in zip(box, (h, w, h, w), strict=True))
    blend(image, word_mask(text, (max(bottom - top, 2), max(right - left, 2)), face=face), colour, (top, left))


def write_tall(
    image: FloatArray, text: str, box: tuple[float, float, float, float], colour: ArrayLike, face: int
) -> None:
    """Write a word that runs from the bottom up."""
    h, w = image.shape[:2]
    top, left, bottom, right = (round(v * s) for v, s in zip(box, (h, w, h, w), strict=True))
    mask = word_mask(text, (max(right - left, 2), max(bottom - top, 2)), face=face)
    blend(image, np.rot90(mask), colour, (top, left))


def small_print(
    image: FloatArray, rng: np.random.Generator, box: tuple[float, float, float, float], colour: ArrayLike
) -> None:
    """Lines that look like fine print (in place)."""
    h, w = image.shape[:2]
    top, left, bottom, right = (round(v * s) for v, s in zip(box, (h, w, h, w), strict=True))
    mask = np.zeros((max(bottom - top, 1), max(right - left, 1)))
    for row in range(0, mask.shape[0] - 1, 5):
        x = 0
        while x < mask.shape[1] * (0.98 if row + 10 < mask.shape[0] else 0.5):
            length = int(rng.integers(3, 14))
            mask[row : row + 2, x : x + length] = 0.75
            x += length + 3
    blend(image, mask, colour, (top, left))


def bar_code(image: FloatArray, rng: np.random.Generator, box: tuple[float, float, float, float]) -> None:
    """A bar code on white (in place)."""
    h, w = image.shape[:2]
    top, left, bottom, right = (round(v * s) for v, s in zip(box, (h, w, h, w), strict=True))
    bars = np.repeat(rng.random(max((right - left) // 2, 1)) < 0.5, 2)[: right - left]
    image[top:bottom, left:right] = 0.95
    image[top + 2 : bottom - 2, left : left + len(bars)][:, bars] = 0.08


def emblem(shape: tuple[int, int], kind: int, rng: np.random.Generator) -> FloatArray:
    """A simple figure's coverage (0..1): disc, ring, shield, star, crown, leaf, drop, ears of grain, or a mountain."""
    height, width = shape
    canvas = np.zeros((height * 4, width * 4), np.uint8)
    for outline, value in _figure(kind % 9, rng):
        points = np.round(np.array(outline) * [width * 4, height * 4]).astype(np.int32)
        cv2.fillPoly(canvas, [points], value)
    return np.asarray(cv2.resize(canvas, (width, height), interpolation=cv2.INTER_AREA) / 255.0)


Outline = list[tuple[float, float]]


def _circle(x: float, y: float, rx: float, ry: float, n: int = 40) -> Outline:
    a = np.linspace(0, 2 * np.pi, n)
    return [(float(x + rx * np.cos(t)), float(y + ry * np.sin(t))) for t in a]


def _star(points: int, inner: float) -> Outline:
    a = np.arange(2 * points) * np.pi / points - np.pi / 2
    r = np.where(np.arange(2 * points) % 2 == 0, 0.48, inner)
    return [(float(0.5 + q * np.cos(t)), float(0.5 + q * np.sin(t))) for q, t in zip(r, a, strict=True)]


def _figure(kind: int, rng: np.random.Generator) -> list[tuple[Outline, int]]:
    if kind == 0:
        return [(_circle(0.5, 0.5, 0.48, 0.48), 255)]
    if kind == 1:
        return [(_circle(0.5, 0.5, 0.48, 0.48), 255), (_circle(0.5, 0.5, 0.38, 0.38), 0), (_star(5, 0.2), 255)]
    if kind == 2:
        shield = [(0.1, 0.08), (0.9, 0.08), (0.9, 0.5), (0.75, 0.8), (0.5, 0.97), (0.25, 0.8), (0.1, 0.5)]
        return [(shield, 255), ([(0.44, 0.1), (0.56, 0.1), (0.56, 0.9), (0.44, 0.9)], 0)]
    if kind == 3:
        return [(_star(int(rng.integers(5, 9)), 0.22), 255)]
    if kind == 4:
        crown = [(0.1, 0.85), (0.05, 0.3), (0.3, 0.55), (0.5, 0.12), (0.7, 0.55), (0.95, 0.3), (0.9, 0.85)]
        return [(crown, 255)]
    if kind == 5:
        return [([(0.05, 0.9), (0.1, 0.4), (0.5, 0.08), (0.95, 0.05), (0.9, 0.5), (0.55, 0.85)], 255)]
    if kind == 6:
        return [([(0.5, 0.03), (0.8, 0.5), (0.82, 0.7), (0.65, 0.93), (0.35, 0.93), (0.18, 0.7), (0.2, 0.5)], 255)]
    if kind == 7:
        grain = [
            (_circle(0.5 + s * 0.14 * (1 + k % 2), 0.12 + 0.11 * k, 0.1, 0.06), 255) for k in range(7) for s in (-1, 1)
        ]
        return [*grain, ([(0.48, 0.1), (0.52, 0.1), (0.52, 0.98), (0.48, 0.98)], 255)]
    return [([(0.02, 0.92), (0.36, 0.2), (0.52, 0.5), (0.68, 0.3), (0.98, 0.92)], 255)]
