"""Attributes judged from what is seen of a thing."""

from dataclasses import replace

import numpy as np
import pytest
from made_detections import detected_3d

from skills.perception.attributes import known_attributes, shows


def coloured(*colours):
    return replace(detected_3d(), colours=np.array(colours * 20, np.uint8))


@pytest.mark.parametrize(
    ("colour", "word"),
    [
        ((190, 20, 25), "red"),
        ((25, 60, 190), "blue"),
        ((40, 140, 60), "green"),
        ((230, 210, 40), "yellow"),
        ((90, 55, 25), "brown"),
        ((20, 20, 22), "black"),
        ((235, 235, 230), "white"),
        ((235, 130, 20), "orange"),
        ((110, 40, 150), "purple"),
        ((130, 130, 132), "grey"),
    ],
)
def test_a_thing_shows_its_colour_and_no_opposite(colour, word):
    assert shows(coloured(colour), word)
    assert not shows(coloured(colour), "green" if word != "green" else "red")


def test_a_third_of_the_pixels_is_enough():
    assert shows(coloured((190, 20, 25), (120, 120, 125), (120, 120, 125)), "red")
    assert not shows(coloured((190, 20, 25), *[(120, 120, 125)] * 6), "red")


def test_a_thing_in_a_grey_picture_shows_no_colour():
    assert not shows(detected_3d(), "red")


def test_big_and_small_go_by_what_is_usual_in_the_class():
    big = replace(detected_3d(name="hammer"), size_m=(0.8, 0.2, 0.06))
    small = replace(detected_3d(name="hammer"), size_m=(0.25, 0.1, 0.03))
    assert [shows(big, "big"), shows(big, "small"), shows(small, "large"), shows(small, "small")] == [1, 0, 0, 1]


def test_an_unknown_word_is_an_error():
    assert "shiny" not in known_attributes()
    with pytest.raises(KeyError):
        shows(coloured((1, 2, 3)), "shiny")


def test_known_words_can_all_be_judged():
    assert {"red", "blue", "big", "small"} <= known_attributes()
    for word in known_attributes():
        shows(coloured((190, 20, 25)), word)
