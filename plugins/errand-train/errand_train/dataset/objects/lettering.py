"""Words, emblems and invented names on pictures; their fonts, syllables and colours are in `decoration.yaml`."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import ArrayLike

from errand_make.mesh import Colour
from skills.inputs.yaml_source import read_yaml
from skills.robot import FloatArray

_DECORATION: Final[Mapping[str, Any]] = read_yaml(Path(__file__).with_name("decoration.yaml")).data
COLOURS: Final[Mapping[str, Colour]] = {name: tuple(rgb) for name, rgb in _DECORATION["colours"].items()}
GREYS: Final[tuple[Colour, ...]] = tuple(tuple(rgb) for rgb in _DECORATION["greys"])


@cache
def _font_folder() -> Path:
    """The fonts that come with matplotlib, which Drake needs anyway."""
    spec = importlib.util.find_spec("matplotlib")
    if spec is None or spec.origin is None:
        raise FileNotFoundError("matplotlib, which Drake brings along, is not installed; its fonts are needed")
    return Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf"


@cache
def _face(index: int) -> cv2.FontFace:
    return cv2.FontFace(str(_font_folder() / _DECORATION["fonts"][index % len(_DECORATION["fonts"])]))


def brand(rng: np.random.Generator) -> str:
    """Invents a brand name."""
    return "".join(str(rng.choice(_DECORATION[part])) for part in ("starts", "middles", "ends"))


def word_mask(text: str, shape: tuple[int, int], *, face: int = 0, fill: float = 0.9) -> FloatArray:
    """Coverage (0..1) of a picture (H, W) by a word that fills the share `fill` of it."""
    height, width = shape
    size = 100
    (_, _, w, h), font = cv2.getTextSize((1, 1), text, (0, 0), _face(face), size), _face(face)
    size = max(4, int(size * fill * min(width / max(w, 1), height / max(h, 1))))
    x, y, w, h = cv2.getTextSize((1, 1), text, (0, 0), font, size)
    canvas = np.zeros((height, width, 3), np.uint8)
    cv2.putText(canvas, text, ((width - w) // 2 - x, (height - h) // 2 - y), (255, 255, 255), font, size)
    return np.asarray(canvas[..., 0] / 255.0)


def blend(image: FloatArray, mask: FloatArray, colour: ArrayLike, corner: tuple[int, int] = (0, 0)) -> None:
    """Lays a colour over a picture (in place) where the mask covers; `corner` is the mask's (row, column)."""
    rows = slice(max(corner[0], 0), min(corner[0] + mask.shape[0], image.shape[0]))
    columns = slice(max(corner[1], 0), min(corner[1] + mask.shape[1], image.shape[1]))
    if rows.start >= rows.stop or columns.start >= columns.stop:
        return
    part = mask[rows.start - corner[0] : rows.stop - corner[0], columns.start - corner[1] : columns.stop - corner[1]]
    image[rows, columns] += part[..., None] * (np.asarray(colour, dtype=float) - image[rows, columns])


def write_word(
    image: FloatArray, text: str, box: tuple[float, float, float, float], colour: ArrayLike, *, face: int = 0
) -> None:
    """Writes a word (in place) into a box (top, left, bottom, right) given as shares of the picture."""
    h, w = image.shape[:2]
    top, left, bottom, right = (round(v * s) for v, s in zip(box, (h, w, h, w), strict=True))
    blend(image, word_mask(text, (max(bottom - top, 2), max(right - left, 2)), face=face), colour, (top, left))


