"""Procedural pictures: periodic noise, wood, cloth, speckle; RGB uint8 arrays."""

from __future__ import annotations

import numpy as np

from skills.robot import FloatArray, Picture

Colour = tuple[float, float, float]


def noise(rng: np.random.Generator, shape: tuple[int, int], sigma: tuple[float, float]) -> FloatArray:
    """Draws smooth periodic noise of zero mean and unit deviation, (H, W).

    `sigma` is the blur along rows and columns in pixels.
    """
    frequencies = np.fft.fftfreq(shape[0])[:, None], np.fft.fftfreq(shape[1])[None, :]
    exponent = sum((2 * np.pi * f * s) ** 2 for f, s in zip(frequencies, sigma, strict=True)) / 2
    field = np.fft.ifft2(np.fft.fft2(rng.standard_normal(shape)) * np.exp(-exponent)).real
    field -= field.mean()
    return np.asarray(field / (field.std() + 1e-12))


def shade(colour: Colour, brightness: FloatArray) -> FloatArray:
    """Multiplies a colour (0..1) by a brightness picture: (H, W, 3)."""
    return np.asarray(np.array(colour) * brightness[..., None])


def to_picture(values: FloatArray, levels: int = 64) -> Picture:
    """Converts RGB values in 0..1 to uint8, in few levels so that the file stays small."""
    steps = np.round(np.clip(values, 0, 1) * (levels - 1)) / (levels - 1)
    return np.asarray(np.round(steps * 255), dtype=np.uint8)


def wood(rng: np.random.Generator, shape: tuple[int, int], colour: Colour, contrast: float = 0.10) -> FloatArray:
    """Draws wood whose grain runs along the columns' direction (horizontally): values (H, W, 3)."""
    rings = noise(rng, shape, (5, 90))
    lines = np.sin(rings * 7 + noise(rng, shape, (12, 160)) * 2)
    fibres = noise(rng, shape, (0.7, 14))
    brightness = 1 + contrast * (0.5 * lines + 0.35 * fibres + 0.2 * noise(rng, shape, (40, 120)))
    return shade(colour, brightness)


def cloth(rng: np.random.Generator, shape: tuple[int, int], colour: Colour, contrast: float = 0.08) -> FloatArray:
    """Draws woven cloth: values (H, W, 3)."""
    rows, columns = np.indices(shape)
    weave = np.sin(rows * np.pi / 2) * np.sin(columns * np.pi / 2)
    brightness = 1 + contrast * (0.5 * weave + 0.5 * noise(rng, shape, (0.8, 0.8)) + 0.2 * noise(rng, shape, (20, 20)))
    return shade(colour, brightness)


def speckle(rng: np.random.Generator, shape: tuple[int, int], colour: Colour, contrast: float = 0.05) -> FloatArray:
    """Draws stone, plaster or concrete: values (H, W, 3)."""
    brightness = 1 + contrast * (0.5 * noise(rng, shape, (1, 1)) + 0.5 * noise(rng, shape, (25, 25)))
    return shade(colour, brightness)
