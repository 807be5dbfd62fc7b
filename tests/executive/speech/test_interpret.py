"""Which reading was meant; the reader here takes only sentences with a known thing in them."""

import pytest
from made_speech import ScriptedRecognition

from executive.language.spelling import SoundAlikes
from executive.speech.interpret import interpret, smoothed
from executive.speech.recogniser import Transcript
from executive.speech.sound_correction import Reading

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


#   readings                                            wider             meant
#   the first fits                                                        the first
#   the second fits                                                       the second
#   none fits, one of the wider search does             yes               that
#   none fits, one that sounds like the first does                        that
#   none does                                                             the first
def test_the_first_reading_that_fits_is_meant():
    assert meant("get the wrench", "get the coke") == "get the wrench"
    assert meant("get the ranch", "get the coke") == "get the coke"


def test_a_wider_search_is_made_when_no_reading_fits():
    assert meant("get the ranch", wider=["get the crunch", "get the coke"]) == "get the coke"


def test_words_are_corrected_by_sound_when_no_reading_fits():
    result = interpret(heard("get the ranch"), read, ALIKES)
    assert (result.text, result.meaning, result.first_text) == ("get the wrench", "get the wrench", "get the ranch")


def test_the_sound_decides_between_two_corrected_sentences():
    assert meant("get the ranch", likely={"get the bench": -1.0}, otherwise=-8.0) == "get the bench"


def test_a_corrected_sentence_that_the_sound_denies_is_not_meant():
    assert meant("get the ranch", otherwise=-30.0) == "get the ranch"


def test_a_much_less_likely_reading_is_not_meant():
    assert meant("play the news", "get the coke", step=50.0, otherwise=-30.0) == "play the news"


def test_what_is_said_to_others_is_left_as_it_was_heard():
    assert meant("Robin get the ranch", "get the wrench") == "Robin get the ranch"


def test_nothing_said_means_nothing():
    assert interpret(ScriptedRecognition(), read, ALIKES) is None


@pytest.mark.parametrize(
    ("said", "left"),
    [
        ("grab this cup from the, grab this cup from the table", "grab this cup from the table"),
        ("Bring the cup. Bring the cup to Robin.", "Bring the cup to Robin."),
        ("put it on the table in the kitchen", "put it on the table in the kitchen"),
        ("bring it to Robin, which he is in the hall", "bring it to Robin who is in the hall"),
        ("bring her her tuna", "bring her her tuna"),
        ("go to the table and to the desk", "go to the table and to the desk"),
    ],
)
def test_what_was_said_twice_is_heard_once(said, left):
    assert smoothed(said) == left
