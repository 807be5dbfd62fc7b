"""A library of surfaces by role and number: floors, walls, furniture, cloths, pictures.

A number gives the same picture always; every fourth number is held out from training, as with instances.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import cv2
import numpy as np
from numpy.typing import NDArray

from errand_train.dataset.objects.model import held_out
from errand_train.models.pictures import cloth, noise, speckle, to_picture, wood
from skills.robot import FloatArray, Picture

TEXTURES = 1024
"""Number of textures of each role."""
VALIDATION_BELOW = 64
"""Validation takes held-out textures below this number, so that its pictures stay the same when more are added."""
SIZE_PX = 256

Maker = Callable[[np.random.Generator], FloatArray]


def numbers(*, for_training: bool) -> list[int]:
    """Numbers of the textures for training, or for validation. Every fourth number is held out from training."""
    count = TEXTURES if for_training else VALIDATION_BELOW
    return [number for number in range(count) if held_out(number) != for_training]


def texture(role: str, number: int) -> Picture:
    """Draws the picture of a role ("floor", "wall", "ceiling", "wood", "cloth", "picture", "outside") by its number.

    Raises KeyError for another role.
    """
    makers = _MAKERS[role]
    rng = np.random.default_rng([number, *role.encode()])
    return to_picture(makers[int(rng.integers(len(makers)))](rng), 128)


def _colour(rng: np.random.Generator, low: float, high: float, saturation: float) -> tuple[float, float, float]:
    """A colour of a brightness between two and at most a saturation."""
    hue, value = float(rng.uniform(0, 180)), float(rng.uniform(low, high))
    hsv = np.array([[[hue, 255 * rng.uniform(0, saturation), 255 * value]]], dtype=np.uint8)
    r, g, b = (float(v) / 255 for v in cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)[0, 0])
    return (r, g, b)


def _wood_colour(rng: np.random.Generator) -> tuple[float, float, float]:
    tones = (
        (0.80, 0.62, 0.42),
        (0.62, 0.44, 0.28),
        (0.40, 0.27, 0.18),
        (0.88, 0.78, 0.62),
        (0.55, 0.52, 0.48),
        (0.52, 0.24, 0.14),
    )
    r, g, b = np.clip(np.array(tones[int(rng.integers(len(tones)))]) * rng.uniform(0.85, 1.15), 0, 1)
    return (float(r), float(g), float(b))


def _square() -> tuple[int, int]:
    return (SIZE_PX, SIZE_PX)


def _planks(rng: np.random.Generator) -> FloatArray:
    rows = int(rng.choice([4, 6, 8, 10]))
    colour, contrast, tall = _wood_colour(rng), float(rng.uniform(0.03, 0.10)), SIZE_PX // rows
    image = np.zeros((SIZE_PX, SIZE_PX, 3))
    for row in range(rows):
        plank = wood(rng, (4 * tall, SIZE_PX), colour, contrast)[:tall]
        joint = int(rng.integers(SIZE_PX))
        left, right = 1 + 0.06 * rng.standard_normal(2)
        plank *= np.where(np.arange(SIZE_PX) < joint, left, right)[None, :, None]
        plank[:, joint : joint + 2] *= 0.7
        plank[-1:] *= 0.65
        image[row * tall : (row + 1) * tall] = plank
    return image


def _tiles(rng: np.random.Generator) -> FloatArray:
    count = int(rng.choice([2, 4, 8]))
    edge = SIZE_PX // count
    tone = 1 + float(rng.uniform(0.0, 0.06)) * rng.standard_normal((count, count))
    image = speckle(rng, _square(), _colour(rng, 0.3, 0.95, 0.35), float(rng.uniform(0.01, 0.05)))
    image = image * tone.repeat(edge, 0).repeat(edge, 1)[..., None]
    lines = np.arange(SIZE_PX) % edge < int(rng.integers(1, 4))
    grout = _colour(rng, 0.3, 0.85, 0.1)
    image[lines, :] = grout
    image[:, lines] = grout
    return np.asarray(image)


def _checker(rng: np.random.Generator) -> FloatArray:
    edge = int(rng.choice([32, 64, 128]))
    rows, columns = np.indices(_square())
    dark = ((rows // edge + columns // edge) % 2).astype(bool)
    image = speckle(rng, _square(), _colour(rng, 0.6, 0.95, 0.3), 0.02)
    image[dark] = speckle(rng, _square(), _colour(rng, 0.08, 0.5, 0.5), 0.03)[dark]
    return image


def _concrete(rng: np.random.Generator) -> FloatArray:
    image = speckle(rng, _square(), _colour(rng, 0.3, 0.75, 0.1), float(rng.uniform(0.03, 0.10)))
    stains = np.clip(noise(rng, _square(), (30, 30)) - 1, 0, 1)[..., None]
    return np.asarray(image * (1 - float(rng.uniform(0, 0.35)) * stains))


def _plaster(rng: np.random.Generator) -> FloatArray:
    return speckle(rng, _square(), _colour(rng, 0.45, 0.98, 0.35), float(rng.uniform(0.005, 0.04)))


def _wallpaper(rng: np.random.Generator) -> FloatArray:
    image = speckle(rng, _square(), _colour(rng, 0.5, 0.95, 0.4), 0.01)
    rows, columns = np.indices(_square())
    second = np.array(_colour(rng, 0.3, 0.95, 0.5))
    period = int(rng.choice([16, 32, 64]))
    if rng.random() < 0.5:
        image[columns % period < period // int(rng.integers(2, 6))] = second
    else:
        apart = (rows % period - period / 2) ** 2 + (columns % period - period / 2) ** 2
        image[apart < (period * rng.uniform(0.1, 0.3)) ** 2] = second
    return image


def _brick(rng: np.random.Generator) -> FloatArray:
    rows, columns = np.indices(_square())
    tall, long = 32, 64
    course = rows // tall
    shifted = (columns + (course % 2) * long // 2) % SIZE_PX
    tone = 1 + 0.10 * rng.standard_normal((8, 4))
    image = speckle(rng, _square(), _colour(rng, 0.35, 0.85, 0.6), 0.06) * tone[course, shifted // long][..., None]
    mortar = (rows % tall < 3) | (shifted % long < 3)
    image[mortar] = _colour(rng, 0.5, 0.85, 0.1)
    return np.asarray(image)


def _panels(rng: np.random.Generator) -> FloatArray:
    return np.asarray(np.rot90(_planks(rng)))


def _grain(rng: np.random.Generator) -> FloatArray:
    return wood(rng, _square(), _wood_colour(rng), float(rng.uniform(0.03, 0.12)))


def _laminate(rng: np.random.Generator) -> FloatArray:
    return speckle(rng, _square(), _colour(rng, 0.08, 0.96, 0.5), float(rng.uniform(0.0, 0.06)))


def _stone(rng: np.random.Generator) -> FloatArray:
    image = speckle(rng, _square(), _colour(rng, 0.15, 0.9, 0.2), 0.08)
    veins = np.abs(noise(rng, _square(), (14, 14)))[..., None] < 0.06
    return np.asarray(np.where(veins, image * rng.uniform(0.6, 1.5), image))


def _woven(rng: np.random.Generator) -> FloatArray:
    image = cloth(rng, _square(), _colour(rng, 0.12, 0.92, 0.6), float(rng.uniform(0.06, 0.2)))
    if rng.random() < 0.35:
        rows, columns = np.indices(_square())
        image[(columns // int(rng.integers(8, 40))) % 2 == 0] *= float(rng.uniform(0.6, 0.9))
        if rng.random() < 0.4:
            image[(rows // int(rng.integers(8, 40))) % 2 == 0] *= float(rng.uniform(0.6, 0.9))
    return image


def _abstract(rng: np.random.Generator) -> FloatArray:
    bands = np.digitize(noise(rng, _square(), (float(rng.uniform(6, 40)), float(rng.uniform(6, 40)))), [-0.8, 0.0, 0.9])
    image = np.array([_colour(rng, 0.1, 0.95, 0.8) for _ in range(4)])[bands]
    return _framed(rng, image * (1 + 0.04 * noise(rng, _square(), (1, 1)))[..., None])


def _landscape(rng: np.random.Generator) -> FloatArray:
    rows = np.linspace(0, 1, SIZE_PX)
    image = (1 - rows)[:, None, None] * np.array(_colour(rng, 0.6, 0.95, 0.5)) + rows[:, None, None] * np.array(
        _colour(rng, 0.6, 0.95, 0.4)
    )
    image = np.broadcast_to(image, (*_square(), 3)).copy()
    for k in range(3):
        ridge = 0.4 + 0.15 * k + 0.06 * noise(rng, (1, SIZE_PX), (1, 25))[0]
        image[rows[:, None] > ridge[None, :]] = np.array(_colour(rng, 0.2, 0.7, 0.6)) * (1 - 0.15 * k)
    return _framed(rng, image)


def _framed(rng: np.random.Generator, image: FloatArray) -> FloatArray:
    for width, colour in (
        (int(rng.integers(0, 40)), (0.95, 0.95, 0.93)),
        (int(rng.integers(0, 14)), _colour(rng, 0.05, 0.9, 0.6)),
    ):
        if width:
            image[:width], image[-width:], image[:, :width], image[:, -width:] = colour, colour, colour, colour
    return np.asarray(image)


def _view_outside(rng: np.random.Generator) -> FloatArray:
    """A window: frame, bars, and what is behind."""
    bright = float(rng.uniform(0.35, 1.0))
    image = np.clip(_landscape(rng) * bright * 1.3, 0, 1)
    frame = _colour(rng, 0.2, 0.95, 0.2)
    bars: NDArray[np.int64] = np.linspace(0, SIZE_PX - 12, int(rng.integers(2, 4))).astype(int)
    for at in bars:
        image[:, at : at + 12] = frame
    for at in (0, SIZE_PX - 12, *((SIZE_PX // 2,) if rng.random() < 0.4 else ())):
        image[at : at + 12] = frame
    return np.asarray(image)


def _door(rng: np.random.Generator) -> FloatArray:
    image = _grain(rng) if rng.random() < 0.5 else _laminate(rng)
    for top, bottom in ((20, 110), (130, 236)):
        image[top:bottom, 40:216] *= 0.9
        image[top + 6 : bottom - 6, 48:208] *= 1.1
    image[118:126, 220:246] = float(rng.uniform(0.3, 0.9))
    return np.asarray(image)


_MAKERS: Mapping[str, tuple[Maker, ...]] = {
    "floor": (_planks, _tiles, _checker, _woven, _concrete, _laminate),
    "wall": (_plaster, _plaster, _plaster, _wallpaper, _brick, _panels, _tiles, _concrete),
    "ceiling": (_plaster, _plaster, _panels, _concrete),
    "wood": (_grain, _grain, _laminate, _laminate, _stone),
    "cloth": (_woven,),
    "picture": (_abstract, _landscape, _wallpaper),
    "outside": (_view_outside,),
    "door": (_door,),
}
ROLES: tuple[str, ...] = tuple(_MAKERS)
