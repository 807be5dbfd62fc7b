"""The judges of the pages, and the names that the pages import."""

import ast
import sys
from pathlib import Path

import numpy as np
import pytest

from executive.words.goal import GoalCondition, GoalKind, Region
from plant.referee.object_history import ObjectHistory, ObjectSample, TimedPath, TimedPoses, Truth
from tests.docs.documents import DOCS
from tests.missions.own_tasks.read_number import ReadNumber
from tests.missions.own_tasks.water import TIPS_H, Water

sys.path.insert(0, str(DOCS))
from make_api import public_names

BEER_W = np.array([2.0, 1.0, 0.9])
WATERED = GoalCondition(GoalKind.OWN, ("beer",), wanted="beer", task="water", robot="Alice", began_s=0.0, ended_s=9.0)
READ = GoalCondition(GoalKind.OWN, goal=(Region("meter", ((0, 0), (1, 0), (1, 1))),), task="read")


def truth(roll_rad, above_W, lasts_s):
    """A hand that rolls at 2 s at a place relative to the beer, and is level again after some seconds."""
    beer = ObjectHistory("beer", "beer", (0.06, 0.06, 0.12))
    beer.add(ObjectSample(0.0, BEER_W, None, None, supported=True, on_floor=False))
    p_WH = BEER_W + above_W - TIPS_H
    positions = TimedPath(np.array([[*p_WH, 0.0]]))
    turns = TimedPath(np.array([[0, 0, 0, 0.0], [roll_rad, 0, 0, 2.0], [0, 0, 0, 2.0 + lasts_s]]))
    return Truth(9.0, (beer,), {}, {}, {}, hands={"Alice": TimedPoses(positions, turns)})


@pytest.mark.parametrize(
    ("hand", "right"),
    [
        pytest.param(truth(1.2, (0.0, 0.0, 0.2), 3.5), True, id="tilted over it"),
        pytest.param(truth(1.2, (0.0, 0.0, 0.2), 1.5), False, id="too short"),
        pytest.param(truth(0.3, (0.0, 0.0, 0.2), 3.5), False, id="hardly tilted"),
        pytest.param(truth(1.2, (0.0, 0.3, 0.2), 3.5), False, id="beside it"),
        pytest.param(truth(1.2, (0.0, 0.0, -0.2), 3.5), False, id="below it"),
    ],
)
def test_watering_is_judged_by_where_the_hand_was(hand, right):
    assert Water().judge(WATERED, hand)[0] is right


@pytest.mark.parametrize(
    ("said", "right"),
    [
        pytest.param("the meter shows 407", True, id="the number"),
        pytest.param("the meter shows 401", False, id="another number"),
        pytest.param("the meter shows 4073", False, id="one digit more"),
    ],
)
def test_a_reading_is_judged_by_the_number_that_the_display_was_made_with(said, right):
    condition = GoalCondition(GoalKind.OWN, goal=READ.goal, task="read", said=(said,))
    assert ReadNumber().judge(condition, None)[0] is right


@pytest.mark.parametrize("page", ["water", "read_number"])
def test_the_pages_import_only_public_names(page):
    source = (Path(__file__).parent / f"{page}.py").read_text()
    imports = [each for each in ast.walk(ast.parse(source)) if isinstance(each, ast.ImportFrom)]
    ours = [each for each in imports if each.module.partition(".")[0] in ("executive", "skills", "plant")]
    assert ours
    private = [(each.module, name.name) for each in ours for name in each.names]
    assert [each for each in private if each[1] not in public_names().get(each[0], ())] == []
