"""The scripted robot before a table, for tests of what skills do when things go wrong."""

import numpy as np
from table_scene import BLUE, RED, taken
from table_scene import LENS as TABLE_LENS

from executive.run.worker import LockStepWorker
from plant.robots.fetch.kind import FETCH
from plant.robots.spot.kind import spot_capabilities
from skills.api import Failed, Running, SkillContext
from skills.manipulation.arm.kinematics import arm_model
from skills.robot import CommandState, FrameTree, Image, Intrinsics
from skills.testing.estimators import BlockCostmap, KnownPlace, PlainColours
from skills.testing.robot import ScriptedRobot, Start

CAPABILITIES, HEAD_CAPABILITIES = spot_capabilities(), FETCH.capabilities()
MODEL, HEAD_MODEL = arm_model(CAPABILITIES), arm_model(HEAD_CAPABILITIES)
GRIPPER = CAPABILITIES.gripper
LENS = Intrinsics(64, 48, 55.2, 55.2, 32.0, 24.0)


class TableRobot(ScriptedRobot):
    """The scripted robot with its own clock, whose arm, body and gripper arrive in one tick.

    Its pictures show the `things` on the table, a head camera's only while nothing is held; without they are dark.
    `arm_answers` has the statuses of arm commands by their numbers, `commands` all commands with their goals.
    """

    def __init__(self, q_rad=None, *, capabilities=CAPABILITIES, holding=False, opening=0.0, things=None, **values):
        self.now_s, self.commands, self.arm_answers, self.scan_now, self.things = 0.0, [], {}, None, things
        start = Start(arm_rad=None if q_rad is None else tuple(q_rad), in_gripper_rad=opening or None, holding=holding)
        super().__init__(self, capabilities=capabilities, start=start)
        self.opening, self.in_gripper_rad = opening or self.opening, self.in_gripper_rad if holding else None
        for name, value in values.items():
            setattr(self, name, value)

    def now(self):
        return self.now_s

    def attach(self, follower):
        """Leaves it to `advance` to move the robot."""

    def advance(self, dt_s):
        self.now_s += dt_s
        self._pass_time(dt_s)

    def commanded(self, verb):
        """Goals of all commands of a verb."""
        return [goal for one, goal, _ in self.commands if one == verb]

    @property
    def arm_commands(self):
        return [trajectory for trajectory, _ in self.commanded("move_arm")]

    def scan(self):
        return self.scan_now

    def image(self, source, *, visual=True, depth=True):
        camera = self._capabilities.object_camera
        link, frame = camera.mount.value, f"{camera.mount.value}_camera"
        edges = {
            "body": ("odom", self._X_OB()),
            frame: (link, camera.X_FC),
            "hand": ("body", self.arm.X_BH(self.q_rad)),
        }
        if self._capabilities.head is not None:
            edges["head"] = ("body", self._capabilities.head.X_BF(*self.head_rad))
        frames = FrameTree(edges)
        if self.things is None:
            lens, colour, depth_m = LENS, np.zeros((48, 64, 3), np.uint8), np.zeros((48, 64), np.float32)
        else:
            seen = () if self.holding and not camera.on_hand else self.things
            lens, (colour, depth_m) = TABLE_LENS, taken(frames.pose(frame), seen)
        grey = colour.mean(axis=-1).astype(np.uint8)
        return Image(self.now_s, source, frame, lens, lens, colour, grey, depth_m, frames)

    def _begin(self, part, goal, until_s, lease, fault="", **more):
        self.commands.append((more.get("verb", part), goal, until_s))
        answer = self.arm_answers.get(len(self.arm_commands)) if part == "move_arm" else None
        return self._commands.add(answer) if answer else super()._begin(part, goal, until_s, lease, fault, **more)

    def _move_arm(self, active, dt_s):
        self.q_rad = active.goal[0].positions_rad[-1].copy()
        self._commands.finish("move_arm", CommandState.DONE)

    def _move_body(self, active, dt_s):
        super()._move_body(active, dt_s=99.0)

    def _move_gripper(self, active, dt_s):
        super()._move_gripper(active, dt_s=99.0)


class Colours(PlainColours):
    """Knows all nine classes; red things are cokes, blue ones beers."""

    @property
    def class_names(self):
        return ("beer", "coke", "extinguisher", "hammer", "screwdriver", "wrench", "person", "cylinder", "cube")

    def __init__(self, colours=None):
        super().__init__(colours or {"coke": RED, "beer": BLUE})


def context_of(robot, published=None, costmap=None, detector=None):
    """A context with the robot as clock, too; what is published is appended to a list."""
    log = [] if published is None else published
    return SkillContext(
        robot=robot,
        lease=robot.lease_holder() or robot.take_lease("test"),
        clock=robot,
        worker=LockStepWorker(robot),
        localiser=KnownPlace(),
        costmap=costmap or BlockCostmap(),
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
