"""Photometric augmentation: other cameras, lights and lenses. Pure functions of a picture and a random source."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
_GREY_SHARE: Final = 0.2
_DARK: Final = 60.0
_LUMA: Final = np.array([0.299, 0.587, 0.114], dtype=np.float32)


def change_photometry(picture: Picture, random: np.random.Generator) -> Picture:
    """Changes light and colours of a picture (H, W, 3), sometimes to grey, blurred, noisy or partly covered."""
    changed = _toned(_recoloured(picture, random), random)
    if random.random() < 0.15:
        changed = _blurred(changed, random)
    if random.random() < 0.25:
        changed = _noisy(changed, random)
    if random.random() < 0.2:
        changed = _covered(changed, random)
    return changed


def _recoloured(picture: Picture, random: np.random.Generator) -> Picture:
    """Mixed towards grey or away from it, hues turned a little, and a tint: one 3x3 matrix on RGB."""
    saturation = 0.0 if random.random() < _GREY_SHARE else random.uniform(0.4, 1.5)
    grey = np.tile(_LUMA, (3, 1))
    matrix = saturation * _hue_turn(random.normal(0.0, 0.12)) + (1.0 - saturation) * grey
    if saturation > 0.0:
        matrix = np.diag(random.uniform(0.85, 1.15, 3)).astype(np.float32) @ matrix
    return np.asarray(cv2.transform(picture, matrix.astype(np.float32)), dtype=np.uint8)


def _hue_turn(angle_rad: float) -> NDArray[np.float32]:
    """Turns colours about the axis of greys."""
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    third, root = (1.0 - cosine) / 3.0, sine / np.sqrt(3.0)
    row = [cosine + third, third - root, third + root]
    return np.array([row, row[-1:] + row[:-1], row[1:] + row[:1]], dtype=np.float32)


def _toned(picture: Picture, random: np.random.Generator) -> Picture:
    """Other exposure, contrast and gamma: one table."""
    gamma, gain = np.exp(random.normal(0.0, 0.2)), np.exp(random.normal(0.0, 0.2))
    dark = float(picture[::8, ::8].mean()) < _DARK
    gamma, gain = (min(gamma, 1.0), max(gain, 1.0)) if dark else (gamma, gain)
    contrast, middle = random.uniform(0.7, 1.2), 30.0 if dark else random.uniform(80.0, 150.0)
    values = 255.0 * (np.arange(256) / 255.0) ** gamma * gain
    table = np.clip((values - middle) * contrast + middle, 0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(picture, table), dtype=np.uint8)


def _blurred(picture: Picture, random: np.random.Generator) -> Picture:
    if random.random() < 0.5:
        return np.asarray(cv2.GaussianBlur(picture, (0, 0), random.uniform(0.5, 1.6)), dtype=np.uint8)
    length = int(random.integers(3, 9))
    kernel = np.zeros((length, length), dtype=np.float32)
    angle = random.uniform(0, np.pi)
    steps = np.linspace(-0.5, 0.5, 4 * length) * (length - 1)
    middle = (length - 1) / 2
    kernel[np.rint(middle + steps * np.sin(angle)).astype(int), np.rint(middle + steps * np.cos(angle)).astype(int)] = 1
    return np.asarray(cv2.filter2D(picture, -1, kernel / kernel.sum()), dtype=np.uint8)


def _noisy(picture: Picture, random: np.random.Generator) -> Picture:
    """Grain, the same in all channels or in each of its own, made from one small tile."""
    height, width = picture.shape[:2]
    channels = 1 if random.random() < 0.5 else 3
    tile = random.normal(0.0, random.uniform(2.0, 12.0), (96, 128, channels)).astype(np.int16)
    repeats = (-(-height // 96), -(-width // 128), 3 // channels)
    grain = np.tile(tile, repeats)[:height, :width]
    return np.asarray(np.clip(picture.astype(np.int16) + grain, 0, 255), dtype=np.uint8)


def _covered(picture: Picture, random: np.random.Generator) -> Picture:
    """Some patches of one colour, small beside the picture."""
    changed = picture.copy()
    height, width = picture.shape[:2]
    for _ in range(int(random.integers(1, 6))):
        w, h = (int(size * random.uniform(0.02, 0.12)) + 1 for size in (width, height))
        x, y = int(random.integers(0, width - w)), int(random.integers(0, height - h))
        changed[y : y + h, x : x + w] = random.integers(0, 256, 3)
    return changed
