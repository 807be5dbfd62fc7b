"""The goal conditions of missions, and what the referee is told of them."""

from dataclasses import replace

import pytest

from executive.app.runs.goal_conditions import conditions_of, verdict_of
from executive.tree.compiler import compile_mission
from executive.tree.goals import command_goal
from executive.words.command import parse_command
from executive.words.goal import GoalKind, RefereeReport, When
from executive.words.leaf_steps import CallSkill, Do, Speak, UseMission
from executive.words.mission import Mission
from executive.words.step import OnFailure, Policy
from executive.words.steps import Loop, Repeat
from skills.api import Cause, Failed, Succeeded
from skills.small.speak import Speak as SpeakSkill
from tests.tables import yaml_beside


def conditions(knowledge, *texts):
    return tuple(command_goal(parse_command(text), knowledge) for text in texts)


def facts_of(condition, expected):
    """The facts of a condition that are expected, in their form in YAML."""
    names = {key: [one.name for one in getattr(condition, key) or ()] for key in ("goal", "maybe", "source")}
    facts = {"kind": condition.kind.name, "person": condition.person, "classes": list(condition.classes)}
    facts |= {"goal": sorted(names["goal"]), "maybe": names["maybe"], "source": sorted(names["source"])}
    facts |= {"rooms": names["source"], "at": expected.get("at")}
    return {key: facts[key] for key in expected}


CONDITIONS = yaml_beside(__file__, "conditions.yaml")


@pytest.mark.parametrize("case", CONDITIONS, ids=lambda case: case["commands"][-1])
def test_commands_have_goal_conditions(knowledge, case):
    found = conditions(knowledge, *case["commands"])
    assert [*map(facts_of, found, case["conditions"])] == case["conditions"]
    for one, expected in zip(found, case["conditions"], strict=True):
        if "at" in expected:
            assert (one.goal[0].contains(expected["at"]), one.goal[0].contains((-9.0, 9.0, 0.5))) == (True, False)


def test_surface_regions_begin_at_the_top(knowledge, make):
    grasp, _ = conditions(knowledge, *make.FETCH)
    counter = next(region for region in grasp.source if region.name == "counter")
    assert (round(counter.z_min_m, 3), round(counter.z_max_m, 3)) == (0.85, 1.2)
    assert counter.contains((5.8, -1.8, 0.95))


GET = "Take [Nothing] to [kitchen] and do [grasp] to [coke]"
GO = "Take [Nothing] to [hall] and do [Nothing] to [Nothing]"
SKIPPED = Policy(on_failure=OnFailure.SKIP)


@pytest.fixture
def conditions_by(knowledge, registry, run_tree):
    """The conditions of a mission's steps after it ran with the scripted robot."""

    def after_running(*steps):
        mission = Mission(name="m", robot="Alice", steps=steps)
        tree = compile_mission(mission, knowledge=knowledge, registry=registry)
        return conditions_of(tree, run_tree(tree).robots[0])

    return after_running


def step(text, policy=SKIPPED):
    return Do.from_command(parse_command(text)).with_policy(policy)


def test_a_step_that_was_skipped_has_no_condition(conditions_by, script):
    script.seen_on = ()
    assert [condition.kind for condition in conditions_by(step(GET), step(GO))] == [GoalKind.WENT]


def test_a_step_that_could_have_been_skipped_but_was_done_has_its_condition(conditions_by):
    assert [condition.kind for condition in conditions_by(step(GET))] == [GoalKind.GRASPED]


def test_steps_of_a_used_mission_that_was_skipped_have_no_conditions(conditions_by, script):
    script.seen_on = ()
    used = Mission(name="inner", robot="Alice", steps=(step(GO, Policy()), step(GET, Policy())))
    outer = UseMission(use="inner.yaml").with_mission(used).with_policy(SKIPPED)
    assert [condition.kind for condition in conditions_by(outer, step(GO))] == [GoalKind.WENT]


