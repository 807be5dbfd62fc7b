"""When the goal conditions of each construct must hold: what a run leaves for the referee."""

import pytest

from executive.app.goal_conditions import Share, conditions_of
from executive.run.outcome import Outcome
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.condition import DoorOpen, Look, ValueIs
from executive.words.goal import GoalKind, When
from executive.words.leaf_steps import Awaited, CallSkill, Check, Do, DoorToOpen, OpenDoor, Set, Wait
from executive.words.mission import Mission
from executive.words.policy import Policy
from executive.words.steps import Choose, Group, Handler, Loop, Repeat, Together, Try, While
from skills.api import Cause, Failed, Succeeded
from skills.check_door.skill import CheckDoorInputs
from skills.speak.skill import Speak
from tests.executive.conftest import KNOWLEDGE, scripted_skill

AT_END, AT_STEP = When.END_OF_MISSION, When.END_OF_STEP


def step(text, **policy):
    return Do.from_command(parse_command(text)).with_policy(Policy(**policy))


def go(place, **policy):
    return step(f"Take [Nothing] to [{place}] and do [Nothing] to [Nothing]", **policy)


GET = step("Take [Nothing] to [kitchen] and do [grasp] to [coke]")
PUT = step("Take [coke] to [bedroom] and do [Nothing] to [Nothing]")
LOOK = Look.from_command(parse_command("Take [Nothing] to [kitchen] and do [find] to [coke]"))


def block(made):
    return made


def holds(text):
    return ValueIs(text=text)


@pytest.fixture
def ran(knowledge, registry, run_tree, script, robot):
    """Runs steps with scripted skills: the tree, and the robot's result."""

    def put(skill):
        robot.let_go()
        return Succeeded("put down")

    script.ends.setdefault("place", put)

    def run(*steps, name="Alice", **watched):
        mission = Mission(name="m", robot=name, steps=steps, **watched)
        tree = compile_mission(mission, knowledge=knowledge, registry=registry)
        return tree, run_tree(tree).robots[0]

    return run


@pytest.fixture
def asked(ran):
    """Runs steps that succeed: what is asked of where the robot went, in order, as (place, when)."""

    def ask(*steps, **watched):
        tree, result = ran(*steps, **watched)
        assert result.outcome is Outcome.SUCCESS, result.message
        found = conditions_of(tree, result)
        return [(one.goal[0].name, one.when) for one in found if one.kind is GoalKind.WENT]

    return ask


def when(*steps, condition="elapsed > 0.05", times=1):
    return (Handler(condition=holds(condition), steps=steps, times=times),)


def test_of_two_places_the_first_holds_at_the_end_of_its_step_and_the_last_until_the_end(asked):
    assert asked(go("hall"), go("kitchen")) == [("hall", AT_STEP), ("kitchen", AT_END)]


def test_if_is_asked_for_the_branch_that_was_taken(asked):
    choose = Choose(condition=holds("elapsed > 5000"), then=(go("hall"),), otherwise=(go("kitchen"),))
    assert asked(block(choose)) == [("kitchen", AT_END)]


def test_each_check_of_a_condition_is_judged_at_its_time(ran):
    tree, result = ran(block(Repeat(loop=Loop(times=2), steps=(block(Choose(condition=LOOK, then=(go("hall"),))),))))
    looks = [one for one in conditions_of(tree, result) if one.kind is GoalKind.ANSWERED]
    assert [one.answer for one in looks] == [True, True]
    assert looks[0].answered_s < looks[1].answered_s


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
    tree, result = ran(block(Choose(condition=door, then=(go("hall"),))), block(Check(condition=door)))
    looks = [one for one in conditions_of(tree, result) if one.kind is GoalKind.DOOR_OPEN]
    assert [(one.answer, one.source[0].name) for one in looks] == [
        (True, "door between hall and kitchen"),
        (False, "door between hall and kitchen"),
    ]
    assert looks[0].answered_s < looks[1].answered_s


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


