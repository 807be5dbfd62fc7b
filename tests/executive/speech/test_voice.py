import time

import pytest

from executive.speech.voice import EspeakVoice, Silence, installed_voice, queued_voice
from skills.files.errors import InputError


def test_without_a_synthesiser_nothing_is_said():
    voice = installed_voice(which=lambda name: None)
    assert isinstance(voice, Silence)
    voice.say("All right.")


def test_a_synthesiser_that_does_not_start_fails_nothing(tmp_path):
    EspeakVoice(str(tmp_path / "missing")).say("All right.")


@pytest.fixture
def talker(tmp_path):
    program = tmp_path / "espeak-ng"
    program.write_text(f'#!/bin/sh\nprintf "%s\\n" "$@" >> {tmp_path}/said\n')
    program.chmod(0o755)
    return installed_voice(which=lambda name: str(program))


def _said(tmp_path, voice):
    voice.wait()
    return (tmp_path / "said").read_text().splitlines()


def test_the_answer_is_said(talker, tmp_path):
    talker.say("All right.")
    assert _said(tmp_path, talker) == ["--", "All right."]


def test_an_answer_that_looks_like_an_option_is_said_too(talker, tmp_path):
    talker.say("--version")
    assert _said(tmp_path, talker) == ["--", "--version"]


def test_a_long_answer_is_cut(talker, tmp_path):
    talker.say("x" * 1000)
    assert len(_said(tmp_path, talker)[1]) == 300


@pytest.fixture
def slow_talker(tmp_path):
    program = tmp_path / "espeak-ng"
    program.write_text(f'#!/bin/sh\nsleep 0.1\nprintf "%s\\n" "$2" >> {tmp_path}/said\n')
    program.chmod(0o755)
    return queued_voice(which=lambda name: str(program))


def test_a_queued_voice_says_all_in_order_and_never_waits(slow_talker, tmp_path):
    begun_s = time.perf_counter()
    for text in ("one", "two", "three"):
        slow_talker.say(text)
    assert time.perf_counter() - begun_s < 0.1
    slow_talker.close()
    slow_talker.close()
    assert (tmp_path / "said").read_text().splitlines() == ["one", "two", "three"]


def test_a_queued_voice_that_does_not_start_lets_go(tmp_path):
    voice = queued_voice(which=lambda name: str(tmp_path / "missing"))
    voice.say("All right.")
    voice.close()


def test_without_a_synthesiser_a_queued_voice_is_refused():
    with pytest.raises(InputError, match="no voice"):
        queued_voice(which=lambda name: None)
