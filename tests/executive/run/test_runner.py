"""Whole missions with the scripted robot: outcomes, cancel at every node, and orderly ends."""

import time

import pytest
from py_trees.common import Status

from executive.run.control import Control
from executive.run.outcome import Outcome
from executive.run.runner import run
from executive.run.visitor import RunEntry, RunSettings
from executive.run.worker import LockStepWorker
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.leaf_steps import Do
from executive.words.mission import Mission
from skills.api import Cause, Failed, Succeeded
from tests.executive.conftest import default_end
from tests.tables import yaml_beside
from tests.visitors import OnMessage


def transitions(published):
    return [message for topic, message in published if topic == "transitions"]


GO = "Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]"
RUNS = yaml_beside(__file__, "runs.yaml")


def ends_of(script, name, said):
    """How a skill ends each time it is used."""
    left = list(said)

    def end(skill):
        cause, _, message = (left.pop(0) if len(left) > 1 else left[0]).partition(" ")
        if cause == "interrupt":
            raise KeyboardInterrupt
        return Failed(Cause[cause], message) if cause in Cause.__members__ else default_end(script, name)(skill)

    return end


def act(control, robot, compiled, case, what):
    """Does at the control, or to the robot's lease, what a case says."""
    verb, _, more = what.partition(" ")
    missions = {"preempt": "aside", "replace": "instead", "then": "later"}
    if verb == "lease":
        robot.holder = more
    elif verb in missions:
        getattr(control, verb)(compiled(case.get("other", GO), name=missions[verb]))
    else:
        getattr(control, verb)(*(["enough"] if verb == "cancel" else []))


@pytest.mark.parametrize("case", RUNS, ids=lambda case: case["name"])
def test_the_result_says_how_the_run_ended(compiled, run_tree, make, robot, script, published, case):
    control = Control(pace=None)
    script.seen_on, script.steps = case.get("seen_on", script.seen_on), case.get("takes", script.steps)
    script.ends.update({name: ends_of(script, name, said) for name, said in case.get("ends", {}).items()})
    robot.holding, robot.holder = case.get("holding", False), case.get("lease")
    if "raising" in case:
        robot.raising[case["raising"]] = RuntimeError("cable out")

    def observe(progress):
        if progress.ticks in case.get("at", {}):
            act(control, robot, compiled, case, case["at"][progress.ticks])

    tree = compiled(*case.get("commands", make.FETCH))
    result = run_tree(tree, observer=observe, control=control, settings=case.get("settings", {}))
    worst, begun = result.worst, " ".join(script.begun)
    facts = {"outcome": result.outcome.value, "cause": worst.cause and worst.cause.value, "message": worst.message}
    facts |= {"ticks": result.ticks, "begun": begun, "answers": [*worst.answers.values()], "held": robot.holding}
    facts |= {"count": {name: script.begun.count(name) for name in case.get("count", {})}}
    facts |= {"mission": worst.tree.mission_name, "mode": control.state.mode.value, "reason": control.state.reason}
    facts |= {"between": {each.tree.mission_name: each.outcome.value for each in worst.preempting}}
    facts |= {"notes": [f"{note['what']} {note['message']}" for topic, note in published if topic == "control"]}
    assert facts == facts | {key: value for key, value in case.items() if key in facts}
    assert result.sim_time_s == pytest.approx(case.get("time_s", result.sim_time_s), abs=0.5)
    assert (case.get("has", "") in worst.message, begun.startswith(case.get("begins", ""))) == (True, True)
    assert (robot.driving, robot.holder, script.ended) == (False, case.get("holder"), script.begun)


def test_an_object_lost_on_the_way_is_no_success(compiled, run_tree, make, robot, script):
    script.steps = 100

    def lose(progress):
        if progress.now_s > 1.0:
            robot.holding = False

    tree = compiled("Take [coke] to [start] and do [Nothing] to [Nothing]")
    robot.holding = True
    worst = run_tree(tree, observer=lose, settings={"tick_period_s": 0.1}).worst
    assert (worst.outcome, worst.cause, worst.message) == (
        Outcome.FAILURE,
        Cause.EXECUTION,
        "the coke was lost on the way to the start; pick the coke up again: the coke is not found again where it was "
        "lost: not seen; there is no surface within 2 m of (0.00, 0.00) m; there is only the floor",
    )


