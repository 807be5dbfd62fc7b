import pytest

from executive.speech.voice import EspeakVoice, Silence, installed_voice


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
