"""Variations of a world, and their lights."""

import pytest

from executive.words.variation import LIGHTS, Light, Variation, parse_light
from skills.inputs.errors import InputError


def test_a_light_is_named_or_a_brightness():
    assert (parse_light("dim"), parse_light("0.7")) == (LIGHTS["dim"], Light(0.7))


@pytest.mark.parametrize(("words", "hint"), [("moonlight", ""), ("7", ""), ("-1", ""), ("dimm", "dim")])
def test_an_unknown_light_is_refused_with_the_nearest_name(words, hint):
    with pytest.raises(InputError, match=f"unknown light '{words}'") as caught:
        Variation(words)
    assert hint in caught.value.hint


@pytest.mark.parametrize("values", [{"clutter": -1}, {"clutter": 41}, {"people": 9}, {"friction": 0.0}])
def test_a_value_out_of_range_is_refused_with_the_range(values):
    with pytest.raises(InputError, match="should be from"):
        Variation(**values)
