"""YAML values become what the ports of skills take."""

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import pytest
from pydantic import Field

from executive.tree.port_values import PortValueError, assign_ports, assignable, conforms, describe_type, port_value
from skills.api import ObjectKind, ObjectObservation, Surface
from skills.quantities import Count, Length, Speed
from skills.robot import Pose2D


class Side(enum.Enum):
    LEFT = "left"
    RIGHT = "right"


@dataclass(frozen=True)
class Drive:
    goal: Pose2D
    max_speed_m_s: float = 0.8


@dataclass(frozen=True)
class Ranged:
    speed_m_s: Speed
    gaps_m: tuple[Length, ...] = ()
    tries: Annotated[int, Field(gt=0, lt=4)] = 1


@dataclass(frozen=True)
class Two:
    first: Pose2D
    second: Pose2D


@dataclass(frozen=True)
class Positive:
    size_m: float

    def __post_init__(self):
        if self.size_m <= 0:
            raise ValueError("size_m must be above 0")


@pytest.mark.parametrize(
    ("value", "hint", "made"),
    [
        (3, int, 3),
        (3, float, 3.0),
        (True, bool, True),
        ("x", str, "x"),
        (None, str | None, None),
        ("x", str | None, "x"),
        ([1, 2], tuple[int, ...], (1, 2)),
        ([1, "a"], tuple[int, str], (1, "a")),
        ([], tuple[str, ...], ()),
        ("left", Side, Side.LEFT),
        ({"a": 1}, Mapping[str, int], {"a": 1}),
        ({"x": 1, "y": 2, "yaw": 0.5}, Pose2D, Pose2D(1.0, 2.0, 0.5)),
        ({"x_m": 1, "y_m": 2}, Pose2D, Pose2D(1.0, 2.0, 0.0)),
        ("bedroom", Pose2D, Pose2D(-4.0, 0.0, 0.0)),
        ("red hammer", ObjectKind, ObjectKind("hammer", ("red",))),
        ({"name": "hammer", "attributes": ["red"]}, ObjectKind, ObjectKind("hammer", ("red",))),
        (7, Any, 7),
        ({"size": 2}, Positive, Positive(2.0)),
    ],
)
def test_a_value_becomes_the_type_of_its_port(knowledge, value, hint, made):
    assert port_value(value, hint, knowledge) == made


def test_a_surface_is_named(knowledge):
    shelf = port_value("Shelf", Surface, knowledge)
    assert (shelf.name, shelf.height_m) == ("shelf", 1.0)


@pytest.mark.parametrize(
    ("value", "names"), [("kitchen", ["shelf", "counter"]), ("counter", ["counter"]), (["counter", "shelf"], None)]
)
def test_several_surfaces_are_named_by_their_room_or_in_a_list(knowledge, value, names):
    surfaces = port_value(value, tuple[Surface, ...], knowledge)
    assert [surface.name for surface in surfaces] == (names or value)


def test_a_record_of_records(knowledge):
    values = {
        "stamp": 0.0, "kind": "coke", "position_W": [1, 2, 0.9], "size": [0.1, 0.1, 0.1], "yaw": 0, "score": 1,
    }  # fmt: skip
    seen = port_value(values, ObjectObservation, knowledge)
    assert (seen.kind, seen.position_W, seen.surface) == (ObjectKind("coke"), (1.0, 2.0, 0.9), None)


