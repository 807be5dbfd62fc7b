"""Tests of the direction and the distance of backing off among boxes."""

import math

import pytest
from planar_robot import TWO_ROOMS, Bench, Box

from skills.api import Cause, Failed, Running, Succeeded
from skills.robot import BaseKind, Pose2D
from skills.small.back_off import BackOff, BackOffInputs

IN_THE_OPEN = Pose2D(3.0, 5.5, 0.0)


def outcome(bench):
    """Runs the skill to its end; the last step."""
    bench.tick(4)
    return bench.run(BackOff(bench.context()), BackOffInputs(), limit_s=15.0)


def gone(bench, start):
    return math.hypot(bench.robot.pose.x_m - start.x_m, bench.robot.pose.y_m - start.y_m)


def test_in_the_open_it_goes_straight_back():
    bench = Bench(IN_THE_OPEN)
    assert isinstance(outcome(bench), Succeeded)
    assert bench.robot.pose.x_m == pytest.approx(IN_THE_OPEN.x_m - 0.4, abs=0.05)
    assert bench.robot.pose.y_m == pytest.approx(IN_THE_OPEN.y_m, abs=0.03)
    assert not bench.robot.driving


def test_with_a_wall_behind_it_goes_in_another_direction():
    start = Pose2D(0.75, 5.5, 0.0)
    bench = Bench(start)
    assert isinstance(outcome(bench), Succeeded)
    assert gone(bench, start) > 0.3
    assert bench.robot.least_clearance_m > 0.02


def test_an_obstacle_seen_behind_counts_too():
    bench = Bench(IN_THE_OPEN, unmapped=[Box(1.9, 5.2, 2.3, 5.8, 0.0, 1.5)])
    bench.tick(30)
    assert isinstance(outcome(bench), Succeeded)
    assert bench.robot.least_clearance_m > 0.02


def test_a_base_that_cannot_go_sideways_goes_ahead_then():
    start = Pose2D(0.75, 5.5, 0.0)
    bench = Bench(start, base_kind=BaseKind.DIFFERENTIAL)
    assert isinstance(outcome(bench), Succeeded)
    assert bench.robot.pose.x_m == pytest.approx(start.x_m + 0.4, abs=0.05)


def test_shut_in_it_says_so_and_stays():
    around = [
        Box(2.0, 5.0, 2.35, 6.0, 0.0, 1.5), Box(3.65, 5.0, 4.0, 6.0, 0.0, 1.5),
        Box(2.4, 5.85, 3.6, 6.1, 0.0, 1.5), Box(2.4, 4.9, 3.6, 5.15, 0.0, 1.5),
    ]  # fmt: skip
    bench = Bench(IN_THE_OPEN, surveyed=[*TWO_ROOMS, *around])
    step = outcome(bench)
    assert isinstance(step, Failed) and step.cause is Cause.PLANNING
    assert gone(bench, IN_THE_OPEN) < 0.01


def test_a_robot_that_refuses_is_an_execution_failure():
    bench = Bench(IN_THE_OPEN)
    bench.robot.refuse_because["drive"] = "it sits"
    assert outcome(bench) == Failed(Cause.EXECUTION, "The robot refused to drive: it sits.")


def test_a_robot_that_does_not_move_is_given_up():
    bench = Bench(IN_THE_OPEN)
    bench.robot._move_base = lambda dt_s: None
    step = outcome(bench)
    assert (step.cause, "is stuck" in step.message) == (Cause.EXECUTION, True)


def test_it_stops_when_it_is_ended_while_it_drives():
    bench = Bench(IN_THE_OPEN)
    skill = BackOff(bench.context())
    bench.tick(4)
    skill.begin(BackOffInputs())
    for _ in range(10):
        skill.step()
        bench.tick()
    assert bench.robot.driving
    skill.end()
    skill.end()
    assert not bench.robot.driving


def test_it_backs_off_when_a_restart_resumes_it():
    bench = Bench(IN_THE_OPEN)
    bench.tick(4)
    skill = BackOff(bench.context())
    skill.resume(BackOffInputs())
    while isinstance(step := skill.step(), Running):
        bench.tick()
    assert isinstance(step, Succeeded)
    assert gone(bench, IN_THE_OPEN) > 0.3


@pytest.mark.nightly
def test_spot_backs_off_in_the_plant_when_a_restart_resumes_it(small_plant):
    bench = small_plant.bench
    before, skill = bench.robot.odometry().pose, BackOff(bench.context())
    skill.resume(BackOffInputs())
    while isinstance(step := skill.step(), Running):
        bench.clock.advance(0.05)
    after = bench.robot.odometry().pose
    assert isinstance(step, Succeeded), step
    assert math.hypot(after.x_m - before.x_m, after.y_m - before.y_m) > 0.3
