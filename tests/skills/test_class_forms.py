from dataclasses import replace

import numpy as np
import pytest
from made_detections import detected_3d

from plant.models.catalogue import load_catalogue
from skills.class_forms import class_forms, known_attributes
from skills.perception.detection_3d import has_attribute
from tests.tables import table


def test_skills_and_models_use_the_same_class_ids():
    catalogue = {name: entry.id for name, entry in load_catalogue().items()}
    assert catalogue.items() <= {name: form.id for name, form in class_forms().items()}.items()


def test_sizes_are_ranges_and_no_side_is_longer_than_the_longest():
    for form in class_forms().values():
        assert 0.0 < form.length_m[0] < form.length_m[1]
        assert 0.0 < form.width_m[0] < form.width_m[1] <= form.length_m[1]


def test_masses_are_ranges():
    ranges = [form.mass_kg for form in class_forms().values() if form.mass_kg is not None]
    assert all(0.0 < least < most for least, most in ranges)


def coloured(*colours):
    return replace(detected_3d(), colours=np.array(colours * 20, np.uint8))


@pytest.mark.parametrize(*table(__file__, "colours"))
def test_an_object_has_its_colour_and_not_the_opposite(colour, word):
    assert has_attribute(coloured(colour), word)
    assert not has_attribute(coloured(colour), "green" if word != "green" else "red")


def test_a_third_of_the_pixels_is_enough():
    assert has_attribute(coloured((190, 20, 25), (120, 120, 125), (120, 120, 125)), "red")
    assert not has_attribute(coloured((190, 20, 25), *[(120, 120, 125)] * 6), "red")


def test_an_object_without_a_colour_is_told_by_its_pixels():
    assert has_attribute(coloured((20, 30, 190)), "non-red")
    assert not has_attribute(coloured((190, 20, 25)), "non-red")
    assert not has_attribute(detected_3d(), "non-red")  # without pixels nothing is known


def test_an_object_in_a_grey_picture_has_no_colour():
    assert not has_attribute(detected_3d(), "red")


def test_an_unknown_word_is_an_error():
    assert "shiny" not in known_attributes()
    with pytest.raises(KeyError):
        has_attribute(coloured((1, 2, 3)), "shiny")


def test_known_words_can_all_be_judged():
    assert {"red", "blue", "big", "small"} <= known_attributes()
    for word in known_attributes():
        has_attribute(coloured((190, 20, 25)), word)


def test_big_and_small_are_relative_to_the_class():
    big = replace(detected_3d(name="hammer"), size_m=(0.8, 0.2, 0.06))
    small = replace(detected_3d(name="hammer"), size_m=(0.25, 0.1, 0.03))
    assert [
        has_attribute(big, "big"),
        has_attribute(big, "small"),
        has_attribute(small, "large"),
        has_attribute(small, "small"),
    ] == [1, 0, 0, 1]
