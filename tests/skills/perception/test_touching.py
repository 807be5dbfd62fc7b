"""Objects that touch, told apart by their outline from above."""

import numpy as np
import pytest

from skills.perception.touching import touching_parts

RNG_SEED = 4


def box(x, y, length, width):
    points = np.random.default_rng(RNG_SEED).uniform(-0.5, 0.5, (6000, 2))
    return points * [length, width] + [x, y]


def disc(x, y, radius):
    rng = np.random.default_rng(RNG_SEED)
    turn, off = rng.uniform(0.0, 2.0 * np.pi, 6000), radius * np.sqrt(rng.uniform(0.0, 1.0, 6000))
    return np.column_stack([x + off * np.cos(turn), y + off * np.sin(turn)])


@pytest.mark.parametrize(
    ("objects", "count"),
    [
        ((disc(0.0, 0.0, 0.033),), 1),
        ((disc(0.0, 0.0, 0.033), disc(0.066, 0.0, 0.033)), 2),
        ((disc(0.0, 0.0, 0.033), disc(0.066, 0.0, 0.033), disc(0.132, 0.0, 0.033)), 3),
        ((box(0.0, 0.0, 0.05, 0.05), box(0.03, 0.05, 0.05, 0.05)), 2),
    ],
)
def test_objects_that_touch_are_as_many_as_there_are(objects, count):
    labels, found = touching_parts(np.concatenate(objects))
    assert found == count
    assert sorted(np.unique(labels)) == list(range(count))


def test_each_point_goes_with_its_object():
    labels, _ = touching_parts(np.concatenate([disc(0.0, 0.0, 0.033), disc(0.066, 0.0, 0.033)]))
    halves = labels.reshape(2, -1)
    assert all(np.mean(half == np.bincount(half).argmax()) > 0.95 for half in halves)


@pytest.mark.parametrize(
    "parts",
    [
        (box(0.0, 0.0, 0.26, 0.026), box(0.13, 0.0, 0.03, 0.12)),  # a hammer
        (box(0.0, 0.0, 0.2, 0.02), box(0.1, 0.0, 0.05, 0.05), box(-0.1, 0.0, 0.05, 0.05)),  # a wrench
        (box(0.0, 0.0, 0.1, 0.036), box(0.1, 0.0, 0.12, 0.007)),  # a screwdriver
        (box(0.0, 0.0, 0.05, 0.05), box(0.05, 0.0, 0.05, 0.05)),  # flush boxes, as was said
    ],
)
def test_one_object_of_several_parts_stays_one(parts):
    assert touching_parts(np.concatenate(parts))[1] == 1
