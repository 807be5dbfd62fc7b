"""The voices that speak training sentences."""

import random

import pytest

from errand_train.speech import voices
from errand_train.speech.voices import draw_speaker, speak, speakers
from skills.inputs.errors import InputError
from tests.executive.speech.made_speech import tone

HELD_OUT = ("scotland", "rp", "+f3", "awb", "slt", "ked")


def test_a_machine_without_voices_gets_a_hint(monkeypatch):
    monkeypatch.setattr(voices.shutil, "which", lambda name: None)
    with pytest.raises(InputError, match="no synthetic voice") as refused:
        speakers()
    assert "apt-get install" in refused.value.hint


def test_voices_that_figures_are_taken_with_are_not_among_them():
    for speaker in voices._SPEAKERS:
        for seed in range(200):
            spoken = " ".join(speaker.arguments(random.Random(seed)))
            assert not any(name in spoken.replace("{wav}", "") for name in HELD_OUT), spoken


def test_each_that_is_installed_speaks():
    try:
        found = speakers()
    except InputError:
        pytest.skip("no synthetic voice is installed")
    for speaker in found:
        assert len(tone(0.3)) < len(speak(speaker, "Bring the cup.", random.Random(1))) < len(tone(5.0))


def test_excluded_voices_are_never_drawn():
    try:
        found = speakers(left_out=("espeak",))
    except InputError:
        pytest.skip("no synthetic voice is installed")
    draw = random.Random(1)
    assert "espeak" not in {draw_speaker(found, draw).name for _ in range(100)}