LEAVES = [
    "1-kitchen/find/counter-1/navigate",
    "1-kitchen/find/counter-1/detect",
    "1-kitchen/approach",
    "1-kitchen/grasp",
    "1-kitchen/stow",
    "2-start/navigate",
    "2-start/hand-over",
]


@pytest.mark.parametrize("leaf", LEAVES)
def test_cancel_in_every_leaf_stops_the_robot(compiled, run_tree, make, robot, script, leaf):
    path_id, control = f"alice/fetch-drink/{leaf}", Control(pace=None)

    def observe(progress):
        if progress.states["Alice"][path_id].status is Status.RUNNING:
            control.cancel("enough")

    result = run_tree(compiled(*make.FETCH), observer=observe, control=control)
    assert (result.outcome, result.worst.cause, result.worst.message) == (Outcome.CANCELLED, Cause.CANCELLED, "enough")
    assert result.worst.states[path_id].cause is Cause.CANCELLED
    assert (robot.driving, robot.holder, script.ended) == (False, None, script.begun)


@pytest.mark.parametrize("tick", range(16))
def test_cancel_at_every_tick_stops_the_robot(compiled, run_tree, make, robot, script, tick):
    control = Control(pace=None)
    result = run_tree(
        compiled(*make.FETCH), observer=lambda p: control.cancel("enough") if p.ticks > tick else None, control=control
    )
    assert result.ticks <= tick + 1
    assert (robot.driving, robot.holder, script.ended) == (False, None, script.begun)


def test_a_defect_in_an_estimator_ends_the_run_with_an_error(compiled, make, robot, clock, published):
    class Broken(make.StillLocaliser):
        def update(self, robot):
            raise ZeroDivisionError("no scan")

    entry = RunEntry(compiled(*make.FETCH), robot, Broken(), make.EmptyCostmap())
    result = run(
        [entry], clock=clock, worker=LockStepWorker(clock), visitors=[OnMessage(lambda *m: published.append(m))]
    )
    assert (result.outcome, robot.holder) == (Outcome.ERROR, None)
    assert "no scan" in result.worst.message
    assert any(topic == "errors" and "ZeroDivisionError" in m["traceback"] for topic, m in published)


def test_two_runs_of_a_seed_log_the_same(compiled, run_tree, make, robot, clock, published):
    logs = []
    for _ in range(2):
        clock._now_s, robot.holder, robot.holding = 0.0, None, False
        published.clear()
        run_tree(compiled(*make.FETCH))
        logs.append([(topic, repr(data)) for topic, data in published if topic != "wall"])
    assert logs[0] == logs[1]


def test_transitions_are_logged_with_cause_and_sentence(compiled, run_tree, make, published, script):
    script.ends["approach"] = lambda skill: Failed(Cause.PLANNING, "no room to stand")
    run_tree(compiled(*make.FETCH))
    failed = [m for m in transitions(published) if m["node"].endswith("/approach")][-1]
    assert (failed["from"], failed["to"], failed["cause"]) == ("RUNNING", "FAILURE", Cause.PLANNING)
    assert failed["message"] == "no room to stand"


def test_poses_are_logged_twice_a_second(compiled, run_tree, published, script):
    script.steps = 60
    run_tree(compiled(GO))
    assert sum(topic == "pose" for topic, _ in published) == 7  # 0.05 s to 3.0 s


def test_the_quality_of_the_localisation_is_logged(compiled, run_tree, published):
    run_tree(compiled(GO))
    pose = next(message for topic, message in published if topic == "pose")
    state = next(message for topic, message in published if topic == "state")
    assert (len(pose["covariance"]), state["localised"], state["localisation_health"]) == (9, True, 1.0)


