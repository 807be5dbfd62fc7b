"""Wear on pictures (H, W, 3; 0..1): scratches, dirt, rust and worn edges."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from errand_train.models.pictures import noise
from skills.robot import FloatArray


def plain_picture(colour: ArrayLike, shape: tuple[int, int] = (128, 128)) -> FloatArray:
    """Makes a picture of one colour."""
    return np.asarray(np.zeros((*shape, 3)) + np.asarray(colour, dtype=float))


def add_scratches(
    image: FloatArray, rng: np.random.Generator, amount: float, colour: ArrayLike = (0.75, 0.75, 0.75)
) -> FloatArray:
    """Adds fine scratches to the paint; `amount` 0..1."""
    height, width = image.shape[:2]
    mask = np.zeros((height, width), np.uint8)
    for _ in range(int(amount * 40)):
        x, y = rng.uniform(0, width), rng.uniform(0, height)
        length, angle = rng.exponential(width / 8), rng.uniform(0, 2 * np.pi)
        end = (int(x + length * np.cos(angle)), int(y + length * np.sin(angle)))
        cv2.line(mask, (int(x), int(y)), end, int(rng.integers(60, 230)), 1, cv2.LINE_AA)
    share = mask[..., None] / 255.0
    return np.asarray(image * (1 - share) + share * np.asarray(colour, dtype=float))


def add_dirt(
    image: FloatArray, rng: np.random.Generator, amount: float, colour: ArrayLike = (0.22, 0.18, 0.13)
) -> FloatArray:
    """Adds cloudy dirt; `amount` 0..1."""
    height, width = image.shape[:2]
    clouds = noise(rng, (height, width), (height / 12, width / 12)) + 0.5 * noise(rng, (height, width), (2, 2))
    share = amount * np.clip((clouds - 0.6) * 0.5, 0, 1)[..., None]
    return np.asarray(image * (1 - share) + share * np.asarray(colour, dtype=float))


def add_unevenness(image: FloatArray, rng: np.random.Generator, amount: float = 0.04) -> FloatArray:
    """Adds slight changes of brightness, as on any real surface."""
    height, width = image.shape[:2]
    field = noise(rng, (height, width), (height / 8, width / 8)) + 0.6 * noise(rng, (height, width), (0.8, 0.8))
    return np.asarray(image * (1 + amount * field)[..., None])


def add_wear(
    image: FloatArray, rng: np.random.Generator, amount: float, bare: ArrayLike = (0.7, 0.7, 0.7)
) -> FloatArray:
    """Adds unevenness, scratches and dirt; `amount` 0 (new) to 1 (old)."""
    return add_dirt(
        add_scratches(add_unevenness(image, rng, 0.02 + 0.05 * amount), rng, amount, bare), rng, 0.7 * amount
    )


def brushed_metal(rng: np.random.Generator, colour: ArrayLike, shape: tuple[int, int] = (128, 128)) -> FloatArray:
    """Makes a picture of metal brushed along the rows."""
    lines = noise(rng, shape, (0.6, 30)) + 0.5 * noise(rng, shape, (10, 40))
    return np.asarray(plain_picture(colour, shape) * (1 + 0.07 * lines)[..., None])


def add_rust(image: FloatArray, rng: np.random.Generator, amount: float) -> FloatArray:
    """Adds rusty patches; `amount` 0..1."""
    height, width = image.shape[:2]
    field = noise(rng, (height, width), (height / 10, width / 10)) + 0.4 * noise(rng, (height, width), (1.5, 1.5))
    share = np.clip((field - 1.6 + 1.8 * amount) * 1.2, 0, 0.9)[..., None]
    rust = np.array([0.42, 0.22, 0.11]) * (1 + 0.15 * noise(rng, (height, width), (1, 1)))[..., None]
    return np.asarray(image * (1 - share) + share * rust)
