"""Tests of the watch over the object in the gripper."""

from dataclasses import replace

import pytest

from plant.robots.fetch.kind import FETCH
from skills.hold import Grip, HoldWatch, firmer_n, grip_again, hold_watch
from skills.robot import Gripper
from skills.testing.clock import VirtualClock
from skills.testing.robot import BASE_ONLY, ScriptedRobot, Start

PERIOD_S = 0.05


def judged(*readings, watch=None, first=0):
    """What a watch makes of readings (opening, force, holding), one each tick."""
    watch = watch or HoldWatch()
    times = ((first + k) * PERIOD_S for k in range(len(readings)))
    return [watch.judge(Gripper(t, *reading), t) for t, reading in zip(times, readings, strict=True)]


HELD, GONE = (0.5, 80.0, True), (0.02, 0.0, False)


def test_a_gripper_without_an_object_from_the_start_is_empty():
    assert judged(GONE, GONE) == [Grip.EMPTY, Grip.EMPTY]


def test_a_loss_is_reported_at_the_second_reading_and_not_at_the_first():
    assert judged(HELD, GONE, HELD, GONE, GONE) == [Grip.HELD] * 4 + [Grip.LOST]


def test_a_gripper_that_opens_lets_go_on_purpose_even_when_it_closes_again():
    assert judged(HELD, (0.6, 0.0, True), (0.9, 0.0, False), GONE, GONE) == [Grip.HELD] + [Grip.RELEASED] * 4


def test_two_fingers_that_open_by_a_few_millimetres_let_go():
    watch = hold_watch(FETCH.capabilities())
    assert judged((0.06, 40.0, True), (0.068, 0.0, False), watch=watch)[-1] is Grip.RELEASED


def test_a_gripper_that_closes_about_the_object_slips():
    assert judged(HELD, (0.47, 80.0, True), (0.44, 80.0, True))[-2:] == [Grip.HELD, Grip.SLIPPING]


def test_a_force_that_falls_is_a_slip_unless_it_comes_back_at_once():
    weak = (0.5, 30.0, True)
    assert judged(HELD, weak, HELD, weak, weak)[1:] == [Grip.HELD, Grip.HELD, Grip.HELD, Grip.SLIPPING]


def test_noise_of_the_readings_is_no_slip():
    noisy = [(0.5 + 0.012 * (-1) ** k, 80.0 + 3.0 * (-1) ** k, True) for k in range(200)]
    assert set(judged(*noisy)) == {Grip.HELD}


def test_after_it_was_gripped_again_the_next_slip_counts_from_how_it_is_held_then():
    watch = HoldWatch()
    assert judged(HELD, (0.44, 80.0, True), watch=watch)[-1] is Grip.SLIPPING
    assert set(judged(*[(0.41, 118.0, True)] * 20, watch=watch, first=2)) == {Grip.HELD}
    assert judged((0.35, 118.0, True), watch=watch, first=22) == [Grip.SLIPS_ON]


def test_fingers_that_stay_apart_have_a_moment_to_feel_it_again():
    weak, unfelt = (0.5, 1.0, True), (0.5, 1.0, False)
    assert judged(HELD, weak, weak, unfelt, unfelt, HELD)[2:] == [Grip.SLIPPING, Grip.HELD, Grip.HELD, Grip.HELD]
    assert judged(HELD, weak, weak, *[unfelt] * 10)[3:] == [*[Grip.HELD] * 9, Grip.LOST]


def test_fingers_that_close_about_a_turning_object_may_feel_it_again_until_they_are_shut():
    weak, narrow, shut = (0.5, 1.0, True), (0.1, 1.0, False), (0.02, 1.0, False)
    assert judged(HELD, weak, weak, narrow, narrow, shut)[3:] == [Grip.HELD, Grip.HELD, Grip.LOST]


def test_fingers_that_close_after_it_was_gripped_again_have_lost_it():
    assert judged(HELD, (0.5, 1.0, True), (0.5, 1.0, True), GONE, GONE)[2:] == [Grip.SLIPPING, Grip.HELD, Grip.LOST]


def test_the_second_grip_is_half_as_strong_again_within_the_limit(spot):
    assert (firmer_n(40.0, spot), firmer_n(100.0, spot)) == (60.0, 0.95 * spot.gripper.max_force_n)


def test_gripping_again_closes_more_firmly(spot):
    clock = VirtualClock()
    robot = ScriptedRobot(clock, capabilities=spot, start=Start(holding=True))
    grip_again(robot, 40.0, clock=clock, lease=robot.acquire_lease("test"))
    clock.advance(0.5)
    assert (robot.gripper().force_n, robot.gripper().holding) == (60.0, True)


# by how much (m) two fingers close about what they hold -> a slip: that of Spot's finger is 0.05 rad of 1.57
@pytest.mark.parametrize(("closed_m", "grip"), [(0.002, Grip.HELD), (0.004, Grip.SLIPPING)])
def test_two_fingers_that_slide_slip_by_millimetres(closed_m, grip):
    watch = hold_watch(FETCH.capabilities())
    assert judged((0.06, 40.0, True), (0.06 - closed_m, 40.0, True), watch=watch)[-1] is grip


def test_a_gripper_that_is_read_seldom_is_judged_by_two_readings_as_well(spot):
    watch = hold_watch(replace(spot, sensor_period_s=0.1))
    grips = [watch.judge(Gripper(0.1 * (n // 2), 0.5, 20.0, n < 2), 0.05 * n) for n in range(5)]
    assert grips == [Grip.HELD] * 4 + [Grip.LOST]


def test_a_finger_that_turns_is_judged_as_usual(spot):
    assert hold_watch(spot) == HoldWatch() == hold_watch(BASE_ONLY)
