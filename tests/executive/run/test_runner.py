"""Whole missions with the scripted robot: outcomes, cancel at every node, and orderly ends."""

import itertools
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
from tests.visitors import OnMessage


def transitions(published):
    return [message for topic, message in published if topic == "transitions"]


def test_fetch_succeeds_and_the_robot_is_left_in_order(compiled, run_tree, make, robot, script):
    result = run_tree(compiled(*make.FETCH))
    assert (result.outcome, result.worst.cause) == (Outcome.SUCCESS, None)
    assert (robot.driving, robot.holder, robot.holding) == (False, None, True)
    assert script.begun == ["navigate", "detect", "approach", "grasp", "stow", "navigate", "hand_over"]
    assert script.ended == script.begun


def test_the_first_detection_ends_the_search_and_others_are_tried_before(compiled, run_tree, make, script):
    script.seen_on = ("shelf",)
    assert run_tree(compiled(*make.FETCH)).outcome is Outcome.SUCCESS
    assert script.begun[:6] == ["navigate", "detect"] * 3


def test_nothing_found_is_a_failure_that_says_where(compiled, run_tree, make, script):
    script.seen_on = ()
    worst = run_tree(compiled(*make.FETCH)).worst
    assert (worst.outcome, worst.cause) == (Outcome.FAILURE, Cause.PRECONDITION)
    assert worst.message.startswith("found no drink in the kitchen, nor on the bedside table: not seen")
    assert "approach" not in script.begun


def test_a_slipped_grasp_is_tried_again_after_a_new_look_from_where_it_stands(compiled, run_tree, make, script, robot):
    ends = iter([Failed(Cause.EXECUTION, "slipped"), Failed(Cause.POSTCONDITION, "nothing held")])
    script.ends["grasp"] = lambda skill: next(ends, None) or _hold(skill)
    assert run_tree(compiled(*make.FETCH)).outcome is Outcome.SUCCESS
    look = ["approach", "grasp", "detect"]
    assert script.begun[:8] == ["navigate", "detect", *look, *look]


def _hold(skill):
    skill.context.robot._robot.holding = True
    return Succeeded("held", {"tried": (*skill.inputs.avoid, 1)})


def test_grasping_is_given_up_after_three_attempts(compiled, run_tree, make, script):
    script.ends["grasp"] = lambda skill: Failed(Cause.EXECUTION, "slipped")
    worst = run_tree(compiled(*make.FETCH)).worst
    assert (worst.cause, worst.message) == (Cause.EXECUTION, "slipped (after 3 attempts)")
    assert script.begun.count("grasp") == 3


@pytest.mark.parametrize("cause", [Cause.TIMEOUT, Cause.ERROR])
def test_timeouts_and_defects_are_not_tried_again(compiled, run_tree, make, script, cause):
    script.ends["grasp"] = lambda skill: Failed(cause, "no")
    assert run_tree(compiled(*make.FETCH)).worst.cause is cause
    assert script.begun.count("grasp") == 1


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
        "the coke was lost on the way to the start; pick the coke up again: the coke is not found again where it fell: "
        "not seen; there is no surface within 2 m of (0.00, 0.00) m; there is only the floor",
    )


def test_carrying_with_an_empty_gripper_is_refused(compiled, run_tree):
    worst = run_tree(compiled("Take [coke] to [start] and do [Nothing] to [Nothing]")).worst
    assert worst.cause is Cause.PRECONDITION


def test_a_second_surface_is_tried_when_the_first_does_not_work(compiled, run_tree, script, robot):
    robot.holding = True
    places = itertools.count()
    script.ends["place"] = lambda skill: Failed(Cause.PLANNING, "full") if next(places) == 0 else _placed()
    assert run_tree(compiled("Take [coke] to [kitchen] and do [Nothing] to [Nothing]")).outcome is Outcome.SUCCESS
    assert script.begun == ["navigate", "place", "navigate", "place"]


def _placed():
    return Succeeded("placed")


@pytest.mark.parametrize(("seen_on", "answer"), [(("counter",), True), ((), False)])
def test_a_status_check_answers(compiled, run_tree, script, seen_on, answer):
    script.seen_on = seen_on
    result = run_tree(compiled("Take [Nothing] to [kitchen] and do [find] to [drink]", name="check"))
    assert result.outcome is Outcome.SUCCESS
    assert list(result.worst.answers.values()) == [answer]


