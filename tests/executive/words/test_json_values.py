"""Values are read back from JSON equal and with their types."""

import enum
from dataclasses import dataclass

import numpy as np
import pytest
from pydrake.math import RigidTransform

from executive.words.json_values import from_text, to_text
from skills.api import ObjectKind, ObjectObservation, Surface
from skills.robot import CommandState, Pose2D
from tests.tables import table

SEEN = ObjectObservation(12.5, ObjectKind("coke", ("red",)), (1.0, 2.0, 0.9), (0.06, 0.06, 0.12), 0.3, 0.9, "counter")


@pytest.mark.parametrize(
    "value",
    [
        None,
        True,
        3,
        0.1 + 0.2,
        float("inf"),
        "a [bracket] and \N{DEGREE SIGN}",
        SEEN,
        Pose2D(1.0, -2.0, 0.1),
        (Surface("shelf", ((0.0, 1.0), (2.0, 3.0)), 1.0), "x"),
        ["a", (1, 2)],
        {"a": (1, 2), (1, 2): "b"},
        frozenset({3, 5}),
        CommandState.DONE,
    ],
    ids=repr,
)
def test_values_come_back_equal(value):
    again = from_text(to_text(value))
    assert again == value
    assert type(again) is type(value)


def test_arrays_keep_shape_and_type():
    array = np.arange(6, dtype=np.float32).reshape(2, 3)
    again = from_text(to_text(array))
    assert np.array_equal(again, array)
    assert again.dtype == array.dtype


def test_transforms_come_back_to_the_last_bit():
    X = Pose2D(0.1, 0.2, 0.3).transform(0.4)
    again = from_text(to_text(X))
    assert isinstance(again, RigidTransform)
    assert np.array_equal(again.GetAsMatrix34(), X.GetAsMatrix34())


def test_values_without_a_stored_form_are_refused():
    with pytest.raises(TypeError, match="function cannot be stored"):
        to_text((1, lambda: 0))


@pytest.mark.parametrize(*table(__file__, "damaged"))
def test_damaged_text_and_missing_classes_are_refused(text):
    with pytest.raises(ValueError, match=r".+"):
        from_text(text)


def test_a_text_that_is_nested_deeply_is_refused():
    with pytest.raises(ValueError, match="no value can be read"):
        from_text("[" * 5000)


def test_classes_inside_functions_are_refused_when_read():
    @dataclass(frozen=True)
    class Local:
        n: int

    class Colour(enum.Enum):
        RED = 1

    for value in (Local(1), Colour.RED):
        with pytest.raises(ValueError, match="no class"):
            from_text(to_text(value))
