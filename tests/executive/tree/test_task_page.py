"""Pages of tasks whose own code fails: the error names the task, its distribution and its method."""

import math
import re
import sys

import pytest

from executive.tree.goals import command_goal, room_region
from executive.tree.nodes.command_plans import go_to_goal
from executive.words.command import Command
from executive.words.goal import GoalCondition, GoalKind
from executive.words.task import Part, task_named
from plant.referee.judge import judge
from plant.referee.object_history import Truth
from skills.inputs.errors import InputError
from tests.executive.house_tasks import Call, Vacuum

VACUUM = "Take [Nothing] to [kitchen] and do [vacuum] to [Nothing]"


def raising(error):
    raise error


def failing(*_):
    raise ZeroDivisionError("no floor")


def exiting(*_):
    sys.exit("no more")


# what a method of the page gives, and what is said of it
BROKEN = [
    (failing, "ZeroDivisionError: no floor"),
    (exiting, "SystemExit: no more"),
    (lambda *_: "yes", "it returns 'yes'"),
]


@pytest.mark.parametrize(("method", "message"), BROKEN)
def test_a_plan_that_fails_names_the_task(house_tasks, monkeypatch, compiled, method, message):
    monkeypatch.setattr(Vacuum, "plan", method)
    with pytest.raises(InputError, match=f"the method 'plan' of task 'vacuum' of .* has a defect: {message}"):
        compiled(VACUUM)


# a plan, and what is said of it
PLANS = [
    (lambda builder: builder.node("whirl", "mop"), "there is no node of kind 'whirl'"),
    (lambda builder: builder.sequence("mop"), "the sequence 'mop' has no steps"),
    (lambda builder: builder.sequence("mop", builder.sequence("rinse", part="rinse")), "'rinse' has no steps"),
    (lambda builder: builder.sequence("mop", None), "None is no node"),
    (lambda builder: builder.node("pause", "rest"), "the pause 'rest' lacks the option 'duration_s'"),
    (lambda builder: builder.node("pause", "rest", duration_s=1.0, often=2), "'rest' has no option 'often'"),
    (lambda builder: builder.sequence("mop", builder.sequence("rinse", builder.pause("a", "b"))), "two nodes have"),
    (lambda builder: builder.error("no water", "bring some"), "it returns InputError"),
]


@pytest.mark.parametrize(("plan", "message"), PLANS)
def test_a_plan_that_no_tree_can_be_built_of_names_the_task(house_tasks, monkeypatch, compiled, plan, message):
    monkeypatch.setattr(Vacuum, "plan", lambda _, builder: plan(builder))
    with pytest.raises(InputError, match=f"the method 'plan' of task 'vacuum' of .* has a defect: .*{message}"):
        compiled(VACUUM)


def test_a_page_that_refuses_a_command_says_so_in_its_own_words(house_tasks, monkeypatch, compiled):
    monkeypatch.setattr(Vacuum, "plan", lambda _, builder: raising(builder.error("no water", "bring some")))
    with pytest.raises(InputError, match=r"^no water \(in 'Take .*; bring some$"):
        compiled(VACUUM)


def test_the_room_of_the_start_is_a_place_for_a_page(house_tasks, monkeypatch, compiled, knowledge):
    def plan(_, builder):
        room = builder.knowledge.room(builder.place(str(builder.command.goal)))
        assert room_region(builder.command.goal, builder.knowledge)[0].name == room
        return builder.sequence(f"vacuum the {room}", go_to_goal(builder))

    monkeypatch.setattr(Vacuum, "plan", plan)
    names = {node.name for node in compiled(VACUUM.replace("kitchen", "start")).root.walk()}
    assert f"vacuum the {knowledge.room('start')}" in names


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


def test_a_judge_that_exits_is_named_and_nothing_holds(house_tasks, monkeypatch):
    monkeypatch.setattr(Call, "judge", exiting)
    report = judge([GoalCondition(GoalKind.OWN, task="call")], Truth(9.0, (), {}, {}, {}), collisions=())
    assert report.success is False and "cannot judge it (SystemExit: no more)" in report.why


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