def small_print(
    image: FloatArray, rng: np.random.Generator, box: tuple[float, float, float, float], colour: ArrayLike
) -> None:
    """Draws lines that look like fine print (in place)."""
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
    """Draws a bar code on white (in place)."""
    h, w = image.shape[:2]
    top, left, bottom, right = (round(v * s) for v, s in zip(box, (h, w, h, w), strict=True))
    bars = np.repeat(rng.random(max((right - left) // 2, 1)) < 0.5, 2)[: right - left]
    image[top:bottom, left:right] = 0.95
    image[top + 2 : bottom - 2, left : left + len(bars)][:, bars] = 0.08


def emblem(size: int, rng: np.random.Generator) -> FloatArray:
    """Coverage (0..1) of a square by a disc, a star, a shield, a crown, a leaf or a mountain."""
    points = int(rng.integers(5, 9))
    angle = np.arange(2 * points) * np.pi / points - np.pi / 2
    radius = np.where(np.arange(2 * points) % 2 == 0, 0.48, rng.choice([0.22, 0.48]))
    figures = (*_DECORATION["figures"], np.column_stack([0.5 + radius * np.cos(angle), 0.5 + radius * np.sin(angle)]))
    canvas = np.zeros((size * 4, size * 4), np.uint8)
    outline = np.array(figures[int(rng.integers(len(figures)))])
    cv2.fillPoly(canvas, [np.round(outline * size * 4).astype(np.int32)], 255)
    return np.asarray(cv2.resize(canvas, (size, size), interpolation=cv2.INTER_AREA) / 255.0)


def printed_label(
    rng: np.random.Generator,
    ground: FloatArray,
    accent: FloatArray,
    *,
    words: Sequence[str],
    brands: Sequence[str] = (),
    repeats: int = 2,
) -> FloatArray:
    """Draws a label (256, 512): a name (one of `brands`, else invented), content, emblem, fine print, bar code.

    The content repeats `repeats` times side by side, over a band, a wave, or nothing.
    """
    image = np.zeros((256, 512, 3)) + ground
    ink = np.array((0.95, 0.95, 0.93) if float(np.mean(ground)) < 0.55 else (0.1, 0.1, 0.12))
    if rng.random() < 0.65:
        rows, columns = np.indices((256, 512))
        swing = float(rng.choice([0.0, rng.uniform(8, 40)]))
        middle = rng.uniform(90, 230) + swing * np.sin(columns * 4 * np.pi / 512)
        blend(image, np.clip(rng.uniform(6, 40) - np.abs(rows - middle), 0, 1), accent)
    name = str(rng.choice(brands)) if brands else brand(rng)
    word = str(rng.choice(words)) if words else ""
    face, size, step = int(rng.integers(9)), int(rng.integers(50, 90)), 1.0 / repeats
    figure = emblem(size, rng)
    for left in np.arange(repeats) * step:
        low, high = left + 0.05 * step, left + 0.87 * step
        write_word(image, name, (0.08, low, 0.38, high), ink, face=face)
        if word:
            write_word(image, word, (0.40, low, 0.58, high), ink, face=face + 1)
        blend(image, figure, accent * 0.8, (158, int(512 * (low + high) / 2) - size // 2))
        small_print(image, rng, (0.92, low, 0.98, high), ink)
    bar_code(image, rng, (0.7, 1 - 0.11 * step, 0.9, 0.99))
    return image


_METALS: Final = ((0.84, 0.68, 0.25), (0.84, 0.68, 0.25), (0.8, 0.81, 0.83), (0.93, 0.9, 0.78), (0.62, 0.07, 0.08))
"""Colours of borders and crests: gold, silver, cream and dark red."""


def crest_label(
    rng: np.random.Generator, ground: FloatArray, accent: FloatArray, *, words: Sequence[str]
) -> FloatArray:
    """Draws a label of a beer (256, 512), twice side by side: bands, a crest, ears of barley, a name and a word."""
    image = np.zeros((256, 512, 3)) + ground
    metal = np.array(_METALS[int(rng.integers(len(_METALS)))])
    if np.abs(metal - ground).max() < 0.25:
        metal = accent if np.abs(accent - ground).max() > 0.3 else 1.0 - ground
    if rng.random() < 0.3:
        image *= np.linspace(rng.uniform(0.6, 1.1), rng.uniform(0.6, 1.1), 256)[:, None, None]
    _rims(image, rng, (metal, accent))
    inner = (ground, accent, np.array((0.95, 0.93, 0.86)), np.array((0.6, 0.05, 0.06)))[int(rng.integers(4))]
    name, word, face = brand(rng), str(rng.choice(words)), int(rng.integers(9))
    wide, tall, top = int(rng.integers(90, 190)), int(rng.integers(100, 180)), int(rng.integers(16, 60))
    outline, figure = _crest_outline(rng), emblem(int(rng.integers(40, 70)), rng)
    ears, ribbon, first = rng.random() < 0.5, rng.random() < 0.6, rng.random() < 0.5
    for left in (128, 384):
        if ears:
            for side in (-1, 1):
                _ear(image, (left + side * (wide // 2 + 14), 200), side, metal)
        for scale, colour in ((1.0, metal), (0.88, inner)):
            mask = _filled(outline, int(wide * scale), int(tall * scale))
            blend(image, mask, colour, (top + (tall - mask.shape[0]) // 2, left - mask.shape[1] // 2))
        ink = metal if np.abs(metal - inner).max() > 0.35 else np.where(np.mean(inner) > 0.5, 0.08, 0.94) * np.ones(3)
        blend(image, figure, ink, (top + 12, left - figure.shape[1] // 2))
        middle = (top + 0.62 * tall) / 256
        half = (0.62 if ribbon else 0.42) * wide / 512
        if ribbon:
            back = accent if rng.random() < 0.5 else metal
            box = (
                slice(int((middle - 0.09) * 256), int((middle + 0.09) * 256)),
                slice(int(left - half * 512), int(left + half * 512)),
            )
            image[box] = back
            ink = np.where(np.mean(back) > 0.5, 0.08, 0.94) * np.ones(3)
        lines = (name, word) if first else (word, name)
        place = left / 512
        write_word(image, lines[0], (middle - 0.08, place - half, middle + 0.08, place + half), ink, face=face)
        under = np.where(np.mean(ground) > 0.5, 0.08, 0.94) * np.ones(3) if (top + tall) < 215 else ink
        low = min((top + tall) / 256 + 0.01, 0.86)
        write_word(image, lines[1], (low, place - 0.13, low + 0.11, place + 0.13), under, face=face + 1)
    return np.clip(image, 0, 1)


def _rims(image: FloatArray, rng: np.random.Generator, colours: Sequence[FloatArray]) -> None:
    """Draws bands along the upper and the lower edge (in place)."""
    for upper in (True, False):
        at = 0
        for _ in range(int(rng.integers(0, 4))):
            thick, gap = int(rng.integers(2, 18)), int(rng.integers(2, 8))
            rows = slice(at, at + thick) if upper else slice(256 - at - thick, 256 - at)
            image[rows] = colours[int(rng.integers(len(colours)))]
            at += thick + gap


def _crest_outline(rng: np.random.Generator) -> FloatArray:
    """Outline in the unit square of a shield, an oval, a rosette, a diamond or a rectangle."""
    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    radius = np.full(64, 0.5) if rng.random() < 0.6 else 0.46 + 0.04 * np.cos(angle * int(rng.integers(8, 24)))
    round_one = np.column_stack([0.5 + radius * np.cos(angle), 0.5 + radius * np.sin(angle)])
    shield = np.array(_DECORATION["figures"][0])
    plain = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    diamond = np.array([[0.5, 0.0], [1.0, 0.5], [0.5, 1.0], [0.0, 0.5]])
    return (round_one, round_one, round_one, shield, shield, plain, diamond)[int(rng.integers(7))]


def _filled(outline: FloatArray, wide: int, tall: int) -> FloatArray:
    """Coverage (tall, wide) by an outline in the unit square."""
    canvas = np.zeros((tall * 2, wide * 2), np.uint8)
    cv2.fillPoly(canvas, [np.round(outline * (2 * wide - 1, 2 * tall - 1)).astype(np.int32)], 255)
    return np.asarray(cv2.resize(canvas, (wide, tall), interpolation=cv2.INTER_AREA) / 255.0)


def _ear(image: FloatArray, foot: tuple[int, int], side: int, colour: FloatArray) -> None:
    """Draws an ear of barley (in place) that bends outwards from its foot (column, row)."""
    mask = np.zeros(image.shape[:2], np.uint8)
    stalk = [(foot[0] + side * int(18 * (k / 10) ** 2), foot[1] - 11 * k) for k in range(11)]
    cv2.polylines(mask, [np.array(stalk)], False, 255, 2)
    for x, y in stalk[4:]:
        for turn in (-1, 1):
            cv2.ellipse(mask, (x + 5 * turn, y), (8, 3), -60 * turn, 0, 360, 255, -1)
    blend(image, mask / 255.0, colour)


def script_label(
    rng: np.random.Generator, ground: FloatArray, accent: FloatArray, *, words: Sequence[str], brands: Sequence[str]
) -> FloatArray:
    """Draws a label of a soft drink (256, 512), twice side by side: a large name that may run upwards, and a wave."""
    image = np.zeros((256, 512, 3)) + ground
    light = float(np.mean(ground)) > 0.55
    ink = (np.array((0.78, 0.04, 0.06)) if rng.random() < 0.7 else np.full(3, 0.08)) if light else np.full(3, 0.95)
    rows, columns = np.indices((256, 512))
    if rng.random() < 0.75:
        swing, shift = rng.uniform(10, 40), rng.uniform(0, 6.28)
        upright = rng.random() < 0.6
        along, across = (rows, columns % 256) if upright else (columns, rows)
        middle = rng.uniform(60, 200) + swing * np.sin(along * 4 * np.pi / 512 + shift)
        blend(image, np.clip(rng.uniform(4, 22) - np.abs(across - middle), 0, 1), ink if rng.random() < 0.6 else accent)
    name = str(rng.choice(brands)) if brands else brand(rng)
    word = str(rng.choice(words)) if words else ""
    face, up, thick = int(rng.integers(9)), rng.random() < 0.55, int(rng.integers(80, 150))
    for left in (0, 256):
        if up:
            mask = np.rot90(word_mask(name, (thick, 236), face=face))
            blend(image, mask, ink, (10, left + 100 - thick // 2))
        else:
            tall = int(rng.integers(70, 120))
            blend(image, word_mask(name, (tall, 220), face=face), ink, (int(rng.integers(20, 90)), left + 10))
        if word:
            blend(image, word_mask(word, (34, 90), face=face + 1), ink, (int(rng.integers(190, 216)), left + 150))
        small_print(image, rng, (0.3, (left + 222) / 512, 0.7, (left + 250) / 512), ink)
    return image
