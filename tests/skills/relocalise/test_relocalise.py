"""Finding the place again after the robot was carried off."""

import dataclasses
import math

import numpy as np
from planar_robot import TWO_ROOMS, Bench, Box

from skills.api import Cause, Failed, Running, Succeeded
from skills.relocalise.skill import Relocalise, RelocaliseInputs
from skills.robot import Pose2D

START = Pose2D(1.5, 2.0, 0.0)
FAR = Pose2D(8.0, 2.3, 2.0)


def outcome(bench, inputs=None, context=None):
    """Run the skill to its end; the last step, and what it said on the way."""
    skill, said = Relocalise(context or bench.context()), []
    skill.begin(inputs or RelocaliseInputs())
    while isinstance(step := skill.step(), Running):
        said.append(step.message)
        bench.tick()
        assert bench.clock.now() < 120.0
    skill.end()
    return step, list(dict.fromkeys(said))


def lost_bench(to, **options):
    """A robot that was carried off, and whose localiser has noticed."""
    bench = Bench(START, **options)
    for _ in range(10):
        bench.tick()
    bench.robot.carry_off(to)
    for _ in range(12):
        bench.tick()
    assert not bench.localiser.estimate().localised
    return bench


def test_it_finds_the_robot_anywhere_standing_still():
    bench = lost_bench(FAR)
    step, said = outcome(bench)
    assert isinstance(step, Succeeded), step
    assert bench.pose_error()[0] < 0.04
    assert bench.robot.travelled_m == 0.0
    assert "searching the whole map" in said
    assert math.isclose(bench.robot.pose.yaw_rad, FAR.yaw_rad)


def test_a_robot_that_knows_its_place_is_left_alone():
    bench = Bench(START)
    for _ in range(10):
        bench.tick()
    step, said = outcome(bench)
    assert step.message == "the scans agree with the map already"
    assert said == ["seeing whether scans agree"]


def strange_bench():
    """A robot in a place that no map knows."""
    spots = np.random.default_rng(5).uniform(20.0, 26.0, (60, 2))
    pillars = [Box(x, y, x + 0.15, y + 0.15) for x, y in spots if math.hypot(x - 23, y - 23) > 1]
    bench = Bench(Pose2D(23.0, 23.0, 0.3), surveyed=TWO_ROOMS, unmapped=pillars, believed_start=START)
    for _ in range(20):
        bench.tick()
    return bench


def test_where_nothing_fits_it_turns_slowly_and_gives_up():
    bench = strange_bench()
    step, said = outcome(bench, RelocaliseInputs(turns=3))
    assert step == Failed(Cause.POSTCONDITION, "no place on the map fits what the robot sees")
    assert "turning slowly to see more" in said
    assert abs(bench.robot.pose.yaw_rad - 0.3 - math.pi / 2) < 0.2
    assert not bench.robot.driving


def test_a_robot_that_refuses_to_turn_is_an_execution_failure():
    bench = strange_bench()
    bench.robot.refuse_because = "it sits"
    step, _ = outcome(bench)
    assert step == Failed(Cause.EXECUTION, "the robot refused to turn: it sits")


def test_without_new_scans_it_says_so():
    bench = lost_bench(FAR)
    old = bench.robot.scan()
    bench.robot.scan = lambda: old
    for _ in range(10):
        bench.tick()
    step, _ = outcome(bench)
    assert step == Failed(Cause.PRECONDITION, "there are no new scans to find the place by")


def test_a_localiser_that_cannot_search_is_a_failed_precondition():
    bench = Bench(START)
    step, _ = outcome(bench, context=dataclasses.replace(bench.context(), localiser=object()))
    assert step.cause is Cause.PRECONDITION


def test_searching_changes_nothing_until_it_is_accepted():
    bench = lost_bench(FAR)
    before = bench.localiser.estimate()
    found = bench.localiser.search(bench.robot.scan(), bench.localiser.estimate(), None)
    assert bench.localiser.estimate().X_WO.IsExactlyEqualTo(before.X_WO)
    bench.localiser.accept(found)
    assert bench.localiser.estimate().X_WO.IsNearlyEqualTo(found.X_WO, 1e-9)
    assert bench.localiser.estimate().localised