@pytest.mark.parametrize(
    ("value", "hint", "path", "says"),
    [
        ("3", int, (), "a whole number"),
        (True, int, (), "a whole number"),
        (1, bool, (), "true or false"),
        (float("nan"), float, (), "a number"),
        ("1.0", float, (), "a number"),
        (3, str, (), "a text"),
        ("abc", tuple[str, ...], (), "a list"),
        ([1, "x"], tuple[int, ...], (1,), "a whole number"),
        ([1], tuple[int, str], (), "a list of 2"),
        ("lef", Side, (), "did you mean 'left'?"),
        ({"x": 1, "z": 2}, Pose2D, ("z",), "known are x, y and yaw"),
        ({"x": 1}, Pose2D, (), "give x, y and yaw"),
        ({"x": 1, "y": "a"}, Pose2D, ("y",), "a number"),
        ("bedrom", Pose2D, (), "did you mean 'bedroom'?"),
        ("kitchen", Surface, (), "known are shelf, counter"),
        ("bathroom", tuple[Surface, ...], (), "known are kitchen"),
        ("unicorn", ObjectKind, (), "known are coke"),
        ({"size": -1}, Positive, (), "size"),
        ([1], Mapping[str, int], (), "a mapping"),
        (1, object, (), "let an earlier step give it"),
        (None, int, (), "a whole number"),
        ({"speed": 3.1}, Ranged, ("speed",), "above 0 and at most 3 m/s"),
        ({"speed": 0}, Ranged, ("speed",), "above 0 and at most 3 m/s"),
        ({"speed": float("nan")}, Ranged, ("speed",), "a finite number"),
        ({"speed": 1, "gaps": [1, float("inf")]}, Ranged, ("gaps", 1), "a finite number"),
        ({"speed": 1, "gaps": [1, 1e9]}, Ranged, ("gaps", 1), "above 0 and at most 100 m"),
        ({"speed": 1, "tries": 4}, Ranged, ("tries",), "above 0 and below 4"),
        ({"x": 1e9, "y": 0}, Pose2D, ("x",), "from -10000 to 10000 m"),
    ],
)
def test_a_wrong_value_is_refused_with_its_place_and_the_hint(knowledge, value, hint, path, says):
    with pytest.raises(PortValueError) as error:
        port_value(value, hint, knowledge)
    assert error.value.path == path
    assert says in f"{error.value}; {error.value.hint}"


def test_fields_of_the_one_port_that_has_them_go_there():
    found = assign_ports({"x": 1, "y": 2, "max_speed": 0.4}, Drive)
    assert found == {"goal": ((), {"x": 1, "y": 2}), "max_speed_m_s": (("max_speed",), 0.4)}


@pytest.mark.parametrize(
    ("values", "inputs", "says"),
    [
        ({"gaol": 1}, Drive, "did you mean 'goal'?"),
        ({"x": 1, "speed": 2}, Drive, "did you mean 'max_speed'?"),
        ({"x": 1}, Two, "its ports are first and second"),
        ({"max_speed": 1, "max_speed_m_s": 2}, Drive, "remove one of them"),
    ],
)
def test_a_value_that_belongs_to_no_port_is_refused(values, inputs, says):
    with pytest.raises(PortValueError) as error:
        assign_ports(values, inputs)
    assert says in error.value.hint


@pytest.mark.parametrize(
    ("value", "hint", "expected"),
    [
        (1, float, True),
        (True, float, False),
        ("x", float, False),
        ((), tuple[str, ...], True),
        (("a", 1), tuple[str, ...], False),
        ((1, "a"), tuple[int, str], True),
        ((1,), tuple[int, str], False),
        (["a"], tuple[str, ...], False),
        (None, str | None, True),
        (3, str | None, False),
        (object(), Any, True),
        (3.0, Speed, True),
        (3.1, Speed, False),
        ((1.0, 0.0), tuple[Speed, ...], False),
    ],
)
def test_conforms(value, hint, expected):
    assert conforms(value, hint) is expected


@pytest.mark.parametrize(
    ("source", "target", "expected"),
    [(int, float, True), (float, int, False), (float, Speed, True), (bool, int, True), (str, str | None, True),
     (int, Any, True), (tuple[str, ...], tuple[str, ...], True), (tuple[str, ...], tuple[int, ...], False)],
)  # fmt: skip
def test_assignable(source, target, expected):
    assert assignable(source, target) is expected


def test_types_are_described_as_users_read_them():
    assert [describe_type(hint) for hint in (float, tuple[str, ...], tuple[Speed, Count] | None)] == [
        "number",
        "list of text",
        "[number above 0 and at most 3 m/s, whole number from 1 to 100000] or nothing",
    ]
