"""Sentences that fit are found from what was heard; the reader here wants every word behind "the" to be known."""

import pytest

from executive.language.spelling import SoundAlikes
from executive.speech.sound_correction import Candidate, Reading, corrections

NAMES = ("wrench", "bench", "desk", "kitchen", "beer", "coke")
WORDS = ("could you", "would you", "drive to", "bring", "from", "take")
KNOWN = {"bring", "take", "me", "the", "from", "to", "could", "would", "you", "drive", *NAMES}
ALIKES = SoundAlikes(NAMES, WORDS)


def read(text):
    unknown = tuple(word for word in text.rstrip(".?").lower().split() if word not in KNOWN)
    return Reading(text, not unknown, unknown)


def corrected(text, most=3):
    return [candidate.text for candidate in corrections([Candidate(text, 0.0, read(text))], read, ALIKES, most=most)]


@pytest.mark.parametrize(
    ("heard", "meant"),
    [
        ("bring me the ranch", "bring me the wrench"),
        ("bring me the ranch.", "bring me the wrench."),
        ("coat you bring me the beer", "could you bring me the beer"),
        ("bring the bear from the nest", "bring the beer from the desk"),
        ("rive to the kitchen", "drive to the kitchen"),
    ],
)
def test_misheard_words_become_known_ones(heard, meant):
    assert meant in corrected(heard)


def test_a_sentence_that_fits_stays_as_it_is():
    assert corrected("bring me the coke", most=1) == ["bring me the coke"]


def test_right_words_are_left_alone():
    assert corrected("take the beer from the nest")[0].startswith("take the beer from the")


def test_what_sounds_like_nothing_known_is_not_corrected():
    assert corrected("bring me the newspaper subscription") == []


def test_behind_an_article_stands_a_name():
    assert not any("the could" in text or "the from" in text for text in corrected("bring me the food", most=9))


def test_the_likest_sentence_comes_first():
    found = corrections([Candidate("bring me the ranch", 0.0, read("bring me the ranch"))], read, ALIKES)
    assert [candidate.cost for candidate in found] == sorted(candidate.cost for candidate in found)


def test_the_search_ends_however_long_the_sentence():
    reads = []

    def never(text):
        reads.append(text)
        return Reading(text, fits=False)

    heard = Candidate("could you bring me the ranch from the nest " * 6, 0.0, Reading("", fits=False))
    assert corrections([heard], never, ALIKES) == []
    assert len(reads) < 50
