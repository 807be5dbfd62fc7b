"""Files of skill tests: what is refused, with line and hint, and how a trial is judged."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import pytest

from executive.testing.skill_test import (
    RobotSetup,
    WorldSetup,
    bench_of_setup,
    carry_out,
    load_skill_tests,
    scripted_maker,
)
from skills.api import Cause, Failed, Running, Skill, Succeeded
from skills.inputs.errors import InputError
from skills.robot import Pose2D
from skills.testing.robot import BASE_ONLY
from tests.tables import yaml_beside


@dataclass(frozen=True)
class WaitInputs:
    seconds: float
    where: Pose2D | None = None


class Wait(Skill[WaitInputs]):
    """Waits; fails when the body moves."""

    name = "wait"
    Inputs = WaitInputs
    outputs: ClassVar[Mapping[str, type]] = {"waited": float}
    causes: ClassVar[Mapping[Cause, str]] = {Cause.EXECUTION: "the body moved"}

    def begin(self, inputs):
        self.inputs, self.begun_s = inputs, self.context.clock.now()

    def step(self):
        if abs(self.context.robot.odometry().pose.x_m) > 0.1:
            return Failed(Cause.EXECUTION, "the body moved")
        waited = self.context.clock.now() - self.begun_s
        return Succeeded("waited", {"waited": waited}) if waited >= self.inputs.seconds else Running("waiting")


GOOD = """\
skill: wait
with: {seconds: 1}
tests:
  - name: it waits
    expect: {outcome: success, within_s: 2}
  - name: pushed
    with: {seconds: 5}
    faults: [odometry jumps 0.5 m at 1 s]
    expect: {outcome: failure, cause: EXECUTION, message: moved}
  - name: cancelled
    cancel_at_s: 0.5
    expect: {outcome: cancelled, cause: CANCELLED}
"""
SKILLS = {"wait": Wait}
MAKERS = {"scripted": scripted_maker(BASE_ONLY)}


@pytest.fixture
def written(tmp_path):
    def write(text):
        path = tmp_path / "wait.skilltest.yaml"
        path.write_text(text)
        return path

    return write


def differences(path, index):
    return carry_out(load_skill_tests(path, SKILLS), index, Wait, MAKERS).differences


def test_tests_that_go_as_expected_show_no_difference(written):
    path = written(GOOD)
    assert [differences(path, index) for index in range(3)] == [(), (), ()]


@pytest.mark.parametrize(
    ("old", "new", "index", "difference"),
    [
        ("outcome: success,", "outcome: failure,", 0, "expected failure, got success"),
        ("within_s: 2", "within_s: 0.5", 0, "expected an end within 0.5 s, got 1.05 s"),
        ("cause: EXECUTION", "cause: TIMEOUT", 1, "expected failure TIMEOUT, got failure EXECUTION"),
        ("message: moved", "message: fell", 1, "expected a message like /fell/, got: the body moved"),
        ("cancel_at_s: 0.5", "cancel_at_s: 5", 2, "expected cancelled CANCELLED, got success"),
    ],
)
def test_a_difference_is_reported_in_a_sentence(written, old, new, index, difference):
    assert old in GOOD
    assert differences(written(GOOD.replace(old, new)), index) == (difference,)


def test_the_report_lists_faults_and_messages(written):
    file = load_skill_tests(written(GOOD.replace("message: moved", "message: fell")), SKILLS)
    report = carry_out(file, 1, Wait, MAKERS).report()
    assert "it ended with failure EXECUTION after 1" in report
    assert "fault: odometry jumps 0.5 m at 1 s" in report
    assert "0.05 s  waiting" in report


REFUSED = yaml_beside(__file__, "refused_tests.yaml")


@pytest.mark.parametrize("case", REFUSED, ids=lambda case: case["message"])
def test_a_wrong_file_is_refused_with_its_line(written, case):
    assert case["old"] in GOOD
    path = written(GOOD.replace(case["old"], case["new"]))
    with pytest.raises(InputError, match=re.escape(case["message"])) as refused:
        load_skill_tests(path, SKILLS)
    assert (refused.value.file, refused.value.line) == (path, case["line"])


def test_the_robot_stands_before_a_point_at_its_arms_best_distance(robot_capabilities):
    _, robot = bench_of_setup(robot_capabilities, RobotSetup(before=(1.38, 0.5)), WorldSetup())
    best_m = robot_capabilities.arm.standing_m[0]
    place = robot.pose
    assert (place.x_m, place.y_m, place.yaw_rad) == pytest.approx((1.38 - best_m, 0.5, 0.0))
