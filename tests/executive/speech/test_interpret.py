import pytest
from made_speech import ScriptedRecognition

from executive.language.spelling import SoundAlikes
from executive.speech.interpret import Candidate, Reading, choose_opening, corrections, interpret, remove_repetitions
from executive.speech.recogniser import Transcript
from tests.tables import table

ALIKES = SoundAlikes(["wrench", "bench", "coke"])


def read(text):
    last = text.split()[-1].strip(".?")
    return Reading(text, last in ("wrench", "bench", "coke"), (last,), correctable=not text.startswith("Robin"))


def heard(*texts, wider=(), likely=None, step=1.0, otherwise=0.0):
    first = tuple(Transcript(text, -step * n) for n, text in enumerate(texts))
    more = tuple(Transcript(text, -step * n) for n, text in enumerate(wider))
    return ScriptedRecognition(first, more, {texts[0]: 0.0} | (likely or {}), otherwise)


def meant(*texts, **more):
    return interpret(heard(*texts, **more), read, ALIKES).text


@pytest.mark.parametrize(*table(__file__, "readings"))
def test_the_first_reading_that_fits_and_may_have_been_said_is_meant(texts, options, chosen):
    assert meant(*texts, **options) == chosen


def test_words_are_corrected_by_sound_when_no_reading_fits():
    result = interpret(heard("get the ranch"), read, ALIKES)
    assert (result.text, result.meaning) == ("get the wrench", "get the wrench")


def test_nothing_said_means_nothing():
    assert interpret(ScriptedRecognition(), read, ALIKES) is None


@pytest.mark.parametrize(*table(__file__, "repeated_words"))
def test_repeated_words_are_heard_once(said, left):
    assert remove_repetitions(said) == left


NAMES = ("wrench", "bench", "desk", "kitchen", "beer", "coke")
WORDS = ("could you", "would you", "drive to", "bring", "from", "take")
KNOWN = {"bring", "take", "me", "the", "from", "to", "could", "would", "you", "drive", *NAMES}
ALIKES = SoundAlikes(NAMES, WORDS)


def read_known(text):
    unknown = tuple(word for word in text.rstrip(".?").lower().split() if word not in KNOWN)
    return Reading(text, not unknown, unknown)


def corrected(text, most=3):
    first = Candidate(text, 0.0, read_known(text))
    return [candidate.text for candidate in corrections([first], read_known, ALIKES, most=most)]


@pytest.mark.parametrize(*table(__file__, "misheard_words"))
def test_misheard_words_become_known_ones(heard, meant):
    assert meant in corrected(heard)


def test_a_sentence_that_fits_stays_as_it_is():
    assert corrected("bring me the coke", most=1) == ["bring me the coke"]


def test_right_words_are_left_alone():
    assert corrected("take the beer from the nest")[0].startswith("take the beer from the")


def test_unknown_sound_is_not_corrected():
    assert corrected("bring me the newspaper subscription") == []


def test_behind_an_article_stands_a_name():
    assert not any("the could" in text or "the from" in text for text in corrected("bring me the food", most=9))


def test_the_likest_sentence_comes_first():
    found = corrections([Candidate("bring me the ranch", 0.0, read_known("bring me the ranch"))], read_known, ALIKES)
    assert [candidate.cost for candidate in found] == sorted(candidate.cost for candidate in found)


def test_the_search_ends_however_long_the_sentence():
    reads = []

    def never(text):
        reads.append(text)
        return Reading(text, fits=False)

    heard = Candidate("could you bring me the ranch from the nest " * 6, 0.0, Reading("", fits=False))
    assert corrections([heard], never, ALIKES) == [] and len(reads) < 50


ALICE = "Hey Alice, get me a cube."


@pytest.mark.parametrize(*table(__file__, "openings"))
def test_the_opening_is_what_was_heard_without_expecting_names_when_it_is_much_likelier(text, plain, likely, opening):
    recognition = ScriptedRecognition(plain=plain, likely=likely)
    assert choose_opening(recognition, text, ("Alice",), lambda heard: "alice" in heard.lower()) == opening


def test_call_stays_when_nothing_is_heard_without_expected_names():
    assert choose_opening(ScriptedRecognition(), ALICE, ("Alice",), lambda heard: False) == ALICE
