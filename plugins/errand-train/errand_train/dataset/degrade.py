"""Camera effects on a clean picture: exposure, colour, motion blur, defocus, vignette, grain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.robot import Picture

FloatPicture = NDArray[np.float32]


@dataclass(frozen=True)
class Degradation:
    """Degradation of one picture; lengths in pixels of a picture 640 wide, noise in counts of 255."""

    mean: float
    gamma: float
    saturation: float
    balance: tuple[float, float, float]
    motion_px: float
    motion_rad: float
    defocus_px: float
    vignette: float
    grain: float
    quality: int

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draws a degradation from nearly clean to poor."""
        blurred = rng.random() < 0.25
        return cls(
            mean=float(np.clip(rng.normal(114, 32), 50, 205)),
            gamma=float(np.exp(rng.normal(0, 0.12))),
            saturation=float(rng.uniform(0.6, 1.25)),
            balance=(float(rng.normal(1, 0.05)), 1.0, float(rng.normal(1, 0.05))),
            motion_px=float(rng.uniform(2, 13)) if blurred else 0.0,
            motion_rad=float(rng.uniform(0, np.pi)),
            defocus_px=float(max(0.0, rng.normal(0.5, 0.35))),
            vignette=float(rng.uniform(0.0, 0.3)),
            grain=float(np.exp(rng.normal(np.log(2.6), 0.6))),
            quality=int(rng.integers(84, 98)),
        )


def degrade(clean: Picture, how: Degradation, rng: np.random.Generator, *, grey: bool) -> Picture:
    """Degrades a picture (H, W, 3); returns (H, W) when grey."""
    image = expose(clean.astype(np.float32), how.mean, how.gamma)
    scale = clean.shape[1] / 640.0
    image = _blurred(image, how, scale)
    height, width = clean.shape[:2]
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    off = ((x - width / 2) ** 2 + (y - height / 2) ** 2) / ((width / 2) ** 2 + (height / 2) ** 2)
    image *= (1.0 - how.vignette * off)[..., None]
    if grey:
        plain = image @ np.array([0.299, 0.587, 0.114], dtype=np.float32)
        return _counts(plain + how.grain * rng.standard_normal(plain.shape, dtype=np.float32))
    image = _tinted(image, how)
    grain = how.grain * rng.standard_normal(image.shape, dtype=np.float32)
    return _counts(image + grain * (0.6 + 0.8 * (image / 255.0)))


def expose(image: FloatPicture, mean: float, gamma: float = 1.0) -> FloatPicture:
    """Scales brightness (0 to 255) to a mean, as automatic exposure does."""
    gain = float(np.clip(mean / max(float(image.mean()), 1.0), 0.35, 8.0))
    lit = 255.0 * np.clip(image * gain / 255.0, 0, 1) ** gamma
    return np.asarray(lit, dtype=np.float32)


def _tinted(image: FloatPicture, how: Degradation) -> FloatPicture:
    grey = image.mean(axis=2, keepdims=True)
    return np.asarray(
        (grey + how.saturation * (image - grey)) * np.array(how.balance, dtype=np.float32), dtype=np.float32
    )


def _blurred(image: FloatPicture, how: Degradation, scale: float) -> FloatPicture:
    if how.defocus_px * scale > 0.25:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), how.defocus_px * scale), dtype=np.float32)
    length = how.motion_px * scale
    if length < 1.5:
        return image
    size = 2 * int(np.ceil(length / 2)) + 1
    kernel, middle = np.zeros((size, size), np.float32), size // 2
    step = np.array([np.cos(how.motion_rad), np.sin(how.motion_rad)]) * length / 2
    ends = [(round(float(middle + s * step[0])), round(float(middle + s * step[1]))) for s in (-1, 1)]
    cv2.line(kernel, ends[0], ends[1], 1.0, 1, cv2.LINE_AA)
    return np.asarray(cv2.filter2D(image, -1, kernel / kernel.sum()), dtype=np.float32)


def _counts(image: FloatPicture) -> Picture:
    return np.asarray(np.clip(np.round(image), 0, 255), dtype=np.uint8)