def test_a_status_check_with_a_blocked_path_does_not_say_no(compiled, run_tree, script):
    script.seen_on = ()
    script.ends["navigate"] = lambda skill: Failed(Cause.PLANNING, "no way")
    worst = run_tree(compiled("Take [Nothing] to [kitchen] and do [find] to [drink]")).worst
    assert (worst.outcome, worst.cause, worst.answers) == (Outcome.FAILURE, Cause.PLANNING, {})


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
    assert (robot.driving, robot.holder) == (False, None)
    assert script.ended == script.begun


@pytest.mark.parametrize("tick", range(16))
def test_cancel_at_every_tick_stops_the_robot(compiled, run_tree, make, robot, script, tick):
    control = Control(pace=None)
    result = run_tree(
        compiled(*make.FETCH), observer=lambda p: control.cancel("enough") if p.ticks > tick else None, control=control
    )
    assert result.ticks <= tick + 1
    assert (robot.driving, robot.holder) == (False, None)
    assert script.ended == script.begun


def test_keyboard_interrupt_in_a_skill_is_cancelled(compiled, run_tree, make, robot, script):
    def interrupt(skill):
        raise KeyboardInterrupt

    script.ends["approach"] = interrupt
    result = run_tree(compiled(*make.FETCH))
    assert (result.outcome, result.worst.cause) == (Outcome.CANCELLED, Cause.CANCELLED)
    assert (robot.driving, robot.holder, script.ended) == (False, None, script.begun)


def test_time_over_is_a_failure_with_timeout(compiled, run_tree, make, script, robot):
    script.steps = 10_000
    result = run_tree(compiled(*make.FETCH), settings={"time_limit_s": 1.0})
    assert (result.outcome, result.worst.cause) == (Outcome.FAILURE, Cause.TIMEOUT)
    assert result.sim_time_s == pytest.approx(1.0)
    assert not robot.driving


@pytest.mark.parametrize("verb", ["drive", "odometry", "stop"])
def test_an_exception_in_a_verb_ends_the_run_with_an_error(compiled, run_tree, make, robot, verb):
    robot.raising[verb] = RuntimeError("cable out")
    result = run_tree(compiled(*make.FETCH))
    assert (result.outcome, result.worst.cause) == (Outcome.ERROR, Cause.ERROR)
    assert "cable out" in result.worst.message
    assert robot.holder is None


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


def test_a_held_lease_is_a_failed_precondition(compiled, run_tree, make, robot):
    robot.holder = "tablet"
    result = run_tree(compiled(*make.FETCH))
    assert (result.outcome, result.worst.cause) == (Outcome.FAILURE, Cause.PRECONDITION)
    assert "tablet holds the lease" in result.worst.message
    assert robot.holder == "tablet"


def test_two_runs_of_a_seed_log_the_same(compiled, run_tree, make, robot, clock, published):
    logs = []
    for _ in range(2):
        clock.time_s, robot.holder, robot.holding = 0.0, None, False
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
    run_tree(compiled("Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]"))
    assert sum(topic == "pose" for topic, _ in published) == 7  # 0.05 s to 3.0 s


def test_the_quality_of_the_localisation_is_logged(compiled, run_tree, published):
    run_tree(compiled("Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]"))
    pose = next(message for topic, message in published if topic == "pose")
    state = next(message for topic, message in published if topic == "state")
    assert len(pose["covariance"]) == 9
    assert (state["localised"], state["localisation_health"]) == (True, 1.0)


def test_particles_and_obstacles_are_logged_when_they_change(compiled, run_tree, published, script):
    script.steps = 60
    run_tree(compiled("Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]"))
    (known,) = [message for topic, message in published if topic == "navigation"]
    assert known == {"robot": "Alice", "particle_x": [], "particle_y": [], "seen_x": [], "seen_y": []}


def test_overruns_are_counted(compiled, run_tree, make, script, published):
    script.steps = 1
    script.ends["stow"] = lambda skill: (time.sleep(0.02), _placed())[1]
    result = run_tree(compiled(*make.FETCH), settings={"tick_period_s": 0.01})
    assert result.overruns >= 1


@pytest.fixture
def run_two(make, knowledge, registry, clock, published):
    """Runs a mission to the bedroom by Alice and Bob; `after` says who waits for whom."""
    steps = (Do.from_command(parse_command("Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]")),)

    def run_them(**after):
        entries = [
            RunEntry(
                compile_mission(Mission(name="go", robot=name, steps=steps), knowledge=knowledge, registry=registry),
                make.ScriptedRobot(clock, name),
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
