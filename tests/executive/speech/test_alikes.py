import pytest

from executive.language.sounds import sound_distance, sounds_of
from executive.speech.alikes import SoundAlikes

NAMES = ("wrench", "beer", "coke", "cokes", "big dish", "desk", "Robin", "kitchen counter")
OTHERS = ("would you", "could you", "to", "drive to")
ALIKES = SoundAlikes(NAMES, OTHERS)


#   heard, what it may have been
@pytest.mark.parametrize(
    ("heard", "meant"),
    [("ranch", "wrench"), ("coats", "cokes"), ("bear", "beer"), ("rubbing", "Robin"), ("big fish", "big dish"),
     ("nest", "desk"), ("come you", "could you"), ("when you", "would you"), ("kitchen count", "kitchen counter")],
)  # fmt: skip
def test_what_was_misheard_is_among_the_nearest(heard, meant):
    assert meant in [alike.phrase for alike in ALIKES.of(heard)[:3]]


def test_the_costs_are_those_of_the_distance_by_sound():
    for heard in ("ranch", "big fish", "rob in"):
        for alike in ALIKES.of(heard):
            longer = max(len(sounds_of(heard)), len(sounds_of(alike.phrase)))
            assert alike.cost == pytest.approx(sound_distance(heard, alike.phrase) * longer)


def test_the_nearest_come_first():
    costs = [alike.cost for alike in ALIKES.of("coats")]
    assert costs == sorted(costs)


def test_the_very_words_are_not_told():
    assert "wrench" not in [alike.phrase for alike in ALIKES.of("Wrench")]


def test_names_are_told_from_other_words():
    assert {alike.phrase: alike.name for alike in ALIKES.of("come you")}["could you"] is False
    assert ALIKES.of("ranch")[0].name


def test_what_sounds_like_nothing_known_has_no_alikes():
    assert ALIKES.of("electricity bill") == ()
    assert ALIKES.of("") == ALIKES.of("123") == ()
    assert SoundAlikes([]).of("wrench") == ()


def test_words_of_known_phrases_are_known():
    assert ALIKES.knows("Kitchen") and ALIKES.knows("would")
    assert not ALIKES.knows("ranch")
