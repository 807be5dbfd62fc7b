"""Steps and missions under policies, run with the scripted robot."""

import pytest

from executive.run.control import Control
from executive.run.outcome import Outcome
from executive.tree.compiler import compile_mission
from executive.words.command import Command, parse_command
from executive.words.leaf_steps import Do
from executive.words.mission import Mission
from executive.words.step import Guards, OnFailure, OperatorQuestion, Policy
from skills.api import Cause, Failed, Running, Succeeded
from skills.robot import Battery

GO = {place: Command(goal=place) for place in ("hall", "bedroom")}
FIND = parse_command("Take [Nothing] to [kitchen] and do [grasp] to [coke]")
BASE = "alice/round"
NONE = Policy()


@pytest.fixture
def compile_steps(knowledge, registry):
    def compile_it(*steps, policy=NONE):
        mission = Mission(name="round", robot="Alice", steps=steps).with_policy(policy)
        return compile_mission(mission, knowledge=knowledge, registry=registry)

    return compile_it


@pytest.fixture
def play(compile_steps, run_tree):
    """Compile steps and run them; the result of the one robot."""
    return lambda *steps, policy=NONE, **options: run_tree(compile_steps(*steps, policy=policy), **options).robots[0]


def step(command, **policy):
    return Do.from_command(command).with_policy(Policy(**policy))


@pytest.fixture
def nowhere(script):
    """Nothing is to be found anywhere."""
    script.seen_on = ()
    return script


@pytest.mark.parametrize(("mission", "own", "count"), [(None, None, 2), (None, 0, 0), (3, None, 3), (3, 1, 1)])
def test_a_step_or_its_mission_says_how_often_a_dropped_object_is_picked_up(compile_steps, mission, own, count):
    carry = parse_command("Take [coke] to [bedroom] and do [Nothing] to [Nothing]")
    tree = compile_steps(step(carry, pick_ups=own), policy=Policy(pick_ups=mission))
    recovered = [node for node in tree.mission.walk() if node.path_id.endswith("carry-on")]
    assert [node.options["attempts"] for node in recovered] == ([count + 1] if count else [])


def test_a_skipped_step_is_reported_and_the_rest_runs(play, nowhere):
    result = play(step(FIND, on_failure=OnFailure.SKIP), step(GO["hall"]))
    assert result.outcome is Outcome.SUCCESS
    assert result.message.startswith("done, but skipped: step 1: grasp coke at kitchen (found no coke")
    assert result.states[f"{BASE}/step-1/skip"].status.name == "SUCCESS"
    assert result.states[f"{BASE}/1-kitchen"].status.name == "FAILURE"


def test_without_a_policy_the_mission_ends_at_the_failure(play, nowhere):
    result = play(step(FIND), step(GO["hall"]))
    assert (result.outcome, nowhere.begun.count("place")) == (Outcome.FAILURE, 0)
    assert result.states[f"{BASE}/2-hall"].status.name == "INVALID"


def test_a_mission_of_which_all_is_skipped_fails(play, nowhere):
    result = play(step(FIND, on_failure=OnFailure.SKIP))
    assert (result.outcome, "all steps were skipped" in result.message) == (Outcome.FAILURE, True)


def test_a_defect_is_not_skipped(play, script):
    def broken(skill):
        raise RuntimeError("a bug")

    script.ends["navigate"] = broken
    result = play(step(GO["bedroom"], on_failure=OnFailure.SKIP), step(GO["hall"]))
    assert (result.outcome, result.cause) == (Outcome.ERROR, Cause.ERROR)


def test_a_step_is_tried_again_as_often_as_said(play, script):
    tries = []

    def place(skill):
        tries.append(1)
        return Failed(Cause.EXECUTION, "stuck") if len(tries) < 3 else Succeeded("put down")

    script.ends["place"] = place
    carry = parse_command("Take [coke] to [counter] and do [Nothing] to [Nothing]")
    result = play(step(FIND), step(carry, retries=4))
    assert (result.outcome, len(tries)) == (Outcome.SUCCESS, 3)


def test_on_failure_retry_means_once_more(play, nowhere):
    result = play(step(FIND, on_failure=OnFailure.RETRY, retries=1))
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.PRECONDITION)
    assert "(after 2 attempts)" in result.message


def goes_on(skill):
    return Running("goes on and on")


def test_a_timeout_counts_the_robots_clock_for_each_attempt(play, script, clock):
    script.ends["navigate"] = goes_on
    result = play(step(GO["hall"], timeout_s=3.0, retries=1))
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.TIMEOUT)
    assert "not done within 3 s (after 2 attempts)" in result.message
    assert clock.now() == pytest.approx(6.3, abs=0.3)


def test_the_whole_mission_has_a_timeout(play, script, clock):
    script.ends["navigate"] = goes_on
    result = play(step(GO["hall"]), policy=Policy(timeout_s=2.0))
    assert (result.outcome, result.cause, clock.now() < 2.5) == (Outcome.FAILURE, Cause.TIMEOUT, True)


