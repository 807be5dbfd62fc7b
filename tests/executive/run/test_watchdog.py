"""A verb that hangs on the wall's clock is broken off."""

import signal
import threading
import time

import pytest

from executive.run.guarded_robot import GuardedRobot
from executive.run.outcome import Outcome
from executive.run.watchdog import VerbHung, Watchdog
from skills.robot import Lease

LIMIT_S = 0.05
NO_LEASE = Lease("", "")


class Hanging:
    name = "Alice"

    def drive(self, vx, vy, wz, *, until_s, lease):
        time.sleep(5.0)

    def image(self, source, *, visual, depth):
        time.sleep(0.1)
        return source

    def stop(self, *, lease, only):
        return 3


@pytest.fixture
def watchdog():
    with Watchdog(LIMIT_S) as watchdog:
        yield watchdog


@pytest.fixture
def hanging(watchdog):
    return GuardedRobot(Hanging(), watchdog, limit_s=LIMIT_S, image_limit_s=LIMIT_S)


def test_a_hanging_verb_raises_soon(hanging):
    began = time.perf_counter()
    with pytest.raises(VerbHung, match=r"'drive' within 0\.05 s"):
        hanging.drive(1.0, 0.0, 0.0, until_s=1.0, lease=NO_LEASE)
    assert time.perf_counter() - began < 1.0


def test_other_verbs_pass_and_nothing_is_overdue_afterwards(hanging):
    assert (hanging.stop(lease=NO_LEASE), hanging.name) == (3, "Alice")
    time.sleep(3 * LIMIT_S)


def test_a_tick_that_hangs_is_named_before_the_verb_in_it(watchdog, hanging):
    with pytest.raises(VerbHung, match="a tick of Alice"), watchdog.over_tick("Alice", 0.03):
        hanging.drive(1.0, 0.0, 0.0, until_s=1.0, lease=NO_LEASE)
    time.sleep(3 * LIMIT_S)


def test_an_alarm_of_somebody_else_goes_to_its_handler():
    rung = []
    before = signal.signal(signal.SIGALRM, lambda number, frame: rung.append(number))
    try:
        with Watchdog(LIMIT_S):
            signal.raise_signal(signal.SIGALRM)
        signal.raise_signal(signal.SIGALRM)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert rung == [signal.SIGALRM, signal.SIGALRM]


def test_taking_an_image_has_its_own_limit(watchdog, monkeypatch):
    monkeypatch.setattr("executive.run.guarded_robot.CHECKS", {})
    assert GuardedRobot(Hanging(), watchdog, limit_s=0.02, image_limit_s=2.0).image("hand") == "hand"


def test_calls_from_other_threads_are_passed_on_and_abandoned_when_they_hang(hanging):
    results = []

    def call():
        results.append(hanging.stop(lease=NO_LEASE))
        with pytest.raises(VerbHung, match="'drive'"):
            hanging.drive(1.0, 0.0, 0.0, until_s=1.0, lease=NO_LEASE)
        results.append("given up")

    thread = threading.Thread(target=call)
    thread.start()
    thread.join(timeout=2.0)
    assert results == [3, "given up"]


def test_a_hung_verb_ends_the_run_with_an_error(compiled, run_tree, make, robot, script):
    def hang(skill):
        robot.imu = lambda: time.sleep(5.0)
        skill.context.robot.imu()

    script.ends["navigate"] = hang
    result = run_tree(compiled(*make.FETCH), settings={"verb_limit_s": LIMIT_S})
    assert result.outcome is Outcome.ERROR
    assert "'imu'" in result.worst.message
    assert (robot.driving, robot.holder) == (False, None)
