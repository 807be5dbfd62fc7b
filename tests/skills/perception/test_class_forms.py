"""The forms of the classes."""

from executive.mission.class_ids import CLASS_IDS
from skills.perception.class_forms import class_forms


def test_every_class_has_a_form_and_the_number_that_all_use():
    assert {name: form.id for name, form in class_forms().items()} == dict(CLASS_IDS)


def test_sizes_are_ranges_and_no_side_is_longer_than_the_longest():
    for form in class_forms().values():
        assert 0.0 < form.length_m[0] < form.length_m[1]
        assert 0.0 < form.width_m[0] < form.width_m[1] <= form.length_m[1]