def test_each_round_of_repeat_is_asked_for(asked):
    repeat = Repeat(loop=Loop(times=2), steps=(go("hall"), go("kitchen")))
    assert asked(block(repeat)) == [("hall", AT_STEP)] * 2 + [("kitchen", AT_STEP), ("kitchen", AT_END)]


def test_rounds_are_asked_for_though_the_last_decision_reset_them(asked):
    count = Set(set={"n": "n + 1"})
    repeat = Repeat(loop=Loop(times=9, while_=holds("n < 2")), steps=(go("hall"), block(count)))
    assert asked(block(Set(set={"n": "0"})), block(repeat)) == [("hall", AT_STEP), ("hall", AT_END)]


def test_actions_of_a_failed_try_branch_do_not_count(asked, script):
    script.seen_on = ()
    tried = Try(steps=(go("hall"), GET), otherwise=(go("kitchen"),))
    assert asked(block(tried)) == [("kitchen", AT_END)]


def test_a_step_that_together_stopped_does_not_count(asked):
    slow = Group(steps=(go("hall"), go("kitchen"), go("hall")))
    together = Together(steps=(block(slow), block(Wait(awaited=Awaited(seconds=0.2)))), done_when=1)
    assert asked(block(together), go("bedroom")) == [("bedroom", AT_END)]


@pytest.mark.parametrize("as_whole", [True, False])
def test_when_is_asked_for_at_the_end_of_its_own_steps(asked, as_whole):
    handlers = when(go("hall"))
    found = asked(go("kitchen"), when=handlers) if as_whole else asked(Group(steps=(go("kitchen"),), when=handlers))
    assert sorted(found, key=str) == [("hall", AT_STEP), ("kitchen", AT_END)]


def test_after_a_handler_that_went_elsewhere_the_last_place_is_asked_for_at_the_end_of_its_step(asked):
    group = Group(
        steps=(go("kitchen"), block(Wait(awaited=Awaited(seconds=9.0)))), when=when(go("hall"), condition="elapsed > 4")
    )
    assert sorted(asked(block(group)), key=str) == [("hall", AT_END), ("kitchen", AT_STEP)]


def test_always_is_asked_for(asked):
    group = Group(steps=(go("kitchen"),), always=(go("hall"),))
    assert asked(block(group)) == [("kitchen", AT_STEP), ("hall", AT_END)]


def test_a_group_and_the_rounds_of_for_each_are_asked_for_as_steps_in_a_row(asked):
    group = Group(steps=(go("hall"), block(Group(steps=(go("kitchen"),)))))
    assert asked(block(group), go("hall")) == [("hall", AT_STEP), ("kitchen", AT_STEP), ("hall", AT_END)]


def test_a_failed_attempt_does_not_count(asked, script):
    failures = iter([True, True, True, True, True, True])

    def stow(skill):
        return Failed(Cause.PLANNING, "stuck") if next(failures, False) else Succeeded("stowed")

    script.ends["stow"] = stow
    group = Group(steps=(go("hall"), CallSkill(skill="stow")))
    tried = group.with_policy(Policy(retries=6))
    assert asked(tried) == [("hall", AT_STEP)]


def test_an_object_that_was_put_somewhere_must_stay_there(ran):
    grasped, placed = conditions_of(*ran(GET, PUT))
    assert (grasped.when, placed.when, placed.taken_s) == (AT_STEP, AT_END, ())


def test_an_object_may_leave_the_place_where_a_later_step_takes_it(ran):
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
    taking = Try(steps=(GET, CallSkill(skill="relocalise")), otherwise=(block(Wait(awaited=Awaited(seconds=0.2))),))
    tree, result = ran(GET, PUT, block(taking))
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
    group = Group(steps=(go("hall"),), while_=While(holds=holds("holding")))
    tree, result = ran(GET, block(group))
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
