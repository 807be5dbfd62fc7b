"""Search for any object, whether the detector knows its class or not."""

from dataclasses import replace

import pytest
from table_robot import Colours, TableRobot, context_of, failed, outcome
from table_scene import BLUE, COKE, GREEN, RED, TABLE, Can

from skills.api import Cause, Succeeded
from skills.detect.skill import Detect, DetectInputs

ANY = DetectInputs(("thing",), (TABLE,))
ALL = replace(ANY, count=0)
ODD = Can(1.1, 0.25, 0.04, 0.09, GREEN)


def seen(things, inputs, **options):
    step = outcome(Detect(context_of(TableRobot(things=things), **options)), inputs)
    assert isinstance(step, Succeeded), step
    return step


def test_object_without_a_label_is_a_thing_with_pose_and_size():
    (found,) = seen([ODD], ALL).outputs["observations"]
    assert (found.kind.name, found.surface) == ("thing", "table")
    assert found.position_W == pytest.approx((ODD.x, ODD.y, 0.795), abs=0.012)
    assert found.size_m == pytest.approx((0.08, 0.08, 0.09), abs=0.015)


def test_a_label_is_matched_to_its_segment():
    step = seen([COKE, ODD], ALL)
    assert sorted(each.kind.name for each in step.outputs["observations"]) == ["coke", "thing"]
    assert sorted(step.message.removeprefix("there are ").removesuffix(" on the table").split(" and ")) == [
        "one coke",
        "one thing",
    ]


def test_objects_that_touch_are_two():
    pair = [Can(1.0, 0.0, 0.033, 0.115, GREEN), Can(1.0, 0.067, 0.033, 0.115, GREEN)]
    found = seen(pair, ALL).outputs["observations"]
    assert sorted(round(each.position_W[1], 2) for each in found) == pytest.approx([0.0, 0.07], abs=0.011)


def test_the_nearest_and_most_free_is_the_first():
    near, far = Can(0.95, 0.0, 0.03, 0.1, GREEN), Can(1.25, 0.0, 0.03, 0.1, GREEN)
    assert seen([far, near], ANY).outputs["observation"].position_W[0] == pytest.approx(near.x, abs=0.015)
    hemmed = [Can(0.95, y, 0.03, 0.1, GREEN) for y in (0.0, 0.09)]
    free = Can(1.0, -0.25, 0.03, 0.1, GREEN)
    assert seen([*hemmed, free], ANY).outputs["observation"].position_W[1] == pytest.approx(free.y, abs=0.015)


def test_search_for_anything_on_an_empty_table_fails():
    failed(Detect(context_of(TableRobot(things=[]))), ANY, Cause.POSTCONDITION, "no thing seen on the table")


def test_an_object_is_found_again_at_its_expected_position():
    inputs = replace(ANY, expected_W=(ODD.x, ODD.y, 0.795))
    assert seen([COKE, ODD], inputs).outputs["observation"].position_W[1] == pytest.approx(ODD.y, abs=0.015)


def test_an_object_without_a_class_has_colours_and_no_size_attribute():
    red = replace(ODD, colour=RED)
    unknowing = Colours({"coke": BLUE})
    assert seen([red], replace(ANY, attributes=("red",)), detector=unknowing).outputs["observation"].kind.attributes
    skill = Detect(context_of(TableRobot(things=[ODD])))
    failed(skill, replace(ANY, attributes=("big",)), Cause.POSTCONDITION, "no big thing")
