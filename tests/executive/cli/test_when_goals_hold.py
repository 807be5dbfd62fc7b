"""When the goal conditions of each construct must hold: what a run leaves for the referee."""

import pytest
import yaml

from executive.app.runs.goal_conditions import Share, conditions_of
from executive.mission.load import load_mission
from executive.run.outcome import Outcome
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.condition import DoorOpen, Look, Not, ValueIs
from executive.words.goal import GoalKind, When
from executive.words.leaf_steps import Awaited, CallSkill, Check, Do, DoorToOpen, OpenDoor, Wait
from executive.words.mission import Mission
from executive.words.steps import Choose, Group, Loop, Repeat, Try, While
from skills.api import Cause, Failed, Succeeded
from skills.small.doors import CheckDoorInputs
from skills.small.speak import Speak
from tests.executive.conftest import KNOWLEDGE, scripted_skill
from tests.tables import yaml_beside

AT_END, AT_STEP = When.END_OF_MISSION, When.END_OF_STEP
WHEN = {AT_END: "mission", AT_STEP: "step"}


def step(text):
    return Do.from_command(parse_command(text))


HALL = step("Take [Nothing] to [hall] and do [Nothing] to [Nothing]")
GET = step("Take [Nothing] to [kitchen] and do [grasp] to [coke]")
PUT = step("Take [coke] to [bedroom] and do [Nothing] to [Nothing]")
LOOK = Look.from_command(parse_command("Take [Nothing] to [kitchen] and do [find] to [coke]"))


@pytest.fixture
def ran(knowledge, registry, run_tree, script, robot):
    """Runs steps with scripted skills: the tree, and the robot's result."""

    def put(skill):
        robot.let_go()
        return Succeeded("put down")

    script.ends.setdefault("place", put)

    def run(*steps, mission=None):
        mission = mission or Mission(name="m", robot="Alice", steps=steps)
        tree = compile_mission(mission, knowledge=knowledge, registry=registry)
        return tree, run_tree(tree).robots[0]

    return run


GOALS = yaml_beside(__file__, "goals.yaml")


@pytest.mark.parametrize("case", GOALS, ids=lambda case: case["name"])
def test_the_construct_says_when_the_robot_must_have_been_somewhere(ran, script, case):
    failures = iter(range(case.get("fails", 0)))
    stuck = Failed(Cause.PLANNING, "stuck")
    script.ends["stow"] = lambda skill: Succeeded("stowed") if next(failures, None) is None else stuck
    script.seen_on = () if case.get("unseen") else script.seen_on
    text = yaml.safe_dump({"name": "m", "robot": "Alice", **case["mission"]}, sort_keys=False)
    tree, result = ran(mission=load_mission("m.yaml", text=text))
    assert result.outcome is Outcome.SUCCESS, result.message
    conditions = conditions_of(tree, result)
    asked = [f"{one.goal[0].name} {WHEN[one.when]}" for one in conditions if one.kind is GoalKind.WENT]
    assert (sorted(asked) if case.get("any_order") else asked) == case["asked"]


def test_each_check_of_a_condition_is_judged_at_its_time(ran):
    tree, result = ran(Repeat(loop=Loop(times=2), steps=(Choose(condition=LOOK, then=(HALL,)),)))
    looks = [one for one in conditions_of(tree, result) if one.kind is GoalKind.ANSWERED]
    assert [one.answer for one in looks] == [True, True]
    assert looks[0].answered_s < looks[1].answered_s


# seen on -> what the robot says to "is no coke in the kitchen", and its answer
@pytest.mark.parametrize(
    ("seen_on", "says", "answers"),
    [((), "yes: no coke in the kitchen", [True]), (("shelf",), "no: a coke in the kitchen", [False])],
)
def test_a_denied_question_is_answered_by_the_opposite_of_its_look(ran, script, seen_on, says, answers):
    script.seen_on = seen_on
    tree, result = ran(Check(condition=Not(part=LOOK)))
    assert (result.message, [one.answer for one in result.findings]) == (says, answers)
    assert [(one.answer, one.negated) for one in conditions_of(tree, result)] == [(answers[0], True)]


@pytest.fixture
def looks_at_door(knowledge, registry, script, monkeypatch):
    """Adds a door between hall and kitchen; scripted looks answer whether it is open, by the number of the look."""

    def answers(open_at):
        doors = [{"between": ["hall", "kitchen"], "at": [2.5, 0.0], "width": 1.0}]
        monkeypatch.setattr(knowledge, "__dict__", knowledge.model_validate({**KNOWLEDGE, "doors": doors}).__dict__)
        registry["speak"] = Speak
        registry["check_door"] = scripted_skill(script, "check_door", CheckDoorInputs, {"open": bool})
        script.ends["check_door"] = lambda _: Succeeded("seen", {"open": open_at(script.begun.count("check_door"))})

    return answers


def test_each_check_of_a_door_is_judged_at_its_time(ran, looks_at_door):
    looks_at_door(lambda number: number == 1)
    door = DoorOpen(door=("hall", "kitchen"))
    tree, result = ran(Choose(condition=door, then=(HALL,)), Check(condition=door))
    looks = [one for one in conditions_of(tree, result) if one.kind is GoalKind.DOOR_OPEN]
    name = "door between hall and kitchen"
    assert [(one.answer, one.source[0].name) for one in looks] == [(True, name), (False, name)]
    assert looks[0].answered_s < looks[1].answered_s


