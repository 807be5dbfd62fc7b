"""What the nodes of one robot's tree share while they run."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from executive.tree.behaviours.board import Board
from skills.api import (
    NO_WORK_COUNTER,
    Ask,
    Costmap,
    Detector,
    Localiser,
    Publish,
    SkillContext,
    WorkCounter,
    Worker,
    nobody_to_ask,
)
from skills.detection import NO_DETECTOR
from skills.robot import Clock, Lease, Pose2D, Robot
from skills.stack import RobotStack, default_stack

if TYPE_CHECKING:
    from pydrake.math import RigidTransform


def leaf_seed(run_seed: int, path_id: str) -> int:
    """A 32-bit seed made of the run's seed and a path id; the same on every machine."""
    digest = hashlib.sha256(f"{run_seed}:{path_id}".encode()).digest()
    return int.from_bytes(digest[:4], "big")


def never_pressed() -> str | None:
    """The answer where there is no stop button."""
    return None


@dataclass(frozen=True)
class RunContext:
    """One robot, its lease, its estimators, and what the run lends to all nodes of its tree.

    `stop_pressed` says why nothing may move while a stop button is pressed, else None.
    """

    robot: Robot
    lease: Lease
    clock: Clock
    worker: Worker
    localiser: Localiser
    costmap: Costmap
    publish: Publish
    seed: int
    board: Board
    ask: Ask = nobody_to_ask
    detector: Detector = NO_DETECTOR
    stop_pressed: Callable[[], str | None] = never_pressed
    stack: RobotStack = field(default_factory=default_stack)
    work: WorkCounter = NO_WORK_COUNTER

    def pose(self) -> Pose2D | None:
        """Where the robot believes to be, the planar part of X_WB; None while it is not localised."""
        return Pose2D.from_transform(self.X_WB()) if self.localiser.estimate().localised else None

    def X_WB(self) -> RigidTransform:
        """The body's pose in the world, as estimated."""
        return self.localiser.estimate().X_WO @ self.robot.odometry().X_OB

    def for_skill(self, path_id: str) -> SkillContext:
        """The part of it that a skill may touch."""
        return SkillContext(
            robot=self.robot,
            lease=self.lease,
            clock=self.clock,
            worker=self.worker,
            localiser=self.localiser,
            costmap=self.costmap,
            publish=self.publish,
            seed=leaf_seed(self.seed, path_id),
            ask=self.ask,
            detector=self.detector,
            work=self.work,
            stack=self.stack,
        )