def test_a_drive_to_a_pose_asks_for_the_body_there(conditions_by):
    (condition,) = conditions_by(CallSkill(skill="navigate", values={"x": 4.0, "y": -1.0}))
    assert condition.kind is GoalKind.WENT
    assert condition.goal[0].contains((4.1, -0.9, 0.5))
    assert not condition.goal[0].contains((4.5, -1.0, 0.5))


# place that is said      surfaces from which the object may come: the kitchen is a coke's usual place
@pytest.mark.parametrize(
    ("place", "surfaces"), [("kitchen", {"bedside table", "counter", "shelf"}), ("bedroom", {"bedside table"})]
)
def test_an_object_may_come_from_elsewhere_unless_another_than_its_usual_place_is_said(conditions_by, place, surfaces):
    (condition,) = conditions_by(step(f"Take [Nothing] to [{place}] and do [grasp] to [coke]"))
    assert {region.name for region in condition.source} == surfaces


def test_an_answer_belongs_to_its_own_check(conditions_by, script):
    find = "Take [Nothing] to [{}] and do [find] to [coke]"
    kitchen, bedroom = conditions_by(step(find.format("kitchen")), step(find.format("bedroom")))
    assert (kitchen.answer, bedroom.answer) == (True, False)


def test_a_step_that_ended_well_is_judged_at_its_end_when_a_later_one_fails(conditions_by, script):
    script.seen_on = ()
    went, grasped = conditions_by(step(GO, Policy()), step(GET, Policy()))
    assert (went.kind, went.when, grasped.kind) == (GoalKind.WENT, When.END_OF_STEP, GoalKind.GRASPED)
    assert went.began_s < went.ended_s <= grasped.began_s < grasped.ended_s


def test_each_round_that_ended_well_is_judged_when_a_later_one_fails(conditions_by, script):
    drives = []

    def navigate(skill):
        drives.append(skill)
        return Succeeded("there") if len(drives) < 3 else Failed(Cause.PLANNING, "no way")

    script.ends["navigate"] = navigate
    rounds = conditions_by(Repeat(loop=Loop(times=3), steps=(step(GO, Policy()),)))
    assert [one.when for one in rounds] == [When.END_OF_STEP, When.END_OF_STEP]


@pytest.mark.parametrize("object_", ["coke", "some coke"])
def test_an_answer_is_judged_by_the_looks_that_it_rests_on(conditions_by, script, object_):
    script.seen_on = ()
    (asked,) = conditions_by(step(f"Take [Nothing] to [kitchen] and do [find] to [{object_}]"))
    assert asked.answer == (False if object_ == "coke" else 0)
    assert [name for name, _, _ in asked.looked_s] == ["counter", "counter", "shelf"]
    times = [time_s for _, *span_s in asked.looked_s for time_s in span_s]
    assert times == sorted(times)
    assert times[-1] <= asked.answered_s


def test_in_a_loop_each_answer_is_judged_by_the_looks_of_its_round(conditions_by):
    find = step("Take [Nothing] to [kitchen] and do [find] to [coke]")
    first, second = conditions_by(Repeat(loop=Loop(times=2), steps=(find,)))
    assert len(first.looked_s) == len(second.looked_s) == 1
    assert first.answered_s <= second.looked_s[0][1]


@pytest.fixture
def verdict_on(knowledge, registry, run_tree):
    """The verdict on a mission that ran with the scripted robot, when all its conditions hold or none does."""

    def after_running(*steps, holds=True):
        tree = compile_mission(Mission(name="m", robot="Alice", steps=steps), knowledge=knowledge, registry=registry)

        def judge(conditions):
            return RefereeReport(holds if conditions else None, "seen", 0, 0)

        return verdict_of(tree, run_tree(tree).robots[0], judge)

    return after_running


STOW = CallSkill(skill="stow")

# steps, whether their conditions hold -> the verdict
VERDICTS = [
    ((step(GO, Policy()),), True, True),
    ((step(GO, Policy()),), False, False),
    ((STOW,), True, None),
    ((step(GO, Policy()), STOW), True, True),
    ((step(GO, Policy()), STOW), False, False),
]


