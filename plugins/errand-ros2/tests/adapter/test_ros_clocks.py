"""Stamps of a robot whose clock is ahead, delayed, slow or jumping; and the clock that follows `/clock`."""

import time
from types import SimpleNamespace

import pytest

from errand_ros2.adapter.clocks import RobotClock, SimulatedClock


class Wall(RobotClock):
    """A clock that a test sets."""

    now_s = 0.0

    def now(self):
        return self.now_s


def test_a_robot_whose_clock_is_ahead_is_as_young_as_its_shortest_delay():
    told = Wall()
    for number, delay_s in enumerate([0.02, 0.1, 0.01, 0.05]):
        told.now_s = 10.0 + number
        told.hear(1e9 + number - delay_s)
    assert told.ours(1e9 + 3) == pytest.approx(13.0)
    assert told.ours(1e9 + 2.5) == pytest.approx(12.51, abs=1e-6)
    assert told.theirs(told.ours(1e9 + 2.0)) == pytest.approx(1e9 + 2.0)


def test_no_stamp_is_later_than_now():
    told = Wall()
    told.hear(5.0)
    assert told.ours(7.0) == told.now_s


@pytest.mark.parametrize("jump_s", [-100.0, 100.0])
def test_after_a_jump_stamps_count_anew(jump_s):
    told = Wall()
    for number in range(20):
        told.now_s = 0.05 * number
        told.hear(50.0 + told.now_s + (jump_s if number >= 10 else 0.0))
    assert told.jumps == 1
    assert told.ours(50.0 + jump_s + told.now_s - 0.2) == pytest.approx(told.now_s - 0.2)


def test_a_message_that_comes_late_is_no_jump():
    told = Wall()
    for now_s, stamp_s in ((1.0, 1.0), (1.1, 1.1), (3.0, 1.2), (3.1, 3.1)):
        told.now_s = now_s
        told.hear(stamp_s)
    assert told.jumps == 0
    assert told.ours(1.2) == pytest.approx(1.2)


def test_a_wall_clock_waits_and_then_calls():
    clock, called = RobotClock(), []
    clock.after = lambda: called.append(clock.now())
    for _ in range(3):
        clock.advance(0.02)
    assert len(called) == 3 and called[-1] >= 0.05


def clock_message(stamp_s):
    sec, nanosec = divmod(round(stamp_s * 1e9), 10**9)
    return SimpleNamespace(clock=SimpleNamespace(sec=sec, nanosec=nanosec))


def test_a_simulated_clock_is_that_of_its_messages():
    clock = SimulatedClock()
    assert not clock.is_heard
    clock.hear_clock(clock_message(12.5))
    assert clock.is_heard
    assert clock.now() == pytest.approx(12.5)
    clock.hear_clock(clock_message(12.55))
    assert (clock.now(), clock.ours(12.5)) == pytest.approx((12.55, 12.5))


def test_a_simulated_clock_never_goes_back_and_maps_stamps_after_a_restart():
    clock = SimulatedClock()
    clock.hear_clock(clock_message(100.0))
    clock.hear_clock(clock_message(3.0))
    assert clock.jumps == 1
    assert clock.now() == pytest.approx(100.0)
    clock.hear_clock(clock_message(3.5))
    assert (clock.now(), clock.ours(3.4), clock.theirs(100.5)) == pytest.approx((100.5, 100.4, 3.5))


def test_time_goes_on_when_the_simulator_falls_silent():
    clock = SimulatedClock()
    clock.hear_clock(clock_message(1.0))
    clock._heard_s = time.monotonic() - 5.0
    now_s = clock.now()
    assert now_s == pytest.approx(5.0, abs=0.5)
    clock.hear_clock(clock_message(1.05))
    assert clock.now() >= now_s
    clock.hear_clock(clock_message(now_s + 1.0))  # it answers again, and has caught up
    assert clock.now() == pytest.approx(now_s + 1.0)
