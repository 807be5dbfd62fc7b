"""Noise for sound: white, pink and babble, at a ratio of speech to noise in decibels."""

from collections.abc import Sequence

import numpy as np


def white(count: int, draw: np.random.Generator) -> np.ndarray:
    """As strong at all frequencies."""
    return draw.standard_normal(count)


def pink(count: int, draw: np.random.Generator) -> np.ndarray:
    """Its power falls as one over the frequency."""
    spectrum = np.fft.rfft(draw.standard_normal(count))
    return np.fft.irfft(spectrum / np.sqrt(np.maximum(np.arange(len(spectrum)), 1)), count)


def babble(count: int, draw: np.random.Generator, talkers: Sequence[np.ndarray]) -> np.ndarray:
    """Several voices at once, each from another moment on."""
    rolled = [np.roll(np.resize(talker, count), draw.integers(count)) for talker in talkers]
    return np.sum([sound / max(np.std(sound), 1e-9) for sound in rolled], axis=0)


def mixed(speech: np.ndarray, noise: np.ndarray, ratio_db: float) -> np.ndarray:
    """The speech (-1 to 1) with noise so strong that the mean power of the speech lies `ratio_db` above it."""
    scale = np.std(speech) / max(np.std(noise), 1e-12) / 10 ** (ratio_db / 20)
    sum_ = speech + scale * noise
    return sum_ / max(1.0, float(np.max(np.abs(sum_))) / 0.99)
