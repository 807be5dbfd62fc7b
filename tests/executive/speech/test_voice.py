import time

import pytest

from executive.speech.voice import EspeakVoice, Silence, installed_voice, queued_voice
from skills.inputs.errors import InputError


def test_without_a_synthesiser_nothing_is_said():
    voice = installed_voice(which=lambda name: None)
    assert isinstance(voice, Silence)
    voice.say("All right.")


def test_a_synthesiser_that_does_not_start_fails_nothing(tmp_path):
    EspeakVoice(str(tmp_path / "missing")).say("All right.")


def espeak(tmp_path, script):
    """Finder of a synthesiser that is a shell script."""
    program = tmp_path / "espeak-ng"
    program.write_text(f"#!/bin/sh\n{script} >> {tmp_path}/said\n")
    program.chmod(0o755)
    return lambda name: str(program)


@pytest.mark.parametrize(
    ("answer", "said"),
    [("All right.", "All right."), ("--version", "--version"), ("x" * 1000, "x" * 300)],
    ids=["short", "like an option", "long"],
)
def test_the_answer_is_said_and_a_long_one_is_cut(tmp_path, answer, said):
    voice = installed_voice(which=espeak(tmp_path, r'printf "%s\n" "$@"'))
    voice.say(answer)
    voice.wait()
    assert (tmp_path / "said").read_text().splitlines() == ["--", said]


def test_a_queued_voice_says_all_in_order_and_never_waits(tmp_path):
    slow_talker = queued_voice(which=espeak(tmp_path, r'sleep 0.1; printf "%s\n" "$2"'))
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
