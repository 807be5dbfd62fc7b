"""What missions always do in the end: on every end of a run, within its time, and while the run is held."""

import pytest

from executive.run.control import Control
from executive.run.outcome import Outcome
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.leaf_steps import Awaited, CallSkill, Do, Set, Wait
from executive.words.mission import Mission
from executive.words.policy import Policy
from executive.words.steps import Ask, Group, Try
from skills.api import Cause, Failed


def skill(name):
    return CallSkill(skill=name)


def group(*steps, always, policy=None):
    return Group(steps=tuple(steps), always=tuple(always)).with_policy(policy)


@pytest.fixture
def control():
    return Control(pace=None)


@pytest.fixture
def go(knowledge, registry, run_tree, control, script):
    """Run steps; `act(ticks)` is called after each tick. The result, and the skills that began."""

    def run_steps(*steps, act=lambda ticks: None, settings=None, **more):
        mission = Mission(name="m", robot="Alice", steps=steps, **more)
        tree = compile_mission(mission, knowledge=knowledge, registry=registry)
        result = run_tree(tree, control=control, observer=lambda progress: act(progress.ticks), settings=settings or {})
        assert script.begun == script.ended
        return result, script.begun

    return run_steps


LONG = Wait(awaited=Awaited(seconds=500.0))


def cancels(control, *ticks):
    return lambda now: control.cancel("enough") if now in ticks else None


def test_after_success(go):
    result, begun = go(group(skill("stow"), always=[skill("relocalise")]))
    assert (result.outcome, begun) == (Outcome.SUCCESS, ["stow", "relocalise"])


def test_after_failure(go, script):
    script.ends["stow"] = lambda skill: Failed(Cause.EXECUTION, "no")
    result, begun = go(group(skill("stow"), always=[skill("relocalise")]), skill("back_off"))
    assert (result.outcome, result.worst.cause, begun) == (Outcome.FAILURE, Cause.EXECUTION, ["stow", "relocalise"])


def test_after_a_defect(go, script):
    def broken(skill):
        raise RuntimeError("broken")

    script.ends["stow"] = broken
    result, begun = go(group(skill("stow"), always=[skill("relocalise")]))
    assert (result.outcome, begun) == (Outcome.ERROR, ["stow", "relocalise"])


@pytest.mark.parametrize("tick", range(1, 5))
def test_after_a_cancel(go, control, tick):
    result, begun = go(group(skill("stow"), LONG, always=[skill("relocalise")]), act=cancels(control, tick))
    assert (result.outcome, result.worst.message, begun[-1]) == (Outcome.CANCELLED, "enough", "relocalise")


def test_a_cancel_while_the_end_is_done_does_it_once(go, control, script):
    script.steps = 6
    result, begun = go(group(skill("stow"), always=[skill("relocalise")]), act=cancels(control, 9))
    assert (result.outcome, begun) == (Outcome.CANCELLED, ["stow", "relocalise"])


def test_a_second_cancel_ends_it_at_once(go, control, script):
    script.steps = 50
    result, begun = go(group(LONG, always=[skill("relocalise")]), act=cancels(control, 3, 10))
    assert (result.outcome, begun) == (Outcome.CANCELLED, ["relocalise"])
    assert result.ticks < 15
    assert result.worst.message == "enough; in the end, broken off: relocalise goes on"


@pytest.mark.parametrize("hold", [Control.pause, Control.step, lambda control: control.pause(robot="Alice")])
def test_a_cancel_ends_a_pause_before_it(go, control, hold):
    acts = {2: lambda: hold(control), 6: lambda: control.cancel("enough")}
    result, begun = go(group(LONG, always=[skill("relocalise")]), act=lambda ticks: acts.get(ticks, int)())
    assert (result.outcome, begun, result.ticks < 30) == (Outcome.CANCELLED, ["relocalise"], True)


def test_two_cancels_in_one_tick_skip_the_steps_under_always(go, control):
    def act(ticks):
        if ticks == 3:
            control.cancel("enough")
            control.cancel("at once")

    result, begun = go(group(LONG, always=[skill("relocalise")]), act=act)
    assert (result.outcome, begun) == (Outcome.CANCELLED, [])


def test_the_steps_under_always_have_a_time_limit(go, control):
    settings = {"endings_limit_s": 5.0}
    result, _ = go(group(LONG, always=[LONG]), act=cancels(control, 3), settings=settings)
    assert result.sim_time_s == pytest.approx(5.2, abs=0.2)
    assert result.worst.message == "enough; in the end, broken off: waits a moment"


def test_after_the_time_of_the_run(go):
    result, begun = go(group(LONG, always=[skill("relocalise")]), settings={"time_limit_s": 2.0})
    assert (result.outcome, result.worst.cause, begun) == (Outcome.FAILURE, Cause.TIMEOUT, ["relocalise"])


