"""Simulated rooms, microphones and noises for training sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.signal import fftconvolve, resample_poly

from executive.speech.sound import RATE_HZ, Samples

__all__ = ["Conditions", "Heard", "hear"]

Sound = npt.NDArray[np.float64]
Draw = np.random.Generator

_LOUDEST, _SOFTEST = 0.95, 0.05


@dataclass(frozen=True)
class Conditions:
    """Acoustic conditions: the shares of sentences that are clean, and in a room with echo, the range of the
    signal-to-noise ratio (dB) of the others, and the range of pitch changes (1: none)."""

    clear: float = 0.3
    echoing: float = 0.35
    ratio_db: tuple[float, float] = (2.0, 24.0)
    voice_change: float = 1.18


@dataclass(frozen=True)
class Heard:
    """Clean and noisy samples of the same speech."""

    said: Samples
    heard: Samples


def hear(conditions: Conditions, speech: Samples, talkers: Sequence[Samples], draw: Draw) -> Heard:
    """Simulates speech by a microphone in a room with noise; `talkers` may speak in the background."""
    said = _another_voice(speech.astype(np.float64), conditions.voice_change, draw)
    said = np.pad(said, (int(draw.uniform(0.05, 0.5) * RATE_HZ), int(draw.uniform(0.1, 0.6) * RATE_HZ)))
    sound = _echoed(said, draw) if draw.random() < conditions.echoing else said
    if draw.random() < 0.5:
        sound = _coloured(sound, draw, most_db=8.0)
    if draw.random() >= conditions.clear:
        sound = _mixed(sound, _noise(len(sound), talkers, draw), draw.uniform(*conditions.ratio_db))
    loudness = float(np.exp(draw.uniform(np.log(_SOFTEST), np.log(_LOUDEST))))
    return Heard(_as_loud(said, _LOUDEST), _as_loud(sound, loudness))


def _as_loud(sound: Sound, peak: float) -> Samples:
    return (sound * (peak / max(float(np.abs(sound).max()), 1e-9))).astype(np.float32)


def _another_voice(sound: Sound, most: float, draw: Draw) -> Sound:
    """Played faster or slower by up to `most`: higher or deeper in pitch and in the resonances of the throat."""
    if draw.random() < 0.3:
        return sound
    faster = round(100.0 * most ** draw.uniform(-1.0, 1.0))
    changed: Sound = resample_poly(sound, 100, faster)
    return changed


def _echoed(sound: Sound, draw: Draw) -> Sound:
    """In a room: the way straight to the microphone, and noise that dies away within 0.1 to 0.5 s."""
    length_s = draw.uniform(0.1, 0.5)
    times_s = np.arange(int(length_s * RATE_HZ)) / RATE_HZ
    tail = draw.standard_normal(times_s.size) * 10.0 ** (-3.0 * times_s / length_s)
    tail[: int(draw.uniform(0.001, 0.01) * RATE_HZ)] = 0.0
    tail *= 10.0 ** (draw.uniform(-18.0, -2.0) / 20.0) / np.sqrt(np.sum(tail**2))
    tail[0] = 1.0
    echoed: Sound = fftconvolve(sound, tail)[: len(sound)]
    return echoed


def _coloured(sound: Sound, draw: Draw, *, most_db: float) -> Sound:
    """Some frequencies louder, some softer, as a microphone hears them; now and then with those of a telephone only."""
    spectrum = np.fft.rfft(sound)
    octaves = np.log2(np.linspace(1e-3, RATE_HZ / 2, len(spectrum)).clip(50.0) / 50.0)
    gains_db = np.interp(octaves, np.linspace(0.0, 7.4, 9), draw.uniform(-most_db, most_db, 9))
    if draw.random() < 0.15:
        frequencies_hz = 50.0 * 2.0**octaves
        gains_db = np.where((frequencies_hz < 250.0) | (frequencies_hz > 3600.0), gains_db - 30.0, gains_db)
    coloured: Sound = np.fft.irfft(spectrum * 10.0 ** (gains_db / 20.0), len(sound))
    return coloured


def _mixed(sound: Sound, noise: Sound, ratio_db: float) -> Sound:
    scale = np.std(sound) / max(float(np.std(noise)), 1e-9) / 10.0 ** (ratio_db / 20.0)
    mixed: Sound = sound + scale * noise
    return mixed


def _noise(count: int, talkers: Sequence[Samples], draw: Draw) -> Sound:
    """One kind of noise, or two of them together."""
    first = _one_noise(count, talkers, draw)
    if draw.random() < 0.7:
        return first
    second = _one_noise(count, talkers, draw)
    return first / max(float(np.std(first)), 1e-9) + draw.uniform(0.2, 1.0) * second / max(float(np.std(second)), 1e-9)


def _one_noise(count: int, talkers: Sequence[Samples], draw: Draw) -> Sound:
    kind = int(draw.choice(len(_NOISES) + 1, p=_SHARES))
    return _NOISES[kind](count, draw) if kind < len(_NOISES) else _babble(count, talkers, draw)


def _sloped(count: int, draw: Draw) -> Sound:
    """White, pink or brown noise, or one between; its power falls as the frequency to some power."""
    slope = float(draw.choice([0.0, 0.0, 0.5, 1.0, 1.0, 2.0, draw.uniform(-0.5, 2.0)]))
    spectrum = np.fft.rfft(draw.standard_normal(count))
    sloped: Sound = np.fft.irfft(spectrum / np.maximum(np.arange(len(spectrum)), 20.0) ** (slope / 2.0), count)
    return sloped


def _fan(count: int, draw: Draw) -> Sound:
    """Noise of a band, which swells a little."""
    swell = 1.0 + draw.uniform(0.0, 0.5) * np.sin(2.0 * np.pi * draw.uniform(0.3, 8.0) * np.arange(count) / RATE_HZ)
    return _coloured(draw.standard_normal(count), draw, most_db=20.0) * swell


def _hum(count: int, draw: Draw) -> Sound:
    """A tone with its harmonics, and some noise."""
    times_s = np.arange(count) / RATE_HZ
    base_hz = draw.choice([50.0, 60.0, 100.0, 120.0, draw.uniform(40.0, 400.0)])
    harmonics = np.arange(1, 20)
    heights = draw.random(harmonics.size) / harmonics ** draw.uniform(0.3, 1.5)
    tones = [
        h * np.sin(2.0 * np.pi * base_hz * n * times_s + draw.uniform(0.0, 6.0))
        for n, h in zip(harmonics, heights, strict=True)
    ]
    hum: Sound = np.sum(tones, axis=0) + draw.uniform(0.02, 0.5) * draw.standard_normal(count)
    return hum


def _clatter(count: int, draw: Draw) -> Sound:
    """Blows that ring and die away, over soft noise."""
    sound = 0.02 * _sloped(count, draw)
    sound *= 0.02 / max(float(np.std(sound)), 1e-9)
    for start in draw.integers(0, count, max(int(draw.uniform(1.0, 8.0) * count / RATE_HZ), 1)):
        times_s = np.arange(min(count - start, RATE_HZ // 4)) / RATE_HZ
        ringing = np.sin(2.0 * np.pi * draw.uniform(200.0, 6000.0) * times_s) + draw.standard_normal(times_s.size)
        sound[start : start + times_s.size] += (
            draw.uniform(0.2, 1.0) * ringing * np.exp(-times_s / draw.uniform(0.004, 0.06))
        )
    return sound


def _babble(count: int, talkers: Sequence[Samples], draw: Draw) -> Sound:
    """Three to eight voices at once, each from another moment on."""
    chosen = draw.integers(len(talkers), size=draw.integers(3, 9))
    rolled = [np.roll(np.resize(talkers[n], count), draw.integers(count)) for n in chosen]
    voices: Sound = np.sum([voice / max(float(np.std(voice)), 1e-9) for voice in rolled], axis=0)
    return voices


_NOISES: Final = (_sloped, _fan, _hum, _clatter)
_SHARES: Final = (0.44, 0.14, 0.07, 0.07, 0.28)
