"""Spelling and sound of words."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.language.spelling import (
    SoundAlikes,
    correct_spelling,
    look_alikes,
    sound_distance,
    sounds_of,
    synonyms_for,
    synonyms_of,
)
from tests.tables import table

VOCABULARY = ["coke", "cokes", "beer", "wrench", "hammer", "screwdriver", "robin", "kitchen", "kitchen counter", "sofa"]


@pytest.mark.parametrize(*table(__file__, "sounds"))
def test_a_word_becomes_its_sounds(word, sounds):
    assert sounds_of(word) == sounds


def nearest_by_sound(heard, vocabulary=VOCABULARY):
    return min(vocabulary, key=lambda name: sound_distance(heard, name))


@pytest.mark.parametrize(*table(__file__, "nearest_by_sound"))
def test_the_nearest_name_by_sound_is_found(heard, name):
    assert nearest_by_sound(heard) == name


@pytest.mark.parametrize("heard", ["ranch", "coax", "rubbing", "bear", "hummer", "screw driver"])
def test_misheard_words_sound_near(heard):
    assert sound_distance(heard, nearest_by_sound(heard)) < 0.2


@pytest.mark.parametrize("heard", ["umbrella", "parcel", "lamp", "vase", "violin"])
def test_unknown_sound_is_far_from_all_names(heard):
    assert sound_distance(heard, nearest_by_sound(heard)) > 0.35


@pytest.mark.parametrize("name", ["beer", "bear", "hammer", "hamper"])
def test_a_word_is_at_no_distance_from_itself(name):
    assert sound_distance(name.upper(), name) == 0.0


@pytest.mark.parametrize("silent", ["", "  ", "123", "饮料", "🙂"])
def test_text_without_sound_is_similar_to_nothing(silent):
    assert sound_distance(silent, nearest_by_sound(silent)) == 1.0


def test_a_spelling_of_the_very_same_sounds_is_at_no_distance():
    assert sound_distance("coax", "cokes") == 0.0


@given(st.text(max_size=40), st.text(max_size=40))
def test_the_distance_is_symmetric_and_between_zero_and_one(first, second):
    distance = sound_distance(first, second)
    assert distance == pytest.approx(sound_distance(second, first)) and 0.0 <= distance <= 1.0


KNOWN = {"wrench": "wrench", "coke": "coke", "lemonade": "lemonade", "living room": "living room", "hammer": "hammer"}


@pytest.mark.parametrize(*table(__file__, "synonyms"))
def test_a_synonym_stands_for_the_known_names(word, names):
    assert synonyms_of(word, KNOWN) == tuple(names)


def test_a_name_has_its_synonyms_and_the_words_for_its_kind():
    assert {"spanner", "monkey wrench"} <= set(synonyms_for("wrench"))
    assert {"cola", "soda", "soft drink"} <= set(synonyms_for("coke")) and synonyms_for("unicorn") == ()


@pytest.mark.parametrize(*table(__file__, "corrected"))
def test_misspelled_name_is_corrected_and_noted_unless_spaces_differ(parser, knowledge, text, corrected, noted):
    answer = correct_spelling(text, knowledge, parser)
    assert (answer.text, bool(answer.notes)) == (corrected, noted)
    assert all(note.startswith("I take '") for note in answer.notes)


@pytest.mark.parametrize(*table(__file__, "possibly_right"))
def test_possibly_right_words_are_not_corrected(parser, knowledge, text):
    assert correct_spelling(text, knowledge, parser).text == text


@pytest.mark.parametrize(("word", "names"), [("cake", ("coke",)), ("ranch", ("wrench",)), ("unicorn", ())])
def test_similar_spelling_or_sound_makes_a_candidate(parser, word, names):
    assert look_alikes(word, KNOWN, parser) == names


@given(st.text(max_size=30))
def test_any_text_is_corrected_without_an_error(parser, knowledge, text):
    correct_spelling(text, knowledge, parser)


NAMES = ("wrench", "beer", "coke", "cokes", "big dish", "desk", "Robin", "kitchen counter")
OTHERS = ("would you", "could you", "to", "drive to")
ALIKES = SoundAlikes(NAMES, OTHERS)
KNOWS = {"Kitchen": True, "would": True, "ranch": False}


@pytest.mark.parametrize(*table(__file__, "misheard_phrases"))
def test_misheard_phrase_is_among_the_nearest(heard, meant):
    assert meant in [alike.phrase for alike in ALIKES.nearest(heard)[:3]]


def test_the_costs_are_those_of_the_distance_by_sound():
    for heard in ("ranch", "big fish", "rob in"):
        for alike in ALIKES.nearest(heard):
            longer = max(len(sounds_of(heard)), len(sounds_of(alike.phrase)))
            assert alike.cost == pytest.approx(sound_distance(heard, alike.phrase) * longer)


def test_the_nearest_come_first_without_the_same_words():
    costs = [alike.cost for alike in ALIKES.nearest("coats")]
    assert costs == sorted(costs)
    assert "wrench" not in [alike.phrase for alike in ALIKES.nearest("Wrench")]


def test_names_differ_from_other_words():
    assert {alike.phrase: alike.name for alike in ALIKES.nearest("come you")}["could you"] is False
    assert ALIKES.nearest("ranch")[0].name


def test_unknown_sound_has_no_similar_phrases():
    assert [ALIKES.nearest(sound) for sound in ("electricity bill", "", "123")] == [()] * 3
    assert SoundAlikes([]).nearest("wrench") == ()


def test_words_of_known_phrases_are_known():
    assert {word: ALIKES.knows(word) for word in KNOWS} == KNOWS
