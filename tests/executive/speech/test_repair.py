"""Sentences that fit are found from what was heard; the reader here wants every word behind "the" to be known."""

import pytest

from executive.speech.alikes import SoundAlikes
from executive.speech.repair import Reading, Repair, repairs

NAMES = ("wrench", "bench", "desk", "kitchen", "beer", "coke")
WORDS = ("could you", "would you", "drive to", "bring", "from", "take")
KNOWN = {"bring", "take", "me", "the", "from", "to", "could", "would", "you", "drive", *NAMES}
ALIKES = SoundAlikes(NAMES, WORDS)


def read(text):
    unknown = tuple(word for word in text.rstrip(".?").lower().split() if word not in KNOWN)
    return Reading(text, not unknown, unknown)


def mended(text, most=3):
    return [repair.text for repair in repairs([Repair(text, 0.0, read(text))], read, ALIKES, most=most)]


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
    assert meant in mended(heard)


def test_a_sentence_that_fits_stays_as_it_is():
    assert mended("bring me the coke", most=1) == ["bring me the coke"]


def test_right_words_are_left_alone():
    assert mended("take the beer from the nest")[0].startswith("take the beer from the")


def test_what_sounds_like_nothing_known_is_not_mended():
    assert mended("bring me the newspaper subscription") == []


def test_behind_an_article_stands_a_name():
    assert not any("the could" in text or "the from" in text for text in mended("bring me the food", most=9))


def test_the_likest_sentence_comes_first():
    found = repairs([Repair("bring me the ranch", 0.0, read("bring me the ranch"))], read, ALIKES)
    assert [repair.cost for repair in found] == sorted(repair.cost for repair in found)


def test_the_search_ends_however_long_the_sentence():
    reads = []

    def never(text):
        reads.append(text)
        return Reading(text, fits=False)

    heard = Repair("could you bring me the ranch from the nest " * 6, 0.0, Reading("", fits=False))
    assert repairs([heard], never, ALIKES) == []
    assert len(reads) < 50
