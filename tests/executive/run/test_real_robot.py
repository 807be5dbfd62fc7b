"""A real robot in a run: whose lease is taken, or that is silent for a while."""

import pytest

from executive.run.control import Control
from executive.run.control_state import Mode
from executive.run.outcome import Outcome
from skills.api import Cause

TAKEN, FREE = "tablet holds the lease of Alice", "the lease was given back"
SILENT = "Alice has not answered for 3 s"


@pytest.fixture
def control():
    return Control(attended=True, pace=None)


@pytest.fixture
def go(compiled, run_tree, make, control):
    """Runs the fetch mission with a real robot; `doing` maps ticks to actions. Returns result and states by tick."""

    def run(doing, control=control):
        seen = []

        def observe(progress):
            doing.get(progress.ticks, lambda: None)()
            seen.append((control.state.mode, control.state.reason))

        return run_tree(compiled(*make.FETCH), control=control, observer=observe, real=True), seen

    return run


def taken(robot):
    """Another program takes the lease; the robot stops."""
    robot.holder = "tablet"


def freed(robot):
    robot.lease = None


def set_silent(robot, silent):
    robot.silent = silent


def test_a_taken_lease_pauses_the_run_until_the_operator_resumes_it(go, control, robot, script):
    moves = []
    result, seen = go(
        {
            4: lambda: taken(robot),
            20: lambda: freed(robot),
            22: lambda: moves.append(robot.calls.count("drive")),
            1500: lambda: (moves.append(robot.calls.count("drive")), control.resume()),
        }
    )
    assert result.outcome is Outcome.SUCCESS
    assert (moves[0], seen[10], seen[1400]) == (moves[1], (Mode.PAUSED, TAKEN), (Mode.PAUSED, FREE))
    assert robot.holder is None


def test_a_lease_that_another_still_has_is_not_taken_back(go, control, robot):
    result, seen = go({4: lambda: taken(robot), 10: control.resume, 20: lambda: freed(robot), 30: control.resume})
    assert seen[12] == (Mode.PAUSED, TAKEN)
    assert result.outcome is Outcome.SUCCESS


def test_a_robot_that_was_silent_goes_on_by_itself(go, robot, script):
    script.steps = 30
    result, seen = go({4: lambda: set_silent(robot, True), 100: lambda: set_silent(robot, False)})
    assert [seen[tick] for tick in (60, 70, 95)] == [(Mode.RUNNING, ""), (Mode.PAUSED, SILENT), (Mode.PAUSED, SILENT)]
    assert result.outcome is Outcome.SUCCESS


def test_a_silent_robot_that_the_operator_has_paused_stays_paused(go, control, robot, script):
    script.steps = 30
    by_hand = {80: lambda: control.pause("by hand"), 150: control.resume}
    result, seen = go({4: lambda: set_silent(robot, True), 100: lambda: set_silent(robot, False), **by_hand})
    assert seen[140] == (Mode.PAUSED, "by hand")
    assert result.outcome is Outcome.SUCCESS


@pytest.mark.parametrize("trouble", [TAKEN, SILENT])
def test_a_mission_that_nobody_can_resume_ends_with_a_cause(go, robot, script, trouble):
    script.steps = 30
    begin = (lambda: taken(robot)) if trouble == TAKEN else (lambda: set_silent(robot, True))
    result, _ = go({4: begin}, control=Control(pace=None))
    assert (result.outcome, result.worst.cause) == (Outcome.FAILURE, Cause.EXECUTION)
    assert result.worst.message == f"{trouble}; nobody resumed the mission within 60 s"


def test_a_mission_whose_lease_was_taken_and_given_back_names_the_taker_at_its_end(go, control, robot, script):
    script.steps = 30
    result, _ = go({4: lambda: taken(robot), 20: lambda: freed(robot)}, control=Control(pace=None))
    assert result.worst.message == f"{TAKEN}; {FREE}; nobody resumed the mission within 60 s"
