"""Pages of tasks whose own code fails: the error names the task, its distribution and its method."""

import math
import re

import pytest

from executive.tree.goals import command_goal
from executive.words.command import Command
from executive.words.goal import GoalCondition, GoalKind
from executive.words.task import Part, task_named
from plant.referee.judge import judge
from plant.referee.object_history import Truth
from skills.inputs.errors import InputError
from tests.executive.house_tasks import Call, Vacuum

VACUUM = "Take [Nothing] to [kitchen] and do [vacuum] to [Nothing]"


def failing(*_):
    raise ZeroDivisionError("no floor")


# what a method of the page gives, and what is said of it
BROKEN = [(failing, "ZeroDivisionError: no floor"), (lambda *_: "yes", "it returns 'yes'")]


@pytest.mark.parametrize(("method", "message"), BROKEN)
def test_a_plan_that_fails_names_the_task(house_tasks, monkeypatch, compiled, method, message):
    monkeypatch.setattr(Vacuum, "plan", method)
    with pytest.raises(InputError, match=f"the method 'plan' of task 'vacuum' of .* has a defect: {message}"):
        compiled(VACUUM)


def test_a_task_for_a_time_has_a_plan(house_tasks, compiled):
    house_tasks["rest"] = type("Rest", (Vacuum,), {"word": "rest", "object_is": Part.TIME})()
    assert compiled("Take [Nothing] to [kitchen] and do [rest] to [300 second]").commands[0].object_count == 300


@pytest.mark.parametrize(("method", "message"), BROKEN)
def test_a_promise_that_fails_names_the_task(house_tasks, monkeypatch, knowledge, method, message):
    monkeypatch.setattr(Vacuum, "promise", method)
    with pytest.raises(InputError, match=f"the method 'promise' of task 'vacuum' of .* has a defect: {message}"):
        command_goal(Command(goal="kitchen", task=task_named("vacuum")), knowledge)


#   what the judge of a page gives, and what the referee says
@pytest.mark.parametrize(
    ("given", "success", "why"),
    [
        ((True, "It was called."), True, "It was called."),
        (("no", "It was called."), False, "cannot judge it .*no pair of True or False and a sentence"),
        ((math.nan, "It was called."), False, "cannot judge it"),
        ((True, ""), False, "cannot judge it"),
        (True, False, "cannot judge it"),
    ],
)
def test_a_judge_that_gives_no_verdict_is_named_and_nothing_holds(house_tasks, monkeypatch, given, success, why):
    monkeypatch.setattr(Call, "judge", lambda *_: given)
    report = judge([GoalCondition(GoalKind.OWN, task="call")], Truth(9.0, (), {}, {}, {}), collisions=())
    assert report.success is success and re.search(why, report.why)


def test_a_promise_of_a_page_is_judged_by_that_page(house_tasks, monkeypatch, knowledge):
    monkeypatch.setattr(Vacuum, "promise", lambda *_: GoalCondition(GoalKind.OWN))
    assert command_goal(Command(goal="kitchen", task=task_named("vacuum")), knowledge).task == "vacuum"


@pytest.mark.parametrize(
    ("part", "given", "message"),
    [("goal_is", "kitchen", "'vacuum' takes no place, as in 'kitchen'"), ("object_is", "beer", "takes no object")],
)
def test_a_part_that_a_task_does_not_have_is_refused(house_tasks, monkeypatch, compiled, part, given, message):
    monkeypatch.setattr(Vacuum, part, Part.NOTHING)
    goal, thing = (given, "Nothing") if part == "goal_is" else ("kitchen", given)
    with pytest.raises(InputError, match=message):
        compiled(f"Take [Nothing] to [{goal}] and do [vacuum] to [{thing}]")
