"""What the nodes of one robot's tree share while they run."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, fields

from executive.tree.behaviours.board import Board
from skills.api import SkillContext
from skills.robot import Pose2D


def leaf_seed(run_seed: int, path_id: str) -> int:
    """A 32-bit seed made of the run's seed and a path id; the same on every machine."""
    digest = hashlib.sha256(f"{run_seed}:{path_id}".encode()).digest()
    return int.from_bytes(digest[:4], "big")


def never_pressed() -> str | None:
    """The answer where there is no stop button."""
    return None


@dataclass(frozen=True, kw_only=True)
class RunContext(SkillContext):
    """What the run lends to all nodes of a robot's tree: what skills may touch, the blackboard, the stop button.

    `seed` is the run's. `stop_pressed` says why nothing may move while a stop button is pressed, else None.
    """

    board: Board
    stop_pressed: Callable[[], str | None] = never_pressed

    def known_pose(self) -> Pose2D | None:
        """Where the robot believes to be, the planar part of X_WB; None while it is not localised."""
        return self.pose() if self.localiser.estimate().localised else None

    def for_skill(self, path_id: str) -> SkillContext:
        """The part of it that a skill may touch, with a seed of its own."""
        lent = {each.name: getattr(self, each.name) for each in fields(SkillContext)}
        return SkillContext(**{**lent, "seed": leaf_seed(self.seed, path_id)})