@pytest.mark.parametrize("is_open", [True, False])
def test_whether_a_door_is_closed_has_one_answer(ran, looks_at_door, is_open):
    looks_at_door(lambda number: is_open)
    tree, result = ran(Check(condition=Not(part=DoorOpen(door=("hall", "kitchen")))))
    (finding,) = result.findings
    assert (finding.question, finding.answer) == ("is the door between hall and kitchen closed", not is_open)
    assert "not (" not in result.message
    (asked,) = conditions_of(tree, result)
    assert (asked.kind, asked.answer, asked.negated) == (GoalKind.DOOR_OPEN, not is_open, True)


def test_a_closed_door_is_asked_for_until_it_opens(ran, looks_at_door, script):
    looks_at_door(lambda number: number == 4)
    tree, result = ran(OpenDoor(door=DoorToOpen(door=("hall", "kitchen"))))
    assert [said.text for said in result.said] == ["Please open the door between hall and kitchen."]
    assert script.begun.count("check_door") == 4
    (opened,) = conditions_of(tree, result)
    assert (opened.kind, opened.when, opened.ended_s) == (GoalKind.DOOR_OPENED, AT_STEP, result.executions[-1].ended_s)


def test_nobody_is_asked_to_open_an_open_door(ran, looks_at_door):
    looks_at_door(lambda _: True)
    _, result = ran(OpenDoor(door=DoorToOpen(door=("hall", "kitchen"))))
    assert (result.outcome, result.said) == (Outcome.SUCCESS, ())


def test_a_door_that_nobody_opens_ends_the_step_by_name(ran, looks_at_door):
    looks_at_door(lambda _: False)
    _, result = ran(OpenDoor(door=DoorToOpen(door=("hall", "kitchen"), within_s=20.0)))
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.TIMEOUT)
    assert result.message == "the door between hall and kitchen was not opened within 20 s"


def test_an_object_that_was_put_somewhere_must_stay_there(ran):
    grasped, placed = conditions_of(*ran(GET, PUT))
    assert (grasped.when, placed.when, placed.taken_s) == (AT_STEP, AT_END, ())


def test_an_object_may_leave_the_place_where_a_later_step_takes_it(ran, script):
    script.seen_on = {"counter", "bedside table"}
    tree, result = ran(GET, PUT, step("Take [Nothing] to [bedroom] and do [grasp] to [coke]"))
    first, put, again = (
        conditions_of(tree, result)[0],
        *(one for one in conditions_of(tree, result) if one.kind is GoalKind.PLACED),
        conditions_of(tree, result)[-1],
    )
    assert (first.when, again.when) == (AT_STEP, AT_END)
    assert [began for began, _ in put.taken_s] == [again.began_s]


def test_an_object_taken_by_a_failed_step_counts_as_taken_by_the_mission(ran, script):
    script.ends["relocalise"] = lambda skill: Failed(Cause.PLANNING, "stuck")
    taking = Try(steps=(GET, CallSkill(skill="relocalise")), otherwise=(Wait(awaited=Awaited(seconds=0.2)),))
    tree, result = ran(GET, PUT, taking)
    placed = next(one for one in conditions_of(tree, result) if one.kind is GoalKind.PLACED)
    assert len(placed.taken_s) == 1


def test_an_object_taken_by_another_robot_counts_as_taken_by_the_mission(ran):
    tree, result = ran(GET, PUT)
    (later,) = (one for one in result.executions if one.path_id.endswith("1-kitchen"))
    other = Share(tree, ran(GET)[1], 0)
    placed = next(one for one in conditions_of(tree, result, before=(other,)) if one.kind is GoalKind.PLACED)
    assert len(placed.taken_s) == 1
    assert later.done


def test_a_condition_of_while_must_hold_always(ran):
    group = Group(steps=(HALL,), while_=While(holds=ValueIs(text="holding")))
    tree, result = ran(GET, group)
    always = [one for one in conditions_of(tree, result) if one.when is When.ALWAYS]
    assert [(one.kind, one.classes) for one in always] == [(GoalKind.GRASPED, ())]


# a skill on its own -> what it is asked for
@pytest.mark.parametrize(
    ("call", "kind", "where"),
    [
        (CallSkill(skill="navigate", values={"x": 4.0, "y": -1.0}), GoalKind.WENT, "(4.00, -1.00)"),
        (CallSkill(skill="place", values={"surface": "counter"}), GoalKind.PLACED, "counter"),
        (CallSkill(skill="hand_over", values={"person": "Sam"}), GoalKind.HANDED_OVER, None),
        (CallSkill(skill="stow"), None, None),
    ],
)
def test_a_skill_on_its_own_is_judged_by_what_its_inputs_say(ran, call, kind, where):
    tree, _ = ran(GET, call)
    last = tree.parts[-1].goal
    assert (last and GoalKind[last.kind.name]) is kind
    assert where is None or last.goal[0].name == where
