"""Tests of robots without work in a run of several: they clear ways, and are left alone when they do not answer."""

import math
import time
from dataclasses import dataclass, replace

import pytest

from executive.run.outcome import Outcome
from executive.run.runner import run
from executive.run.visitor import RunEntry, RunSettings
from executive.run.worker import LockStepWorker
from executive.tree.compiler import CompiledTree
from executive.tree.node import NodeSpec
from executive.tree.registry import SkillRegistry
from skills.api import Running, Skill, Succeeded
from skills.faults.faulty_robot import inject_faults, parse_fault
from skills.inputs.errors import InputError
from skills.manipulation.posture import StowInputs
from skills.navigate.skill import Navigate, NavigateInputs
from skills.robot import Pose2D
from skills.testing.blocks import Block
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap, KnownPlace
from skills.testing.robot import ScriptedRobot, Start
from tests.visitors import OnMessage

LANE = (Block(-2.0, -1.0, 4.0, -0.5), Block(-2.0, 0.5, 4.0, 1.0), Block(6.0, -3.0, 6.5, 3.0))
"""A lane 1 m wide from x = -2 to 4 m, and room before a wall at 6 m."""
VERB_LIMIT_S, LONG_S = 1.0, 60.0
"""On the wall clock: in a fresh clone kernels are compiled while a robot drives, which takes longer than a second."""


class Drives(Skill):
    """Goes to the end of the lane, as `navigate` does."""

    name, Inputs = "drives", StowInputs

    def begin(self, inputs):
        self._navigate = Navigate(self.context)
        self._navigate.begin(NavigateInputs(Pose2D(3.2, 0.0, 0.0)))

    def step(self):
        return self._navigate.step()

    def end(self):
        self._navigate.end()


class Finishes(Skill):
    """Is done at once."""

    name, Inputs = "finishes", StowInputs

    def begin(self, inputs):
        self._ticks = 0

    def step(self):
        return Succeeded("done")


class AsksTheImu(Finishes):
    """Uses a verb in the third tick."""

    name = "asks_the_imu"

    def step(self):
        self._ticks += 1
        if self._ticks > 2:
            self.context.robot.imu()
        return Running("at work")


class Hanging(ScriptedRobot):
    """A robot whose IMU does not answer."""

    def imu(self):
        time.sleep(1.5 * VERB_LIMIT_S)
        return super().imu()


@dataclass
class Lane:
    """Robots in a lane, each with one skill to do."""

    clock: VirtualClock
    published: list
    verb_limit_s: float = LONG_S

    def entry(self, name, skill, x_m, *, after=(), robot=ScriptedRobot):
        """A robot that begins at x_m in the lane's middle."""
        start = Pose2D(x_m, 0.0, 0.0)
        plan = NodeSpec("skill", f"{name.lower()}/test", "test", {"skill": skill, "limit_s": 100.0})
        body = robot(self.clock, name=name, start=Start(start))
        return RunEntry(CompiledTree(name, "test", (), plan), body, KnownPlace(start), BlockCostmap(LANE), after=after)

    def run(self, *entries, spare=()):
        """Runs them to their end."""
        return run(
            entries,
            spare=spare,
            clock=self.clock,
            worker=LockStepWorker(self.clock),
            visitors=[OnMessage(lambda topic, message: self.published.append((topic, message)))],
            settings=RunSettings(tick_period_s=0.1, verb_limit_s=self.verb_limit_s, time_limit_s=120.0),
        )


@pytest.fixture
def lane():
    return Lane(VirtualClock(), [])


def test_a_robot_whose_mission_is_over_clears_a_reserved_path(lane):
    """Bob is done at once and stands in the lane; Alice gets to its end, and Bob's lease is given back."""
    alice, bob = lane.entry("Alice", Drives, 0.0), lane.entry("Bob", Finishes, 2.0)
    result = lane.run(alice, bob)
    assert result.outcome is Outcome.SUCCESS
    assert {each.robot_name: each.stepped_aside for each in result.robots} == {"Alice": False, "Bob": True}
    assert (alice.robot.lease_holder(), bob.robot.lease_holder()) == (None, None)
    assert not any(topic == "errors" for topic, _ in lane.published)


def test_a_robot_that_waits_for_another_clears_its_path(lane):
    """Bob begins when Alice is done, and stands where she has to pass until then."""
    bob = lane.entry("Bob", Finishes, 2.0, after=("Alice",))
    result = lane.run(lane.entry("Alice", Drives, 0.0), bob)
    assert result.outcome is Outcome.SUCCESS
    assert bob.robot.odometry().pose.x_m + 2.0 > 3.7
    assert [each.stepped_aside for each in result.robots] == [False, False]


def test_a_robot_outside_all_paths_stays_where_it_ended(lane):
    """Bob stands behind Alice."""
    bob = lane.entry("Bob", Finishes, -1.4)
    result = lane.run(lane.entry("Alice", Drives, 0.0), bob)
    assert result.outcome is Outcome.SUCCESS
    assert math.hypot(bob.robot.odometry().pose.x_m, bob.robot.odometry().pose.y_m) < 0.01


def test_a_verb_that_hangs_ends_the_mission_of_its_robot_only(lane):
    """Bob stands aside and hangs; Alice goes on and arrives."""
    lane.verb_limit_s = VERB_LIMIT_S
    bob = lane.entry("Bob", AsksTheImu, -1.4, robot=Hanging)
    alice_result, bob_result = lane.run(lane.entry("Alice", Drives, 0.0), bob).robots
    assert alice_result.outcome is Outcome.SUCCESS
    assert bob_result.outcome is Outcome.ERROR and "'imu'" in bob_result.message
    assert bob.robot.lease_holder() is None


def test_a_robot_without_a_mission_clears_a_reserved_path(lane):
    """Bob has nothing to do in the run, and is not among its results."""
    bob = lane.entry("Bob", Finishes, 2.0)
    result = lane.run(lane.entry("Alice", Drives, 0.0), spare=(bob,))
    assert [(each.robot_name, each.outcome) for each in result.robots] == [("Alice", Outcome.SUCCESS)]
    assert bob.robot.odometry().pose.x_m + 2.0 > 3.7 and bob.robot.lease_holder() is None


def test_a_robot_without_a_mission_that_does_not_answer_is_left_alone(lane):
    """Bob is dead from the beginning; Alice arrives."""
    bob = lane.entry("Bob", Finishes, -1.4)
    dead = replace(bob, robot=inject_faults(bob.robot, lane.clock, [parse_fault("robot dies")]))
    assert lane.run(lane.entry("Alice", Drives, 0.0), spare=(dead,)).outcome is Outcome.SUCCESS
    assert "capabilities does not answer" in str([message for topic, message in lane.published if topic == "errors"])


def test_a_run_of_an_old_installation_without_step_aside_is_refused_before_it_begins(lane, monkeypatch):
    monkeypatch.setattr("executive.run.resting.installed_skills", lambda: SkillRegistry({}, {}))
    alice = lane.entry("Alice", Drives, 0.0)
    with pytest.raises(InputError, match="there is no skill 'step_aside'; install this project again"):
        lane.run(alice)
    assert alice.robot.lease_holder() is None
