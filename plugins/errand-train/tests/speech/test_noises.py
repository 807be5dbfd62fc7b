"""What training sentences are heard through."""

import numpy as np
import pytest

from errand_train.speech.noises import Conditions, hear
from tests.executive.speech.made_speech import tone

SPEECH = tone(1.5, height=0.5)
TALKERS = [tone(1.0, height=0.3), tone(0.7, height=0.3), tone(2.0, height=0.3)]
PLAIN = Conditions(clear=1.0, echoing=0.0, voice_change=1.0)


def _drawn(conditions, seeds=range(30)):
    return [hear(conditions, SPEECH, TALKERS, np.random.default_rng(seed)) for seed in seeds]


def test_both_sounds_last_equally_long_and_stay_within_full_scale():
    for both in _drawn(Conditions()):
        assert both.heard.shape == both.said.shape and both.heard.dtype == np.float32
        assert np.isfinite(both.heard).all() and np.abs(both.heard).max() < 1.0


def test_a_clear_sentence_is_as_silent_before_as_it_was_said():
    for both in _drawn(PLAIN):
        assert np.abs(both.said[: len(tone(0.02))]).max() == 0.0
        assert np.abs(both.heard[: len(tone(0.02))]).max() < 0.02


#   ratio of speech to noise (dB)    power while nobody speaks, compared with that of the whole (dB)
RATIOS = {0.0: (-7.0, 0.0), 20.0: (-27.0, -17.0)}


@pytest.mark.parametrize(("ratio_db", "between_db"), RATIOS.items())
def test_noise_is_as_strong_as_it_should_be(ratio_db, between_db):
    noisy = Conditions(clear=0.0, echoing=0.0, ratio_db=(ratio_db, ratio_db), voice_change=1.0)
    levels = [np.mean(b.heard[: len(tone(0.05))] ** 2) / np.mean(b.heard**2) for b in _drawn(noisy, range(24))]
    low_db, high_db = between_db
    assert low_db < 10.0 * np.log10(np.median(levels)) < high_db


def test_voices_are_made_higher_and_deeper():
    lengths = {len(hear(Conditions(), SPEECH, TALKERS, np.random.default_rng(n)).said) for n in range(20)}
    assert len(lengths) > 10


def test_the_same_draw_gives_the_same_sound():
    first, second = (hear(Conditions(), SPEECH, TALKERS, np.random.default_rng(4)) for _ in range(2))
    np.testing.assert_array_equal(first.heard, second.heard)
