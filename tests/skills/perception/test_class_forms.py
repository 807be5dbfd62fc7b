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


def test_the_least_mass_by_size_stays_within_the_range_of_the_class():
    tank, can = class_forms()["extinguisher"], class_forms()["coke"]
    assert tank.least_mass_kg((0.05, 0.05, 0.1)) == tank.mass_kg[0]
    assert tank.least_mass_kg((0.4, 0.4, 0.8)) == tank.mass_kg[1]
    assert can.least_mass_kg((0.3, 0.3, 0.3)) == can.mass_kg[0]


def test_masses_are_ranges():
    ranges = [form.mass_kg for form in class_forms().values() if form.mass_kg is not None]
    assert all(0.0 < least < most for least, most in ranges)
