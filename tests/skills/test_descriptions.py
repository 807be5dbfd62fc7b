import pytest

from skills.api import ObjectKind, ObjectObservation, Surface
from skills.descriptions import count_sentence, plural, wanted_names


def seen(name, surface="bench", *attributes):
    return ObjectObservation(0.0, ObjectKind(name, attributes), (1.0, 0.0, 0.8), (0.1, 0.1, 0.1), 0.0, 0.9, surface)


@pytest.mark.parametrize(
    ("found", "told"),
    [
        ([seen("wrench"), seen("wrench")], "there are two wrenches on the bench"),
        ([seen("hammer")], "there is one hammer on the bench"),
        ([seen("coke"), seen("beer"), seen("coke")], "there are two cokes and one beer on the bench"),
        ([seen("wrench", "bench", "red")] * 2, "there are two red wrenches on the bench"),
        ([seen("toy_car"), seen("toy_car")], "there are two toy cars on the bench"),
        ([seen("cube"), seen("cube", "floor")], "there are two cubes on the bench and the floor"),
    ],
)
def test_counts_are_described_in_a_sentence(found, told):
    assert count_sentence(found, [Surface("bench", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)), 0.8)]) == told


def test_plural_of_class_names():
    plurals = {
        **{"wrench": "wrenches", "beer": "beers", "person": "people", "extinguisher": "extinguishers"},
        **{"supply": "supplies", "toy": "toys"},
    }
    assert {name: plural(name) for name in plurals} == plurals


def test_wanted_objects_are_named():
    assert wanted_names(("coke", "beer"), ("red",)) == "red coke or red beer"
