"""Tests of a paused routine: it continues when nothing has changed, and else checks again."""

from typing import ClassVar

import numpy as np
import pytest

from executive.testing.bench import SkillBench
from plant.robots.spot.kind import spot_capabilities
from skills.api import Cause, Failed, Running, Skill, Succeeded
from skills.manipulation.arm.arm_skill import ArmSkill
from skills.robot import ArmTrajectory
from skills.routine import PATIENCE_S, rest_of
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot

CAPABILITIES = spot_capabilities()
STOWED = np.array(CAPABILITIES.arm.stowed_rad)
REACH = STOWED + np.array([0.6, 0.6, -0.6, 0.2, 0.2, 0.2])
TICK_S = 0.05


class Works(ArmSkill):
    """Stands higher, swings the arm, opens the gripper; `story` tells what was begun."""

    name = "works"
    Inputs: ClassVar[type] = type(None)

    def __init__(self, context):
        super().__init__(context)
        self.story = []

    def run(self, inputs):
        self.story.append("stand")
        yield from self.stand_at(0.56, "standing up")
        self.story.append("reach")
        yield from self.follow(ArmTrajectory(np.array([0.0, 1.0]), np.array([STOWED, REACH])), "reaching")
        self.story.append("open")
        yield from self.move_gripper(1.2, 20.0, "opening")
        return Succeeded("done")

    def run_again(self, inputs):
        self.story.append("again")
        yield Running("looking what is done")
        return Succeeded("done again")


class Nests(Works):
    """Lets another skill go first."""

    def run(self, inputs):
        yield from self.perform(self.inner, None)
        return (yield from super().run(inputs))


class Inner(Skill):
    name = "inner"
    Inputs: ClassVar[type] = type(None)

    def begin(self, inputs):
        self.log = [*getattr(self, "log", []), "begin"]
        self.left = 3

    def step(self):
        self.left -= 1
        return Running("inside") if self.left else Succeeded("inside done")

    def end(self):
        self.log.append("end")


@pytest.fixture
def robot():
    return ScriptedRobot(VirtualClock(), capabilities=CAPABILITIES)


@pytest.fixture
def bench(robot):
    return SkillBench(robot, robot._clock)


def run(skill, bench, pauses=(), pause_s=0.5, between=lambda: None):
    """Step a skill to its end, pausing it before the given ticks; the last step."""
    skill.begin(None)
    for tick in range(400):
        if tick in pauses:
            skill.suspend()
            bench.robot.stop(lease=skill.context.lease)
            between()
            bench.clock.advance(pause_s)
            assert bench.robot.moving_parts == ()
            skill.resume(None)
        step = skill.step()
        if not isinstance(step, Running):
            skill.end()
            return step
        bench.clock.advance(TICK_S)
    raise AssertionError("it does not end")


@pytest.mark.parametrize("tick", range(1, 40, 2))
def test_paused_at_any_moment_it_does_everything_once(bench, robot, tick):
    skill = Works(bench.context())
    assert run(skill, bench, {tick}) == Succeeded("done")
    assert skill.story == ["stand", "reach", "open"]
    assert robot.q_rad == pytest.approx(REACH)
    assert (robot.height_m, robot.opening) == (pytest.approx(0.56, abs=0.021), pytest.approx(1.2))


def test_pauses_again_and_again_let_it_come_to_its_end(bench):
    skill = Works(bench.context())
    assert run(skill, bench, set(range(2, 400, 4))) == Succeeded("done")
    assert skill.story == ["stand", "reach", "open"]


def carried_away(robot):
    robot.odometry_pose = type(robot.odometry_pose)(2.0, 0.0, 0.0)


def lose(robot):
    robot.in_gripper_rad = None


@pytest.mark.parametrize(
    ("pause_s", "between"),
    [(11.0, lambda robot: None), (0.5, carried_away), (0.5, lose)],
    ids=["after a long pause", "when the robot has moved", "when the object was lost"],
)
def test_it_looks_again(bench, robot, pause_s, between):
    if between is lose:
        robot.in_gripper_rad = robot.opening = 0.3
        robot.clamp_force_n = 20.0
    again = run(Works(bench.context()), bench, {6}, pause_s=pause_s, between=lambda: between(robot))
    assert again == Succeeded("done again")


def test_a_skill_within_is_suspended_and_resumed(bench):
    skill = Nests(bench.context())
    skill.inner = Inner(bench.context())
    assert run(skill, bench, {2}) == Succeeded("done")
    assert skill.inner.log == ["begin", "end", "begin", "end"]


def test_the_rest_of_a_trajectory_begins_where_the_arm_is():
    whole = ArmTrajectory(np.array([0.0, 1.0, 2.0]), np.array([[0.0], [1.0], [3.0]]))
    rest = rest_of(whole, 0.6, np.array([0.55]))
    assert rest.times_s == pytest.approx([0.0, 0.5625, 1.5625])
    assert rest.positions_rad[:, 0] == pytest.approx([0.55, 1.0, 3.0])
    assert rest_of(whole, 9.0, np.array([3.2])).positions_rad[:, 0] == pytest.approx([3.0, 3.0])


def test_a_command_that_somebody_else_stops_again_and_again_is_a_failure(bench, robot):
    skill = Works(bench.context())
    skill.begin(None)
    for _ in range(4):
        skill.step()
        bench.clock.advance(TICK_S)
    for _ in range(round(PATIENCE_S / TICK_S) + 20):
        robot.stop(lease=skill.context.lease)
        if isinstance(ended := skill.step(), Failed):
            break
        bench.clock.advance(TICK_S)
    assert ended.cause is Cause.EXECUTION
    assert bench.clock.now() > PATIENCE_S
