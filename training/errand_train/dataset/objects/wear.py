"""Use leaves marks: scratches, dirt, rust and worn edges on pictures (H, W, 3; 0..1)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from errand_train.models.pictures import noise
from skills.robot import FloatArray


def plain(colour: ArrayLike, shape: tuple[int, int] = (128, 128)) -> FloatArray:
    """One colour all over."""
    return np.asarray(np.zeros((*shape, 3)) + np.asarray(colour, dtype=float))


def scratched(
    image: FloatArray, rng: np.random.Generator, amount: float, colour: ArrayLike = (0.75, 0.75, 0.75)
) -> FloatArray:
    """Fine lines through the paint; `amount` 0..1."""
    height, width = image.shape[:2]
    mask = np.zeros((height, width), np.uint8)
    for _ in range(int(amount * 40)):
        x, y = rng.uniform(0, width), rng.uniform(0, height)
        length, angle = rng.exponential(width / 8), rng.uniform(0, 2 * np.pi)
        end = (int(x + length * np.cos(angle)), int(y + length * np.sin(angle)))
        cv2.line(mask, (int(x), int(y)), end, int(rng.integers(60, 230)), 1, cv2.LINE_AA)
    share = mask[..., None] / 255.0
    return np.asarray(image * (1 - share) + share * np.asarray(colour, dtype=float))


def dirty(
    image: FloatArray, rng: np.random.Generator, amount: float, colour: ArrayLike = (0.22, 0.18, 0.13)
) -> FloatArray:
    """Cloudy dirt; `amount` 0..1."""
    height, width = image.shape[:2]
    clouds = noise(rng, (height, width), (height / 12, width / 12)) + 0.5 * noise(rng, (height, width), (2, 2))
    share = amount * np.clip((clouds - 0.6) * 0.5, 0, 1)[..., None]
    return np.asarray(image * (1 - share) + share * np.asarray(colour, dtype=float))


def uneven(image: FloatArray, rng: np.random.Generator, amount: float = 0.04) -> FloatArray:
    """Slight changes of brightness, as on any real surface."""
    height, width = image.shape[:2]
    field = noise(rng, (height, width), (height / 8, width / 8)) + 0.6 * noise(rng, (height, width), (0.8, 0.8))
    return np.asarray(image * (1 + amount * field)[..., None])


def used(image: FloatArray, rng: np.random.Generator, amount: float, bare: ArrayLike = (0.7, 0.7, 0.7)) -> FloatArray:
    """All of it at once; `amount` 0 (new) to 1 (old)."""
    return dirty(scratched(uneven(image, rng, 0.02 + 0.05 * amount), rng, amount, bare), rng, 0.7 * amount)


def brushed(rng: np.random.Generator, colour: ArrayLike, shape: tuple[int, int] = (128, 128)) -> FloatArray:
    """Metal brushed along the rows."""
    lines = noise(rng, shape, (0.6, 30)) + 0.5 * noise(rng, shape, (10, 40))
    return np.asarray(plain(colour, shape) * (1 + 0.07 * lines)[..., None])


def rusty(image: FloatArray, rng: np.random.Generator, amount: float) -> FloatArray:
    """Brown patches; `amount` 0..1."""
    height, width = image.shape[:2]
    field = noise(rng, (height, width), (height / 10, width / 10)) + 0.4 * noise(rng, (height, width), (1.5, 1.5))
    share = np.clip((field - 1.6 + 1.8 * amount) * 1.2, 0, 0.9)[..., None]
    rust = np.array([0.42, 0.22, 0.11]) * (1 + 0.15 * noise(rng, (height, width), (1, 1)))[..., None]
    return np.asarray(image * (1 - share) + share * rust)
