"""Sound with its steady noise taken down."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.signal import istft, lfilter, stft

from executive.speech.sound import RATE_HZ, Samples

__all__ = ["less_noisy"]

Powers = npt.NDArray[np.float64]

_WINDOW: Final = 512
_STEP: Final = 128
_SMOOTHING: Final = 0.7
_QUIET_SHARE: Final = 20.0
_QUIET_TO_MEAN: Final = 1.5
_MEMORY: Final = 0.9
_LEAST_GAIN: Final = 0.15


def less_noisy(sound: Samples) -> Samples:
    """The sound with each frequency turned down while it holds little more than noise.

    The gains are Wiener's, from the ratio of speech to noise as estimated by the decision-directed rule (Ephraim and
    Malah, "Speech enhancement using a minimum mean-square error short-time spectral amplitude estimator", 1984); the
    noise is what each frequency has in its quietest moments (Stahl, Fischer and Bippus, "Quantile based noise
    estimation for spectral subtraction and Wiener filtering", 2000).
    """
    if len(sound) < _WINDOW:
        return sound
    overlap = _WINDOW - _STEP
    spectrum = stft(sound, RATE_HZ, nperseg=_WINDOW, noverlap=overlap)[2]
    powers = np.square(np.abs(spectrum))
    quieter = istft(spectrum * _gains(powers, _noise(powers)), RATE_HZ, nperseg=_WINDOW, noverlap=overlap)[1]
    return np.asarray(quieter[: len(sound)], np.float32)


def _noise(powers: Powers) -> Powers:
    """The mean power of the noise at each frequency, from the quietest fifth of the moments."""
    smooth = lfilter([1.0 - _SMOOTHING], [1.0, -_SMOOTHING], powers, axis=1)
    noise: Powers = np.maximum(np.percentile(smooth, _QUIET_SHARE, axis=1) * _QUIET_TO_MEAN, 1e-12)
    return noise


def _gains(powers: Powers, noise: Powers) -> Powers:
    """The gain at each frequency (row) and moment (column)."""
    gains = np.empty_like(powers)
    before = np.zeros_like(noise)
    for moment in range(powers.shape[1]):
        excess = np.maximum(powers[:, moment] / noise - 1.0, 0.0)
        ratio = _MEMORY * before + (1.0 - _MEMORY) * excess
        gain = ratio / (1.0 + ratio)
        before = np.square(gain) * powers[:, moment] / noise
        gains[:, moment] = np.maximum(gain, _LEAST_GAIN)
    return gains