def test_after_a_timeout_before_what_comes_next(go):
    within = Policy(timeout_s=1.0)
    tried = Try(steps=(group(LONG, always=[skill("relocalise")], policy=within),), otherwise=(skill("stow"), LONG))
    result, begun = go(tried, settings={"time_limit_s": 4.0})
    assert [name for name in begun if name == "relocalise"] == ["relocalise"]
    assert result.worst.cause is Cause.TIMEOUT


def test_before_the_next_attempt(go, script):
    script.ends["stow"] = lambda skill: Failed(Cause.EXECUTION, "no")
    _, begun = go(group(skill("stow"), always=[skill("relocalise")], policy=Policy(retries=1)))
    assert begun == ["stow", "relocalise"] * 2


def test_inner_first(go, control):
    inner = group(LONG, always=[skill("relocalise")])
    _, begun = go(group(inner, always=[skill("stow")]), act=cancels(control, 3))
    assert begun == ["relocalise", "stow"]


def test_a_failure_under_always_is_reported_and_the_mission_stays_cancelled(go, control, script):
    script.ends["relocalise"] = lambda skill: Failed(Cause.PLANNING, "nowhere")
    result, _ = go(group(LONG, always=[skill("relocalise")]), act=cancels(control, 3))
    assert (result.outcome, result.worst.cause) == (Outcome.CANCELLED, Cause.CANCELLED)
    assert result.worst.message == "enough; in the end: nowhere"


def test_the_always_of_a_whole_mission_runs(go, control):
    _, begun = go(LONG, always=(skill("relocalise"),), act=cancels(control, 3))
    assert begun == ["relocalise"]


def test_steps_under_always_may_set_values_and_ask_questions(go, control):
    ask = Ask(ask="{n}?", choices={"a": (skill("stow"),), "b": ()}, limit_s=2.0, default="a")
    put = Set(set={"n": "n + 1"})
    _, begun = go(group(LONG, always=[put, ask]), act=cancels(control, 3), variables={"n": 1})
    assert begun == ["stow"]
    assert control.state.questions == ()


@pytest.mark.parametrize(("hold", "release"), [("pause", "resume"), ("stop_button", "release_stop_button")])
def test_a_run_that_is_held_stands_still_in_its_end_and_goes_on(go, control, robot, script, hold, release):
    script.steps, driving = 20, {}

    def act(ticks):
        driving[ticks] = robot.driving
        if ticks == 3:
            control.cancel("enough")
        if ticks == 10:
            getattr(control, hold)()
        if ticks == 20:
            getattr(control, release)()

    result, begun = go(group(LONG, always=[skill("relocalise")]), act=act)
    assert (result.outcome, begun[0]) == (Outcome.CANCELLED, "relocalise")
    assert driving[9]
    assert not any(driving[ticks] for ticks in range(11, 20))
    assert driving[23]


def test_a_cancel_runs_always_of_a_preempting_and_of_the_suspended_mission(go, control, knowledge, registry):
    between = Mission(name="between", robot="Alice", steps=(group(LONG, always=[skill("relocalise")]),))
    other = compile_mission(between, knowledge=knowledge, registry=registry)

    def act(ticks):
        if ticks == 3:
            control.preempt(other)
        if ticks == 6:
            control.cancel("enough")

    _, begun = go(group(LONG, always=[skill("stow")]), act=act)
    assert begun == ["relocalise", "stow"]


def test_a_cancelled_command_begins_the_end_at_once(go, control):
    drive = Do.from_command(parse_command("Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"))
    _, begun = go(group(drive, always=[skill("relocalise")]), act=cancels(control, 2))
    assert begun == ["navigate", "relocalise"]


def test_a_replaced_mission_runs_its_always_before_the_other_begins(go, control, knowledge, registry):
    other = Mission(name="other", robot="Alice", steps=(skill("back_off"),))
    tree = compile_mission(other, knowledge=knowledge, registry=registry)
    acts = {3: lambda: control.replace(tree)}
    steps = group(LONG, always=[skill("relocalise"), skill("stow")])
    result, begun = go(steps, act=lambda now: acts.get(now, int)())
    assert (result.outcome, begun) == (Outcome.SUCCESS, ["relocalise", "stow", "back_off"])


def test_a_cancel_lets_a_replaced_mission_finish_its_always(go, control, knowledge, registry, script):
    script.steps = 5
    other = Mission(name="other", robot="Alice", steps=(skill("back_off"),))
    tree = compile_mission(other, knowledge=knowledge, registry=registry)
    acts = {3: lambda: control.replace(tree), 6: lambda: control.cancel("enough")}
    result, begun = go(group(LONG, always=[skill("relocalise")]), act=lambda now: acts.get(now, int)())
    assert (result.outcome, begun) == (Outcome.CANCELLED, ["relocalise"])
