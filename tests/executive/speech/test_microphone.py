"""A microphone is followed block by block: here a recording stands in for it, in blocks of 0.1 s of its own time."""

import subprocess

import numpy as np
import pytest
from made_speech import LoudIsSpeech, ScriptedRecogniser, speech_like

from executive.language.understand import Status
from executive.speech.hearing import SpeechReader, spoken_phrases
from executive.speech.listener import Listener
from executive.speech.microphone import follow, microphone_blocks
from executive.speech.sound import RATE_HZ
from executive.speech.vocabulary import of_world
from skills.files.errors import InputError

BLOCK = RATE_HZ // 10


@pytest.fixture
def hearings(flat, parser):
    def made(sound, *texts):
        words = of_world(flat, called=True)
        reader = SpeechReader(parser, flat, words, "Alice", require_wake=True)
        listener = Listener(ScriptedRecogniser(list(texts)), LoudIsSpeech, reader, spoken_phrases(words))
        return list(follow((sound[at : at + BLOCK] for at in range(0, len(sound), BLOCK)), listener))

    return made


def test_a_sentence_is_finished_soon_after_its_end(hearings):
    heard = hearings(speech_like(1.0, 3.0, 2.0), "Hey Alice, go to the kitchen.")
    (ended,) = [hearing for hearing in heard if hearing.finished]
    assert ended.time_s == pytest.approx(4.8, abs=0.15)
    assert ended.finished.meant.understanding.status is Status.OK


def test_what_is_being_said_is_shown_every_second(hearings):
    heard = hearings(speech_like(1.0, 3.0, 2.0), "Hey Alice, go to the kitchen.")
    partial_s = [hearing.time_s for hearing in heard if hearing.partial]
    assert partial_s[0] == pytest.approx(2.0, abs=0.2)
    assert not any(hearing.partial for hearing in heard if hearing.time_s > 5.0)


def test_the_level_and_whether_somebody_speaks_are_shown_for_every_block(hearings):
    heard = hearings(speech_like(1.0, 2.0, 2.0), "Hey Alice, go to the kitchen.")
    assert len([hearing for hearing in heard if not hearing.finished]) == 50
    assert heard[5].level_db == -100.0 and not heard[5].speaking
    assert heard[20].level_db == pytest.approx(-9.0, abs=0.5) and heard[20].speaking


def test_several_sentences_are_finished_one_after_another(hearings):
    heard = hearings(speech_like(0.5, 1.0, 1.5, 1.0, 1.5), "Hey Alice, go to the hall.", "Hey Alice, go to the office.")
    texts = [hearing.finished.text for hearing in heard if hearing.finished]
    assert texts == ["Hey Alice, go to the hall.", "Hey Alice, go to the office."]


def test_a_sentence_under_way_is_finished_when_the_sound_ends(hearings):
    heard = hearings(speech_like(0.5, 1.0), "Hey Alice, go to the hall.")
    assert heard[-1].finished is not None


def test_without_a_recorder_the_hint_is_told():
    with pytest.raises(InputError, match="arecord") as refused:
        next(microphone_blocks(which=lambda name: None))
    assert "alsa-utils" in refused.value.hint


def _recorder(tmp_path, script):
    program = tmp_path / "arecord"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    return lambda name: str(program)


def test_the_recorder_is_read_in_blocks_and_stopped(tmp_path):
    which = _recorder(tmp_path, f"echo $$ > {tmp_path}/pid; exec cat /dev/zero")
    blocks = microphone_blocks(which=which)
    assert [next(blocks).tolist() for _ in range(2)] == [np.zeros(BLOCK).tolist()] * 2
    blocks.close()
    pid = (tmp_path / "pid").read_text().strip()
    assert subprocess.run(["kill", "-0", pid], capture_output=True).returncode != 0


def test_without_a_microphone_the_recorders_word_is_told(tmp_path):
    which = _recorder(tmp_path, "echo 'no soundcards found' >&2; exit 1")
    with pytest.raises(InputError, match="no soundcards found"):
        next(microphone_blocks(which=which))
