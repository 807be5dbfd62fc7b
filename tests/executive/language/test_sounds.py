import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.language.sounds import nearest_by_sound, sound_distance, sounds_of

VOCABULARY = ["coke", "cokes", "beer", "wrench", "hammer", "screwdriver", "robin", "kitchen", "kitchen counter", "sofa"]


@pytest.mark.parametrize(
    ("word", "sounds"),
    [
        ("wrench", "renC"),
        ("ranch", "ranC"),
        ("coax", "koks"),
        ("cokes", "koks"),
        ("knife", "nAf"),
        ("phone", "fon"),
        ("table", "tebl"),
        ("Alice", "alis"),
        ("slice", "slAs"),
        ("glasses", "glasis"),
        ("night", "nAt"),
        ("work bench", "w@rkbenC"),
        ("workbench", "w@rkbenC"),
        ("crème", "krim"),
    ],
)
def test_a_word_becomes_its_sounds(word, sounds):
    assert sounds_of(word) == sounds


@pytest.mark.parametrize(
    ("heard", "name"),
    [
        ("ranch", "wrench"),
        ("coax", "cokes"),
        ("rubbing", "robin"),
        ("bear", "beer"),
        ("bier", "beer"),
        ("hamper", "hammer"),
        ("hummer", "hammer"),
        ("screw driver", "screwdriver"),
        ("kitten", "kitchen"),
        ("chicken counter", "kitchen counter"),
        ("sopha", "sofa"),
    ],
)
def test_the_nearest_name_by_sound_is_found(heard, name):
    match = nearest_by_sound(heard, VOCABULARY)
    assert match.name == name


@pytest.mark.parametrize("heard", ["ranch", "coax", "rubbing", "bear", "hummer", "screw driver"])
def test_what_is_misheard_is_near(heard):
    assert nearest_by_sound(heard, VOCABULARY).distance < 0.2


@pytest.mark.parametrize("heard", ["umbrella", "parcel", "lamp", "vase", "violin"])
def test_what_sounds_like_nothing_known_is_far(heard):
    assert nearest_by_sound(heard, VOCABULARY).distance > 0.35


@pytest.mark.parametrize("name", ["beer", "bear", "hammer", "hamper"])
def test_a_known_word_is_itself_however_near_another_sounds(name):
    match = nearest_by_sound(name.upper(), ["bear", "beer", "hammer", "hamper"])
    assert (match.name, match.distance) == (name, 0.0)


def test_a_spelling_of_the_very_same_sounds_is_at_no_distance():
    assert sound_distance("coax", "cokes") == 0.0


@pytest.mark.parametrize("silent", ["", "  ", "123", "饮料", "🙂"])
def test_what_makes_no_sound_is_like_nothing(silent):
    assert nearest_by_sound(silent, VOCABULARY).distance == 1.0


def test_without_a_vocabulary_there_is_no_nearest():
    assert nearest_by_sound("ranch", []) is None


@given(st.text(max_size=40), st.text(max_size=40))
def test_the_distance_is_symmetric_and_between_zero_and_one(first, second):
    distance = sound_distance(first, second)
    assert distance == pytest.approx(sound_distance(second, first))
    assert 0.0 <= distance <= 1.0
