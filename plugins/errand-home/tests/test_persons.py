"""Descriptions of people are read in many words, and written in one."""

import pytest

from errand_home.persons import appearance_of, clothing_note, description, plural_description
from errand_people.looks import Appearance

WAVING, SITTING, RED = Appearance(gesture="waving"), Appearance(pose="sitting"), Appearance(clothes_colour="red")
LEFT_ARM, RIGHT = Appearance(gesture="raising_left_arm"), Appearance(gesture="pointing_right")


# words, appearance (None: no description)
@pytest.mark.parametrize(
    ("words", "appearance"),
    [
        ("waving person", WAVING),
        ("people waving", WAVING),
        ("guest who is waving", WAVING),
        ("sitting persons", SITTING),
        ("seated person", SITTING),
        ("person raising their left arm", LEFT_ARM),
        ("person pointing to the right", RIGHT),
        ("person wearing a red t shirt", RED),
        ("people wearing red coats", RED),
        ("person in red", RED),
        ("person wearing a gray blouse", Appearance(clothes_colour="grey")),
        ("person", Appearance()),
        ("tall person", None),
        ("person wearing a hat", None),
        ("person wearing a purple coat", None),
        ("waving person with a hat", None),
        ("drink", None),
    ],
)
def test_a_description_is_read_whole_or_not_at_all(words, appearance):
    assert appearance_of(words) == appearance


@pytest.mark.parametrize(
    ("appearance", "one", "several"),
    [
        (WAVING, "waving person", "waving people"),
        (LEFT_ARM, "person raising their left arm", "people raising their left arm"),
        (RED, "person wearing red", "people wearing red"),
        (Appearance(), "person", "people"),
    ],
)
def test_a_description_as_written_is_read_again(appearance, one, several):
    assert (description(appearance), plural_description(appearance)) == (one, several)
    assert appearance_of(one) == appearance_of(several) == appearance


@pytest.mark.parametrize(("words", "noted"), [("person wearing a red coat", True), ("person wearing red", False)])
def test_a_kind_of_clothing_is_noted_as_not_told_apart(words, noted):
    assert bool(clothing_note(words)) is noted
