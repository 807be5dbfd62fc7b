"""What missions always do in the end: on every end of a run, within its time, and while the run is held."""

import pytest
import yaml

from executive.mission.load import load_mission
from executive.run.control import Control
from executive.run.outcome import Outcome
from executive.tree.compiler import compile_mission
from executive.words.leaf_steps import Awaited, CallSkill, Wait
from executive.words.mission import Mission
from executive.words.steps import Group
from skills.api import Cause, Failed
from tests.tables import yaml_beside


def skill(name):
    return CallSkill(skill=name)


def group(*steps, always, policy=None):
    return Group(steps=tuple(steps), always=tuple(always)).with_policy(policy)


@pytest.fixture
def control():
    return Control(pace=None)


@pytest.fixture
def run_mission(knowledge, registry, run_tree, control, script):
    """Runs a mission; `act(ticks)` is called after each tick. The result, and the skills that began."""

    def run(mission, act=lambda ticks: None, settings=None):
        tree = compile_mission(mission, knowledge=knowledge, registry=registry)
        result = run_tree(tree, control=control, observer=lambda progress: act(progress.ticks), settings=settings or {})
        assert script.begun == script.ended
        return result, script.begun

    return run


@pytest.fixture
def go(run_mission):
    """Runs steps."""
    return lambda *steps, act: run_mission(Mission(name="m", robot="Alice", steps=steps), act)


def broken(skill):
    raise RuntimeError("broken")


ENDINGS = yaml_beside(__file__, "endings.yaml")


@pytest.mark.parametrize("case", ENDINGS, ids=lambda case: case["name"])
def test_the_steps_under_always_are_done_on_every_end(run_mission, control, script, case):
    script.steps = case.get("takes", script.steps)
    for name, cause in case.get("fails", {}).items():
        script.ends[name] = lambda skill, cause=cause: Failed(Cause[cause], "no")
    if "breaks" in case:
        script.ends[case["breaks"]] = broken

    def cancel(ticks):
        for _ in range(case.get("cancel", []).count(ticks)):
            control.cancel("enough")

    mission = load_mission("m.yaml", text=yaml.safe_dump({"name": "m", "robot": "Alice", **case["mission"]}))
    result, begun = run_mission(mission, cancel, case.get("settings"))
    worst = result.worst
    assert (result.outcome, begun) == (Outcome(case["outcome"]), case.get("begun", begun))
    assert "last" not in case or begun[-1] == case["last"]
    assert "cause" not in case or worst.cause is Cause[case["cause"]]
    assert worst.message == case.get("message", worst.message)
    assert result.ticks < case.get("ticks_below", 10_000)
    assert result.sim_time_s == pytest.approx(case.get("time_s", result.sim_time_s), abs=0.2)
    assert control.state.questions == ()


LONG = Wait(awaited=Awaited(seconds=500.0))


@pytest.mark.parametrize("hold", [Control.pause, Control.step, lambda control: control.pause(robot="Alice")])
def test_a_cancel_ends_a_pause_before_it(go, control, hold):
    acts = {2: lambda: hold(control), 6: lambda: control.cancel("enough")}
    result, begun = go(group(LONG, always=[skill("relocalise")]), act=lambda ticks: acts.get(ticks, int)())
    assert (result.outcome, begun, result.ticks < 30) == (Outcome.CANCELLED, ["relocalise"], True)


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


@pytest.mark.parametrize("interrupted", [False, True])
def test_an_interrupt_names_the_steps_under_always_that_stop_holds_up(go, control, interrupted):
    def act(ticks):
        if ticks == 3:
            control.stop_button()
            control.cancel("enough")
        if ticks == 6 and interrupted:
            raise KeyboardInterrupt
        if ticks == 6:
            control.cancel("enough")

    result, begun = go(group(LONG, always=[skill("relocalise"), skill("stow")]), act=act)
    assert (result.outcome, begun) == (Outcome.CANCELLED, [])
    assert result.worst.message == "enough; in the end, broken off: relocalise and stow"