def test_return_goes_back_to_the_start_and_fails_with_the_first_reason(play, nowhere):
    result = play(step(FIND, on_failure=OnFailure.RETURN), step(GO["hall"]))
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.PRECONDITION)
    assert result.message.endswith("the robot is back where it started")
    assert result.states[f"{BASE}/step-1/return/navigate"].status.name == "SUCCESS"
    assert result.states[f"{BASE}/2-hall"].status.name == "INVALID"


def test_return_reports_when_there_is_no_path_back(play, nowhere, script):
    script.ends["detect"] = lambda skill: Failed(Cause.POSTCONDITION, "not seen")

    def last(skill):
        return Failed(Cause.PLANNING, "no way") if skill.inputs.goal.x_m == 0.0 else Succeeded("there")

    script.ends["navigate"] = last
    result = play(step(FIND, on_failure=OnFailure.RETURN))
    assert (result.cause, "could not go back: no way" in result.message) == (Cause.PRECONDITION, True)


def test_nobody_to_ask_means_the_default_answer(play, nowhere, clock):
    ask = {"on_failure": OnFailure.ASK, "question": OperatorQuestion(text="What now?", limit_s=5.0, default="skip")}
    result = play(step(FIND, **ask), step(GO["hall"]))
    assert (result.outcome, "skipped: step 1" in result.message) == (Outcome.SUCCESS, True)


@pytest.mark.parametrize(
    ("answers", "outcome", "says"),
    [
        (["stop"], Outcome.FAILURE, "found no coke"),
        (["skip"], Outcome.SUCCESS, "done, but skipped"),
        (["retry", "retry", "stop"], Outcome.FAILURE, "found no coke"),
    ],
)
def test_the_operators_answer_decides(play, nowhere, answers, outcome, says):
    control, asked, left = Control(attended=True, pace=None), [], list(answers)

    def answering(progress):
        for question in control.state.questions:
            asked.append(question.question)
            control.answer(question.id, left.pop(0))

    ask = {"on_failure": OnFailure.ASK, "question": OperatorQuestion(text=None, limit_s=60.0, default="stop")}
    result = play(step(FIND, **ask), step(GO["hall"]), control=control, observer=answering)
    assert (result.outcome, says in result.message, left) == (outcome, True, [])
    assert {question.id for question in asked} == {f"{BASE}/step-1/ask"}
    assert asked[0].options == ("retry", "skip", "stop")
    assert "found no coke" in asked[0].text


def test_a_whole_mission_is_asked_about_but_not_skipped(compile_steps):
    tree = compile_steps(step(GO["hall"]), policy=Policy(on_failure=OnFailure.ASK))
    (ask,) = [node for node in tree.root.walk() if node.kind == "ask"]
    assert ask.options["options"] == ("retry", "stop")


@pytest.mark.parametrize(("charge", "outcome"), [(0.5, Outcome.SUCCESS), (0.35, Outcome.FAILURE)])
def test_a_battery_guard(play, robot, charge, outcome, monkeypatch):
    monkeypatch.setattr(type(robot), "battery", lambda self: Battery(self.clock.now(), charge))
    result = play(step(GO["hall"], guards=Guards(battery=0.4), retries=2))
    assert result.outcome is outcome
    if outcome is Outcome.FAILURE:
        assert result.cause is Cause.PRECONDITION
        assert "battery" in result.message
        assert "attempts" not in result.message


def test_a_time_guard_counts_from_the_beginning_of_the_run(play, script):
    script.steps = 20
    result = play(step(GO["bedroom"]), step(GO["hall"], guards=Guards(time_s=1.5)))
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.TIMEOUT)
    assert "since the mission began" in result.message


def test_a_guard_on_the_place(compile_steps):
    tree = compile_steps(step(GO["hall"], guards=Guards(localised=True)))
    (guard,) = [node for node in tree.root.walk() if node.path_id == f"{BASE}/step-1/guard-localised"]
    assert guard.kind == "guard"


def test_the_nodes_of_a_policy_stand_around_the_step_in_this_order(compile_steps):
    guards = Guards(battery=0.3, localised=True, time_s=60.0)
    policy = Policy(timeout_s=9.0, retries=1, on_failure=OnFailure.SKIP, guards=guards)
    tree = compile_steps(Do.from_command(GO["hall"]).with_policy(policy), step(GO["bedroom"]))
    parts = [node.path_id.removeprefix(f"{BASE}/") for node in tree.root.walk() if "/step-1/" in node.path_id]
    names = ("skip", "guard-battery", "guard-time", "guard-localised", "retries", "timeout")
    assert parts == [f"step-1/{name}" for name in names]


def test_a_cancel_while_asking_takes_the_question_back(play, nowhere):
    control = Control(attended=True, pace=None)

    def cancelling(progress):
        if control.state.questions:
            control.cancel("enough")

    result = play(step(FIND, on_failure=OnFailure.ASK), control=control, observer=cancelling)
    assert (result.outcome, control.state.questions) == (Outcome.CANCELLED, ())
