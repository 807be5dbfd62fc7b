import numpy as np

from executive.speech.denoise import less_noisy
from executive.testing.speech import silence, tone


def _power(sound):
    return float(np.mean(np.square(sound)))


def test_steady_noise_is_taken_down_and_the_voice_is_kept():
    clear = np.concatenate([silence(1.0), tone(1.0), silence(1.0)])
    noise = np.random.default_rng(1).standard_normal(len(clear)).astype(np.float32) * 0.05
    quieter = less_noisy(clear + noise)
    pause, voice = slice(2_000, 14_000), slice(18_000, 30_000)
    assert _power(quieter[pause]) < 0.1 * _power(noise[pause])
    assert _power(quieter[voice] - clear[voice]) < 0.3 * _power(noise[voice])


def test_length_and_kind_stay_as_they_are():
    for count in (10, 511, 512, 16_001):
        sound = tone(2.0)[:count]
        assert less_noisy(sound).shape == sound.shape
        assert less_noisy(sound).dtype == np.float32


def test_silence_stays_silent():
    assert not less_noisy(silence(1.0)).any()
