"""The judge of comparisons knows the sizes and weights of the objects, and hears what the robot said."""

import numpy as np
import pytest

from errand_home.tasks import Compare
from executive.words.goal import GoalCondition, GoalKind, Region
from plant.referee.object_history import ObjectHistory, ObjectSample, Truth

DESK = Region("desk", ((0, 0), (1, 0), (1, 1), (0, 1)), 0.7, 1.0)
FRUIT = ("apple", "banana", "lemon")


def history(name, at_W, sides_m, mass_kg):
    one = ObjectHistory(name, name, sides_m, mass_kg)
    one.add(ObjectSample(0.0, np.array(at_W), None, None, supported=True, on_floor=False))
    return one


OBJECTS = (
    history("apple", (0.2, 0.5, 0.8), (0.076, 0.076, 0.078), 0.16),
    history("banana", (0.5, 0.5, 0.8), (0.164, 0.060, 0.038), 0.13),
    history("lemon", (0.8, 0.5, 0.8), (0.085, 0.054, 0.054), 0.10),
    history("milk", (0.8, 0.8, 0.8), (0.075, 0.075, 0.146), 0.52),
    history("iced_tea", (5.0, 5.0, 0.8), (0.067, 0.067, 0.20), 0.55),
)


# what was asked, of which classes, how many; what was said; whether it is right
@pytest.mark.parametrize(
    ("wanted", "classes", "count", "said", "right"),
    [
        ("biggest fruit", FRUIT, 1, "the biggest fruit on the desk is the banana", True),
        ("biggest fruit", FRUIT, 1, "the biggest fruit on the desk is the apple", False),
        ("biggest fruit", FRUIT, 1, "the biggest fruit on the desk is the banana and the apple", False),
        ("smallest fruit", FRUIT, 1, "the smallest fruit on the desk is the lemon", True),  # within a centimetre
        ("thinnest fruit", FRUIT, 1, "the thinnest fruit on the desk is the banana", True),
        ("heaviest object", (), 1, "the heaviest object on the desk is the milk, by the weights in my notes", True),
        ("heaviest object", (), 1, "the heaviest object on the desk is the iced tea", False),
        ("heaviest object", (), 2, "the two heaviest objects on the desk are the milk and the apple", True),
        ("heaviest object", (), 2, "the two heaviest objects on the desk are the milk", False),
        ("heaviest toy", ("duck",), 1, "there is no toy on the desk", True),
        ("heaviest toy", ("duck",), 1, "the heaviest toy on the desk is the milk", False),
        ("biggest fruit", FRUIT, 1, "there is no fruit on the desk", False),
        ("biggest fruit", FRUIT, 1, "", False),
    ],
)
def test_a_comparison_is_right_by_true_sizes_and_weights(wanted, classes, count, said, right):
    heard = (said,) if said else ()
    condition = GoalCondition(GoalKind.OWN, classes, count, (DESK,), wanted=wanted, task="compare", said=heard)
    holds, why = Compare().judge(condition, Truth(9.0, OBJECTS, {}, {}, {}))
    assert holds is right, why
