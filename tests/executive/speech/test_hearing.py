"""Reading of heard sentences for one robot: its name, known names, and suspect words."""

import pytest

from executive.language.understand import Status
from executive.speech.hearing import Reader, spoken_phrases
from executive.speech.recogniser import Vocabulary, vocabulary_of_world


@pytest.fixture(scope="module")
def reader(flat, parser):
    return Reader(parser, flat, vocabulary_of_world(flat, called=True), ("Alice",), require_wake=True)


@pytest.fixture(scope="module")
def open_reader(parser):
    words = Vocabulary(("big dish", "washing machine", "cupboard", "Robin"))
    return Reader(parser, None, words, ("Alice",), require_wake=False)


@pytest.mark.parametrize("call", ["Hey Alice, ", "High Alice, ", "Hey Ellis ", "OK Alice. ", "Alice "])
def test_a_call_may_be_misheard(reader, call):
    reading = reader.read(f"{call}go to the kitchen")
    assert reading.fits and reading.meaning.addressed
    assert reading.meaning.text == "Hey Alice, go to the kitchen"


def test_speech_to_others_is_not_corrected(reader):
    reading = reader.read("Robin, go to the kitchen")
    assert not reading.fits and not reading.correctable and not reading.meaning.addressed
    assert reading.meaning.status is Status.NOT_ADDRESSED


def test_a_story_about_the_robot_is_no_call(reader):
    assert not reader.read("Alice went to the kitchen").meaning.addressed


def test_names_of_other_robots_do_not_call_this_one(flat, parser):
    words = vocabulary_of_world(flat, called=True)
    reader = Reader(parser, flat, words, ("Alice",), require_wake=True, other_robots=("Ellis",))
    assert not reader.read("Hey Ellis, go to the kitchen").meaning.addressed


def test_an_unknown_name_is_to_blame(reader):
    reading = reader.read("Hey Alice, walk to the maze")
    assert not reading.fits and reading.correctable and "maze" in " ".join(reading.suspects)


def test_names_outside_an_open_vocabulary_are_to_blame(open_reader):
    reading = open_reader.read("put the big fish into the washing machine")
    assert (reading.meaning.status, reading.fits, reading.suspects) == (Status.OK, False, ("big fish",))


@pytest.mark.parametrize("text", ["put the big dishes into the washing machine", "bring the small big dish to Robin"])
def test_plurals_and_adjectives_are_no_other_names(open_reader, text):
    assert open_reader.read(text).fits


def test_without_a_vocabulary_every_name_fits(parser):
    reader = Reader(parser, None, Vocabulary(), ("Alice",), require_wake=False)
    assert reader.read("put the tuba into the wardrobe").fits


def test_the_known_phrases_are_names_calls_and_the_words_of_requests(flat):
    alikes = spoken_phrases(vocabulary_of_world(flat, called=True))
    assert alikes.nearest("ranch")[0].phrase == "wrench"
    wanted = {"coats": "cokes", "when you": "would you", "pay Alice": "Hey Alice"}
    assert [said for said, meant in wanted.items() if meant not in {a.phrase for a in alikes.nearest(said)}] == []
