"""The recogniser with a synthetic voice of this machine; skipped without the extra or a voice."""

import socket
from importlib import import_module

import pytest
from made_speech import silence

import executive.speech.recogniser as extra
from executive.speech.activity import load_detector
from executive.speech.hearing import Reader, spoken_phrases
from executive.speech.listener import Listener
from executive.speech.recogniser import vocabulary_of_world
from executive.speech.sound import concatenate, read_sound
from executive.speech.whisper import load_whisper
from skills.inputs.errors import InputError
from tests.tables import table

pytest.importorskip("faster_whisper")


@pytest.fixture(scope="module")
def whisper():
    """Recogniser, loaded without a network."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(socket, "socket", _no_network)
        return load_whisper()


def _no_network(*args, **more):
    raise AssertionError("the network was asked for")


@pytest.fixture
def listener(whisper, flat, parser):
    words = vocabulary_of_world(flat, called=True)
    reader = Reader(parser, flat, words, ("Alice",), require_wake=True)
    return Listener(whisper, load_detector, reader, spoken_phrases(words))


@pytest.mark.parametrize(*table(__file__, "spoken"))
def test_a_spoken_request_becomes_commands(listener, say, said, commands):
    heard = listener.hear_file(say(said))
    assert (heard.addressed, list(map(str, heard.commands))) == (True, commands)


def test_speech_to_nobody_is_ignored(listener, say):
    heard = listener.hear_file(say("The hammer belongs on the workbench."))
    assert not heard.addressed and heard.commands == ()


def test_the_same_sound_gives_the_same_readings_and_its_words_are_likelier_than_others(whisper, say, flat):
    words, sound = vocabulary_of_world(flat, called=False), concatenate(read_sound(say("Find the wrench.")))
    first, second = (whisper.transcribe(sound, words) for _ in range(2))
    assert first.transcripts == second.transcripts
    right, wrong = first.likelihoods(["Find the wrench.", "Take the beer."])
    assert right > wrong + 5.0


def test_silence_holds_no_words_worth_a_command(whisper, flat):
    readings = whisper.transcribe(silence(2.0), vocabulary_of_world(flat, called=True)).transcripts
    assert not any("kitchen" in reading.text for reading in readings)


def test_without_the_extra_the_error_has_a_hint(monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(extra, "import_module", missing)
    for load in (load_whisper, load_detector):
        with pytest.raises(InputError, match="not installed") as refused:
            load()
        assert "spot-errand[speech]" in refused.value.hint
    assert import_module("faster_whisper")


def test_damaged_weights_are_refused(monkeypatch):
    monkeypatch.setattr("executive.speech.whisper.BASE_SHA256", "0")
    with pytest.raises(InputError, match="damaged"):
        load_whisper()
