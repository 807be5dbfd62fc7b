"""The forms of the classes."""

from plant.models.catalogue import load_catalogue
from skills.perception.class_forms import class_forms


def test_the_skills_and_the_models_number_the_classes_alike():
    catalogue = {name: entry.id for name, entry in load_catalogue().items()}
    assert catalogue.items() <= {name: form.id for name, form in class_forms().items()}.items()


def test_sizes_are_ranges_and_no_side_is_longer_than_the_longest():
    for form in class_forms().values():
        assert 0.0 < form.length_m[0] < form.length_m[1]
        assert 0.0 < form.width_m[0] < form.width_m[1] <= form.length_m[1]
