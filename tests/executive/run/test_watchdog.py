"""A verb that hangs on the wall's clock is broken off."""

import threading
import time

import pytest

from executive.run.outcome import Outcome
from executive.run.watchdog import VerbHung, watched


class Hanging:
    name = "Alice"

    def drive(self, *_arguments):
        time.sleep(5.0)

    def image(self, source):
        time.sleep(0.1)
        return source

    def stop(self):
        return 3


def test_a_hanging_verb_raises_soon():
    robot = watched(Hanging(), limit_s=0.05)
    began = time.perf_counter()
    with pytest.raises(VerbHung, match=r"'drive' within 0\.05 s"):
        robot.drive(1.0)
    assert time.perf_counter() - began < 1.0


def test_other_verbs_pass_and_no_alarm_is_left_behind():
    robot = watched(Hanging(), limit_s=0.05)
    assert (robot.stop(), robot.name) == (3, "Alice")
    time.sleep(0.1)


def test_taking_an_image_has_its_own_limit():
    assert watched(Hanging(), limit_s=0.02).image("hand") == "hand"


def test_calls_from_other_threads_are_let_through():
    robot, results = watched(Hanging(), limit_s=0.05), []
    thread = threading.Thread(target=lambda: results.append(robot.stop()))
    thread.start()
    thread.join()
    assert results == [3]


def test_a_hung_verb_ends_the_run_with_an_error(compiled, run_tree, make, robot, script):
    def hang(skill):
        robot.imu = lambda: time.sleep(5.0)
        skill.context.robot.imu()

    script.ends["navigate"] = hang
    result = run_tree(compiled(*make.FETCH), settings={"verb_limit_s": 0.05})
    assert result.outcome is Outcome.ERROR
    assert "'imu'" in result.worst.message
    assert (robot.driving, robot.holder) == (False, None)
