"""Distinct objects of several searches."""

import pytest

from skills.api import ObjectKind, ObjectObservation
from skills.descriptions import distinct_objects


def beer(x_m, name="beer"):
    return ObjectObservation(0.0, ObjectKind(name), (x_m, 0.0, 0.8), (0.1, 0.1, 0.1), 0.0, 0.9, "bench")


@pytest.mark.parametrize(
    ("looks", "places_m"),
    [
        ([[beer(0.0)], [beer(1.0)]], [0.0, 1.0]),
        ([[beer(0.0)], [beer(0.05)]], [0.0]),
        ([[beer(0.0), beer(0.08)], [beer(0.02), beer(0.1)]], [0.0, 0.08]),
        ([[beer(0.0)], [beer(0.03), beer(0.1)]], [0.0, 0.1]),
        ([[beer(0.0)], [beer(0.0, "coke")]], [0.0, 0.0]),
        ([[], []], []),
    ],
    ids=["apart", "seen twice", "two close together", "one more beside it", "another class", "nothing"],
)
def test_each_object_is_counted_once(looks, places_m):
    assert [seen.position_W[0] for seen in distinct_objects(looks)] == places_m
