"""What the nodes of one robot's tree share while they run."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field

from executive.tree.behaviours.board import Board
from skills.api import Ask, Costmap, Detector, Localiser, Publish, SkillContext, Worker, nobody_to_ask
from skills.detection import NO_DETECTOR
from skills.robot import Clock, Lease, Robot
from skills.stack import RobotStack, default_stack


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
            stack=self.stack,
        )
