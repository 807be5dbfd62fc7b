import numpy as np
import pytest
from made_speech import silence, tone

from executive.speech.sound import Loudness, joined, level_db


def test_silence_is_told_from_a_soft_voice():
    assert Loudness().with_block(silence(1.0)).silent
    assert not Loudness().with_block(tone(1.0, height=0.01)).silent


def test_flat_tops_at_full_scale_are_clipped():
    loud = np.clip(tone(1.0) * 4, -1.0, 1.0)
    assert Loudness().with_block(loud).much_clipped
    assert not Loudness().with_block(tone(1.0, height=0.95)).much_clipped


def test_single_samples_at_full_scale_are_not_clipped():
    peaks = tone(1.0, height=0.5)
    peaks[::100] = 1.0
    assert Loudness().with_block(peaks).clipped == 0


def test_blocks_add_up():
    whole, halves = tone(1.0), np.array_split(tone(1.0), 2)
    assert Loudness().with_block(halves[0]).with_block(halves[1]) == Loudness().with_block(whole)
    assert joined(halves).tolist() == whole.tolist()


def test_levels_are_in_decibels_below_full_scale():
    assert level_db(tone(1.0, height=1.0)) == pytest.approx(-3.01, abs=0.01)
    assert level_db(tone(1.0, height=0.1)) == pytest.approx(-23.01, abs=0.01)
    assert level_db(silence(1.0)) == -100.0
    assert level_db(silence(0.0)) == -100.0
