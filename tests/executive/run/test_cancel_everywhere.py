"""Cancel at every tick of the demo mission: velocity zero and arm still within 0.2 s of the robot's clock."""

from typing import ClassVar

import numpy as np
import pytest

from executive.run.control import Control
from executive.run.outcome import Outcome
from executive.run.runner import run
from executive.run.visitor import RunEntry, RunSettings
from executive.run.worker import LockStepWorker
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.leaf_steps import Do
from executive.words.mission import Mission
from plant.robots.spot.kind import spot_capabilities
from skills.api import Cause, Running, Skill, Succeeded
from skills.robot import ArmTrajectory
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap, KnownPlace
from skills.testing.robot import ScriptedRobot
from tests.executive.conftest import COKE
from tests.visitors import OnTick

CAPABILITIES = spot_capabilities()
STILL_S = 0.2
TICK_S = 0.05
DRIVES = frozenset({"navigate", "approach", "hand_over"})


def moving_skill(skill_name, inputs, outputs_):
    """A skill that swings the arm and, where its kind does, drives at full speed, with commands far ahead."""

    class Moving(Skill):
        name: ClassVar[str] = skill_name
        Inputs: ClassVar[type] = inputs
        outputs: ClassVar[dict[str, type]] = outputs_

        def begin(self, inputs):
            self.left = 8
            robot, lease, now_s = self.context.robot, self.context.lease, self.context.clock.now()
            q = np.array(list(robot.joints().position_rad.values()))
            swing = np.stack([q, q + np.array([0.6, 0.3, -0.3, 0.2, 0.2, 0.2]) * (-1 if q[0] > 0.2 else 1)])
            robot.move_arm(ArmTrajectory(np.array([0.0, 0.7]), swing), until_s=now_s + 5.0, lease=lease)
            if skill_name == "grasp":
                robot.set_gripper(0.0, 30.0, until_s=now_s + 5.0, lease=lease)
            if skill_name == "stow":
                robot.stand(0.55, 0.0, until_s=now_s + 5.0, lease=lease)

        def step(self):
            self.left -= 1
            until_s = self.context.clock.now() + 5.0
            if skill_name in DRIVES:
                self.context.robot.drive(1.6, 0.0, 1.0, until_s=until_s, lease=self.context.lease)
            if self.left > 0:
                return Running("in motion")
            values = {"observation": COKE, "observations": (COKE,), "unexplained": (), "tried": ()}
            return Succeeded("done", {name: values[name] for name in outputs_})

    return Moving


@pytest.fixture
def mission(make, knowledge):
    registry = {name: moving_skill(name, *ports) for name, ports in make.PORTS.items()}
    steps = [Do.from_command(parse_command(text)) for text in make.FETCH]
    return compile_mission(
        Mission(name="fetch drink", robot="Alice", steps=tuple(steps)), knowledge=knowledge, registry=registry
    )


def run_until(mission, tick, act):
    """Run the mission, act on its control after a tick; the result, robot, clock, and how long each part moved on."""
    clock, control = VirtualClock(), Control(pace=None)
    robot = ScriptedRobot(clock, capabilities=CAPABILITIES)
    robot.in_gripper_rad = 0.3
    entry = RunEntry(mission, robot, KnownPlace(), BlockCostmap())
    result = run(
        [entry],
        clock=clock,
        worker=LockStepWorker(clock),
        settings=RunSettings(tick_period_s=TICK_S, verb_limit_s=60.0),  # a fresh clone compiles kernels meanwhile
        control=control,
        visitors=[OnTick(lambda progress: act(control, robot, progress) if progress.ticks >= tick else None)],
    )
    return result, robot, clock


def cancelled(mission, tick):
    result, robot, clock = run_until(mission, tick, lambda control, *_: control.cancel("enough"))
    moved = robot.moving_parts
    clock.advance(STILL_S)
    pose, arm = robot.pose, robot.q_rad.copy()
    speed, parts = float(np.abs(robot.velocity).max()), robot.moving_parts
    clock.advance(0.5)
    still = robot.pose == pose and np.array_equal(robot.q_rad, arm)
    return result, moved, speed, parts, still


@pytest.mark.parametrize("first", [0, *(pytest.param(first, marks=pytest.mark.nightly) for first in (1, 2))])
def test_cancel_at_every_tick_leaves_the_robot_at_rest_within_its_time(mission, first):
    """Every third tick by day, in which each skill, of eight ticks, is met in another phase."""
    whole, _, _ = run_until(mission, 1_000_000, None)
    assert whole.outcome is Outcome.SUCCESS
    assert whole.ticks > 45
    in_motion = 0
    for tick in range(first, whole.ticks, 3):
        result, moved, speed, parts, still = cancelled(mission, tick)
        assert (result.outcome, result.worst.cause) == (Outcome.CANCELLED, Cause.CANCELLED), f"tick {tick}"
        assert (speed, parts, still) == (0.0, (), True), f"tick {tick}: {parts} still moves"
        in_motion += "drive" in moved
    assert in_motion > 6


@pytest.mark.parametrize("tick", range(3, 48, 7))
def test_pausing_leaves_the_robot_at_rest_within_its_time_and_the_mission_goes_on(mission, tick):
    speeds = {}

    def act(control, robot, progress):
        if progress.ticks == tick:
            control.pause()
        speeds[progress.ticks - tick] = (float(np.abs(robot.velocity).max()), robot.moving_parts)
        if progress.ticks == tick + 20:
            control.resume()

    result, _, _ = run_until(mission, tick, act)
    assert result.outcome is Outcome.SUCCESS
    held = [speeds[k] for k in range(round(STILL_S / TICK_S), 21)]
    assert set(held) == {(0.0, ())}


def test_holding_is_kept_through_a_pause(mission):
    forces = []

    def act(control, robot, progress):
        if robot.holding and not forces:
            control.pause()
        if control.state.mode.value == "paused":
            forces.append((robot.holding, robot.clamp_force_n))
            if len(forces) == 30:
                control.resume()

    result, _, _ = run_until(mission, 1, act)
    assert result.outcome is Outcome.SUCCESS
    assert set(forces) == {(True, 30.0)}
