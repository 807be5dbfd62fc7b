"""Tests of stack files: choices, options, refusals."""

import dataclasses
from typing import get_args, get_type_hints

import pytest
from planar_robot import Bench

from executive.tree.port_values import conforms, field_types
from skills.navigate.skill import Navigate
from skills.quantities import base_type, bounds
from skills.robot import Pose2D
from skills.stack import (
    SLOTS,
    StackError,
    components,
    default_stack,
    skill_options,
    stack_data,
    stack_of,
)
from tests.project import project_skills
from tests.tables import table


def test_missing_parts_of_a_file_come_from_the_default():
    assert stack_data(stack_of({})) == stack_data(default_stack())
    assert set(default_stack().names) == set(SLOTS)


def test_the_resolved_stack_reads_back_to_itself():
    assert stack_of(stack_data(default_stack())).planner == default_stack().planner
    assert stack_data(stack_of(stack_data(default_stack()))) == stack_data(default_stack())


def test_options_are_set_and_the_others_stay():
    localiser = {"use": "scan_matching", "matching": {"iterations": 3}}
    stack = stack_of({"planner": {"use": "lattice", "margin_m": 0.2}, "localiser": localiser})
    assert stack.planner == dataclasses.replace(default_stack().planner, margin_m=0.2)
    assert (stack.localiser.matching.iterations, stack.localiser.max_range_m) == (3, 15.0)


def test_a_skill_takes_its_options_from_the_stack():
    context = dataclasses.replace(
        Bench(Pose2D(1.5, 5.4, 0.0)).context(), stack=stack_of({"skills": {"navigate": {"replans": 2}}})
    )
    assert Navigate(context).options.replans == 2
    assert Navigate(context).options.stuck_s == Navigate.Options().stuck_s


@pytest.mark.parametrize(*table(__file__, "wrong_values"))
def test_a_wrong_value_is_refused_with_its_place(data, path, hint):
    with pytest.raises(StackError) as error:
        stack_of(data)
    assert error.value.path == tuple(path)
    assert hint in error.value.hint


@pytest.mark.parametrize("value", [-1, 0, 100])
def test_a_value_out_of_range_is_refused_with_the_range(value):
    with pytest.raises(StackError) as error:
        stack_of({"controller": {"max_speed_m_s": value}})
    assert "above 0 and at most 3 m/s" in error.value.message


def numbers(record, where):
    """Every number in a dataclass, in what it holds as well, by its place."""
    for name, hint in get_type_hints(record, include_extras=True).items():
        parts = [hint, *get_args(hint)] if not bounds(hint) else [hint]
        yield from ((f"{where}.{name}", part) for part in parts if base_type(part) in (int, float))
        for part in parts:
            if dataclasses.is_dataclass(part):
                yield from numbers(part, f"{where}.{name}")


OPTIONS = {**skill_options(), **{name: kind for slot in SLOTS for name, kind in components(slot).items()}}
INPUTS = {f"{name}.Inputs": skill.Inputs for name, skill in project_skills().items()}


@pytest.mark.parametrize("record", [*OPTIONS.values(), *INPUTS.values()], ids=[*OPTIONS, *INPUTS])
def test_every_number_of_a_port_and_of_an_option_has_a_range_that_holds_its_default(record):
    for where, hint in numbers(record, record.__name__):
        assert bounds(hint).keys() & {"gt", "ge"} and bounds(hint).keys() & {"lt", "le"}, where
    for field in dataclasses.fields(record):
        if field.default is not dataclasses.MISSING:
            assert conforms(field.default, field_types(record)[field.name]), field.name
