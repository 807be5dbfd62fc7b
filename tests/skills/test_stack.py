"""The stack: what a file chooses, what it may set, and what is refused."""

import dataclasses

import pytest
from planar_robot import Bench

from skills.navigate.skill import Navigate
from skills.robot import Pose2D
from skills.stack import DEFAULT_FILE, SLOTS, StackError, default_stack, plain, stack_of, stack_schema


def test_what_a_file_leaves_out_is_as_in_the_default():
    assert plain(stack_of({})) == plain(default_stack())
    assert set(default_stack().names) == set(SLOTS)


def test_the_resolved_stack_reads_back_to_itself():
    assert stack_of(plain(default_stack())).planner == default_stack().planner
    assert plain(stack_of(plain(default_stack()))) == plain(default_stack())


def test_options_are_set_and_the_others_stay():
    stack = stack_of({"planner": {"use": "lattice", "margin_m": 0.2}, "localiser": {"matching": {"iterations": 3}}})
    assert stack.planner == dataclasses.replace(default_stack().planner, margin_m=0.2)
    assert (stack.localiser.matching.iterations, stack.localiser.max_range_m) == (3, 15.0)


def test_a_skill_takes_its_options_from_the_stack():
    context = dataclasses.replace(
        Bench(Pose2D(1.5, 5.4, 0.0)).context(), stack=stack_of({"skills": {"navigate": {"replans": 2}}})
    )
    assert Navigate(context).options.replans == 2
    assert Navigate(context).options.stuck_s == Navigate.Options().stuck_s


# data                                                       where it is wrong                        what would fit
@pytest.mark.parametrize(
    ("data", "path", "hint"),
    [
        ({"localizer": {}}, ("localizer",), "localiser"),
        ({"planner": {"use": "magic"}}, ("planner", "use"), "lattice"),
        ({"planner": {"margin": 0.1}}, ("planner", "margin"), "margin_m"),
        ({"planner": {"margin_m": "wide"}}, ("planner", "margin_m"), "'wide'"),
        ({"localiser": {"matching": {"sigma": 1}}}, ("localiser", "matching", "sigma"), "sigma_m"),
        ({"skills": {"fly": {}}}, ("skills", "fly"), "navigate"),
        ({"skills": {"navigate": {"people": {"periods": 1}}}}, ("skills", "navigate", "people", "periods"), "period_s"),
        ({"costmap": 3}, ("costmap",), "use"),
        ([], (), "localiser"),
    ],
)
def test_what_does_not_fit_is_refused_with_its_place(data, path, hint):
    with pytest.raises(StackError) as error:
        stack_of(data)
    assert error.value.path == path
    assert hint in error.value.hint


def test_the_schema_knows_every_slot_and_option():
    schema = stack_schema()
    assert set(SLOTS) | {"skills"} == set(schema["properties"])
    (lattice,) = schema["properties"]["planner"]["anyOf"]
    fields = {field.name for field in dataclasses.fields(default_stack().planner)}
    assert set(lattice["properties"]) == fields | {"use"}
    assert DEFAULT_FILE.is_file()
