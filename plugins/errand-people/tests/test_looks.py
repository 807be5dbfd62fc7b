"""Appearances as words, and what several looks say together."""

import pytest

from errand_people.looks import Appearance, Colour, Gesture, LookedAt, Pose, Trait

SITS, STANDS = Appearance(Pose.SITTING), Appearance(Pose.STANDING, Gesture.WAVING)


@pytest.mark.parametrize(
    ("appearance", "text"),
    [
        (Appearance(), "a person"),
        (Appearance(Pose.LYING, Gesture.NONE), "lying, making no gesture"),
        (Appearance(None, Gesture.POINTING_LEFT), "pointing to the left"),
        (Appearance(None, Gesture.RAISING_RIGHT_ARM, Colour.RED), "raising the right arm, dressed in red"),
    ],
)
def test_an_appearance_is_told_in_words(appearance, text):
    assert appearance.text() == text


# first look, second look: what both say
@pytest.mark.parametrize(
    ("first", "second", "both"),
    [
        (SITS, Appearance(None, Gesture.WAVING), Appearance(Pose.SITTING, Gesture.WAVING)),
        (SITS, STANDS, Appearance(None, Gesture.WAVING)),
        (SITS, Appearance(Pose.LYING, Gesture.NONE), Appearance()),
        (SITS, SITS, SITS),
    ],
)
def test_looks_that_differ_leave_a_trait_unsure(first, second, both):
    merged = LookedAt(first, (1.0, 2.0), 3.0).merged(LookedAt(second, (1.1, 2.0), 4.0))
    assert merged == LookedAt(both, (1.1, 2.0), 4.0)


@pytest.mark.parametrize(
    ("seen", "contradicts", "unsure"),
    [(SITS, True, ("gesture",)), (STANDS, False, ()), (Appearance(None, Gesture.NONE), True, ("pose",))],
)
def test_an_appearance_is_compared_with_the_wanted_one(seen, contradicts, unsure):
    assert (seen.contradicts(STANDS), seen.unsure_of(STANDS)) == (contradicts, unsure)


def test_only_the_traits_that_were_asked_for_are_told():
    assert STANDS.only([Trait.GESTURE, Trait.CLOTHES_COLOUR]) == Appearance(None, Gesture.WAVING)