@pytest.mark.parametrize(("steps", "holds", "success"), VERDICTS)
def test_only_steps_with_goal_conditions_are_judged(verdict_on, steps, holds, success):
    assert verdict_on(*steps, holds=holds).success is success


def test_a_step_without_condition_is_named(verdict_on):
    assert "No goal condition stands for stow" in verdict_on(STOW).why
    assert "Not judged: stow." in verdict_on(step(GO, Policy()), STOW).why


def test_a_reached_place_must_hold_until_the_robot_drives_again(conditions_by):
    assert [one.when for one in conditions_by(step(GO), step(GO))] == [When.END_OF_STEP, When.END_OF_MISSION]


def test_a_mission_that_failed_is_never_fulfilled(verdict_on, script):
    script.seen_on = ()
    verdict = verdict_on(step(GET, Policy()), holds=True)
    assert verdict.success is False
    assert verdict.why.startswith("The mission failed.")


@pytest.fixture
def spoken(knowledge, registry, run_tree):
    """The verdict on steps that speak with the real skill, and what was judged; `heard` changes what was said."""

    def after_running(*steps, heard=lambda said: said, **variables):
        mission = Mission(name="tell", robot="Alice", steps=steps, **variables)
        tree = compile_mission(mission, knowledge=knowledge, registry={**registry, "speak": SpeakSkill})
        result, asked = run_tree(tree).worst, []

        def judge(given):
            asked.extend(given)
            return RefereeReport(True if given else None, "", 0, 0)

        return verdict_of(tree, replace(result, said=tuple(heard(result.said))), judge), asked

    return after_running


HELLO = CallSkill(skill="speak", values={"text": "Hello"})


def test_speech_does_not_end_the_condition_on_the_robots_place(spoken):
    verdict, asked = spoken(HELLO, step(GO, Policy()), HELLO)
    assert verdict.success is True
    assert [(one.kind, one.when) for one in asked] == [(GoalKind.WENT, When.END_OF_MISSION)]


@pytest.mark.usefixtures("house_tasks")
def test_the_page_of_a_task_learns_what_the_robot_said_in_its_step_and_when(spoken):
    _, asked = spoken(HELLO, step("Take [Nothing] to [Nothing] and do [call] to [dinner]"), HELLO)
    (own,) = asked
    (spoken_s,) = own.spoken_s
    assert own.said == ("dinner",)
    assert own.began_s <= spoken_s < own.ended_s  # and not when the next step spoke


def each_with(**facts):
    return lambda said: [replace(one, **facts) for one in said]


@pytest.mark.parametrize(("heard", "success", "did"), [(list, True, "said"), (lambda said: (), False, "did not say")])
@pytest.mark.parametrize("block", [HELLO, Speak(speak="Hello")])
def test_a_mission_that_only_speaks_is_judged_by_what_was_said(spoken, block, heard, success, did):
    verdict, _ = spoken(Repeat(loop=Loop(times=2), steps=(block,)), heard=heard)
    assert (verdict.success, verdict.why) == (success, f'It {did} "Hello".')


# Was "Hello" a question that was asked while a step was to say it? Then the step has not said it.
@pytest.mark.parametrize("asked", [False, True])
def test_a_question_does_not_count_as_the_text_of_a_step(spoken, asked):
    verdict, _ = spoken(HELLO, heard=each_with(asked=asked))
    assert verdict.success is not asked


def test_a_text_shown_in_a_silent_zone_counts_and_the_verdict_says_so(spoken):
    verdict, _ = spoken(HELLO, heard=each_with(silent="bedroom"))
    assert (verdict.success, verdict.why) == (True, 'It showed "Hello" in the silent zone bedroom.')


def test_one_sentence_counts_for_one_step(spoken):
    verdict, _ = spoken(HELLO, Speak(speak="{n}"), heard=lambda said: said[:1], variables={"n": 1})
    assert (verdict.success, verdict.why) == (False, 'It said "Hello". It did not say "{n}".')