def test_particles_and_obstacles_are_logged_when_they_change(compiled, run_tree, published, script):
    script.steps = 60
    run_tree(compiled(GO))
    (known,) = [message for topic, message in published if topic == "navigation"]
    assert known == {"robot": "Alice", "particle_x": [], "particle_y": [], "seen_x": [], "seen_y": []}


def test_overruns_are_counted(compiled, run_tree, make, script, published):
    script.steps = 1
    script.ends["stow"] = lambda skill: (time.sleep(0.02), Succeeded("placed"))[1]
    result = run_tree(compiled(*make.FETCH), settings={"tick_period_s": 0.01})
    assert result.overruns >= 1


@pytest.fixture
def run_two(make, knowledge, registry, clock, published):
    """Runs a mission to the bedroom by Alice and Bob; `after` says who waits for whom."""
    steps = (Do.from_command(parse_command(GO)),)

    def run_them(**after):
        entries = [
            RunEntry(
                compile_mission(Mission(name="go", robot=name, steps=steps), knowledge=knowledge, registry=registry),
                make.StandingRobot(clock, name),
                make.StillLocaliser(),
                make.EmptyCostmap(),
                after=after.get(name, ()),
            )
            for name in ("Bob", "Alice")
        ]
        return run(
            entries,
            clock=clock,
            worker=LockStepWorker(clock),
            visitors=[OnMessage(lambda *m: published.append(m))],
            settings=RunSettings(seed=1),
        )

    return run_them


def test_robots_run_side_by_side_in_the_order_of_their_names(run_two, published):
    result = run_two()
    assert [robot.robot_name for robot in result.robots] == ["Alice", "Bob"]
    assert result.outcome is Outcome.SUCCESS
    assert {m["robot"] for m in transitions(published)} == {"Alice", "Bob"}


def test_every_message_of_a_robot_names_it(run_two, published, script):
    def tell(skill):
        skill.context.publish("mine", {"x": 1})
        return Succeeded("told")

    script.ends["navigate"] = tell
    run_two()
    assert [message for topic, message in published if topic == "mine"] == [
        {"robot": "Alice", "x": 1},
        {"robot": "Bob", "x": 1},
    ]
    unnamed = {topic for topic, message in published if "robot" not in message and "robot_name" not in message}
    assert unnamed <= {"control", "wall"}


def test_a_robot_that_waits_for_another_begins_when_that_one_is_done(run_two, published):
    assert run_two(Alice=("Bob",)).outcome is Outcome.SUCCESS
    order = [message["robot"] for message in transitions(published)]
    assert order.index("Alice") > len(order) - 1 - order[::-1].index("Bob")


def test_a_robot_that_waits_for_one_that_fails_does_not_begin(run_two, script, published):
    script.ends["navigate"] = lambda skill: Failed(Cause.EXECUTION, "stuck")
    alice, bob = run_two(Alice=("Bob",)).robots
    assert (alice.outcome, alice.cause, bob.outcome) == (Outcome.FAILURE, Cause.PRECONDITION, Outcome.FAILURE)
    assert alice.message.startswith("Bob did not finish the part that comes first")
    assert {m["robot"] for m in transitions(published)} == {"Bob"}


def test_to_wait_for_a_robot_that_is_not_there_is_refused(run_two):
    with pytest.raises(ValueError, match="no robot Carl"):
        run_two(Alice=("Carl",))


def test_robots_of_one_name_are_refused(compiled, make, robot, clock):
    entry = RunEntry(compiled(*make.FETCH), robot, make.StillLocaliser(), make.EmptyCostmap())
    with pytest.raises(ValueError, match="different names"):
        run([entry, entry], clock=clock, worker=LockStepWorker(clock))


def test_progress_of_the_running_skill_reaches_the_observer(compiled, run_tree, make, script):
    seen = []
    run_tree(compiled(*make.FETCH), observer=lambda p: seen.append(p.states["Alice"]["alice/fetch-drink"].message))
    assert "navigate goes on" in seen
