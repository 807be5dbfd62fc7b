"""A robot whose arm goes at once where it is sent, for tests of what skills do when things go wrong."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from table_scene import BLUE, RED, taken
from table_scene import LENS as TABLE_LENS

from executive.run.worker import LockStepWorker
from plant.robots.spot.kind import spot_capabilities
from skills.api import Failed, LocalisationEstimate, Running, SkillContext
from skills.manipulation.arm.kinematics import arm_model
from skills.robot import (
    CommandId,
    CommandState,
    CommandStatus,
    FrameTree,
    Gripper,
    Image,
    Intrinsics,
    Joints,
    Lease,
    Odometry,
)
from skills.testing.estimators import PlainColours

CAPABILITIES = spot_capabilities()
MODEL = arm_model(CAPABILITIES)
GRIPPER = CAPABILITIES.gripper
LENS = Intrinsics(64, 48, 55.2, 55.2, 32.0, 24.0)


@dataclass
class ScriptedRobot:
    """Commands are done one tick later; `arm_answers` and `gripper_stops_rad` script what goes wrong.

    Pictures are dark and without depth unless there are `things` on a table (`table_scene`).
    """

    name: str = "Alice"
    now_s: float = 0.0
    height_m: float = 0.52
    q: Any = field(default_factory=lambda: MODEL.stowed_rad.copy())
    opening: float = 0.0
    holding: bool = False
    gripper_stops_rad: float = 0.0
    scan_now: Any = None
    things: Any = None
    arm_answers: dict[int, CommandStatus] = field(default_factory=dict)
    arm_commands: list[Any] = field(default_factory=list)
    stopped: list[CommandId] = field(default_factory=list)
    status: dict[CommandId, CommandStatus] = field(default_factory=dict)

    def now(self):
        return self.now_s

    def advance(self, dt_s):
        self.now_s += dt_s
        for command, status in self.status.items():
            if status.state is CommandState.RUNNING:
                self.status[command] = CommandStatus(CommandState.DONE)

    def capabilities(self):
        return CAPABILITIES

    def odometry(self):
        return Odometry(self.now_s, RigidTransform([0.0, 0.0, self.height_m]), (0.0, 0.0, 0.0))

    def joints(self):
        return Joints(self.now_s, dict(zip(MODEL.names, self.q.tolist(), strict=True)), {}, {})

    def gripper(self):
        return Gripper(self.now_s, self.opening, 0.0, self.holding)

    def scan(self):
        return self.scan_now

    def image(self, source, *, visual=True, depth=True):
        hand = MODEL.X_BH(self.q)
        frames = FrameTree(
            {
                "body": ("odom", RigidTransform([0.0, 0.0, self.height_m])),
                "hand": ("body", hand),
                "hand_camera": ("hand", CAPABILITIES.hand_camera.X_FC),
            }
        )
        if self.things is not None:
            colour, depth = taken(frames.pose("hand_camera"), self.things)
            grey = colour.mean(axis=-1).astype(np.uint8)
            return Image(self.now_s, source, "hand_camera", TABLE_LENS, TABLE_LENS, colour, grey, depth, frames)
        shape = (LENS.height, LENS.width)
        colour, depth = np.zeros((*shape, 3), np.uint8), np.zeros(shape, np.float32)
        return Image(self.now_s, source, "hand_camera", LENS, LENS, colour, colour[..., 0], depth, frames)

    def move_arm(self, trajectory, *, until_s, lease):
        self.arm_commands.append(trajectory)
        answer = self.arm_answers.get(len(self.arm_commands), CommandStatus(CommandState.RUNNING))
        if answer.state is CommandState.RUNNING:
            self.q = trajectory.positions_rad[-1].copy()
        return self._note(answer)

    def point_head(self, pan_rad, tilt_rad, *, until_s, lease):
        return self._note(CommandStatus(CommandState.REFUSED, "no head"))

    def stand(self, height_m, pitch_rad, *, until_s, lease):
        self.height_m = height_m
        return self._note(CommandStatus(CommandState.RUNNING))

    def set_gripper(self, opening, force_n, *, until_s, lease):
        self.opening = max(opening, self.gripper_stops_rad)
        self.holding = self.opening > opening
        return self._note(CommandStatus(CommandState.RUNNING))

    def carry(self, holding, *, lease):
        self.carries = holding

    def lease_holder(self):
        return Lease("Alice", "test")

    def stop(self, *, lease, only=None):
        self.stopped.append(only)
        return self._note(CommandStatus(CommandState.DONE))

    def command_status(self, command):
        return self.status[command]

    def _note(self, status):
        command = CommandId(len(self.status) + 1)
        self.status[command] = status
        return command


class FixedLocaliser:
    """The odometry frame is the world."""

    def estimate(self):
        return LocalisationEstimate(0.0, RigidTransform(), np.eye(3) * 1e-4, True)

    def update(self, robot):
        pass


class OpenFloor:
    """Nothing stands anywhere."""

    def clearance_m(self, points_W):
        return np.full(len(points_W), 5.0)

    def update(self, robot, localisation):
        pass


class Colours(PlainColours):
    """Knows all nine classes; red things are cokes, blue ones beers."""

    @property
    def class_names(self):
        return ("beer", "coke", "extinguisher", "hammer", "screwdriver", "wrench", "person", "cylinder", "cube")

    def __init__(self, colours=None):
        super().__init__(colours or {"coke": RED, "beer": BLUE})


def context_of(robot, published=None, costmap=None, detector=None):
    """A context with the scripted robot as clock, too; what is published is appended to a list."""
    log = [] if published is None else published
    return SkillContext(
        robot=robot,
        lease=Lease("Alice", "test"),
        clock=robot,
        worker=LockStepWorker(robot),
        localiser=FixedLocaliser(),
        costmap=costmap or OpenFloor(),
        publish=lambda topic, message: log.append((topic, message)),
        seed=1,
        detector=detector or Colours(),
    )


def outcome(skill, inputs, limit_s=120.0):
    """Run a skill to its end; the last Step. Raises AssertionError when it takes longer than limit_s."""
    robot = skill.context.robot
    skill.begin(inputs)
    while isinstance(step := skill.step(), Running):
        robot.advance(0.1)
        assert robot.now() < limit_s, f"still {step.message}"
    skill.end()
    return step


def failed(skill, inputs, cause, part):
    """Assert that a skill fails with a cause and a sentence that holds `part`."""
    step = outcome(skill, inputs)
    assert isinstance(step, Failed), step
    assert step.cause is cause, step
    assert part in step.message, step.message
