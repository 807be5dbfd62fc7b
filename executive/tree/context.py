"""What the nodes of one robot's tree share while they run."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

from py_trees.behaviour import Behaviour

from executive.tree.board import Board
from skills.api import LeavesOthersOut, Part, Skill, SkillContext
from skills.robot import Pose2D


def leaf_seed(run_seed: int, path_id: str) -> int:
    """A 32-bit seed made of the run's seed and a path id; the same on every machine."""
    digest = hashlib.sha256(f"{run_seed}:{path_id}".encode()).digest()
    return int.from_bytes(digest[:4], "big")


class Endings:
    """What a mission is to do in the end whatever happened, and could not do where it stands in the tree.

    The run takes it over from a node that was stopped from outside, and does it before anything else.
    """

    def __init__(self) -> None:
        self._due: list[Behaviour] = []
        self._closed = False

    @property
    def due(self) -> Behaviour | None:
        """What is to be ticked now; None when nothing is left."""
        return self._due[0] if self._due else None

    def take(self, node: Behaviour) -> bool:
        """Takes a node over, perhaps in the middle of its work; False when the run does no more of that."""
        if not self._closed:
            self._due.append(node)
        return not self._closed

    def has(self, node: Behaviour) -> bool:
        """Returns whether a node was taken over, and is not done yet."""
        return any(each is node for each in self._due)

    def done(self) -> None:
        """What was due has come to its end."""
        self._due.pop(0)

    def close(self) -> tuple[Behaviour, ...]:
        """Takes nothing any more; what was still due."""
        left, self._due, self._closed = tuple(self._due), [], True
        return left


@dataclass
class ArmOrder:
    """Whether the arm may be anywhere: its last skill was halted or suspended, failed, or leaves it out."""

    anywhere: bool = False

    def ended(self, skill: type[Skill[Any]], *, succeeded: bool) -> None:
        """A skill has ended. One for the arm alone leaves it as it is to be, when it succeeds."""
        if Part.ARM in skill.uses:
            self.anywhere = not succeeded or Part.BASE in skill.uses


@dataclass(frozen=True, kw_only=True)
class RunContext(SkillContext):
    """What the run lends to all nodes of a robot's tree: what skills may touch, the blackboard, the stop button.

    `seed` is the run's. `stop_pressed` says why nothing may move while a stop button is pressed, else None. `presses`
    counts how often each of the operator's buttons was pressed. `day_began_s` is the time of day (s after midnight) at
    zero of the robot's clock.
    """

    board: Board
    stop_pressed: Callable[[], str | None] = lambda: None
    presses: Callable[[], Mapping[str, int]] = dict
    day_began_s: float = 0.0
    endings: Endings = field(default_factory=Endings)
    arm_order: ArmOrder = field(default_factory=ArmOrder)

    @cached_property
    def leave_others_out(self) -> tuple[LeavesOthersOut, ...]:
        """The estimators that leave other robots to those who know where they are."""
        return tuple(each for each in (self.localiser, self.costmap) if isinstance(each, LeavesOthersOut))

    def known_pose(self) -> Pose2D | None:
        """Where the robot believes to be, the planar part of X_WB; None while it is not localised."""
        return self.pose() if self.localiser.estimate().localised else None

    def for_skill(self, path_id: str) -> SkillContext:
        """The part of it that a skill may touch, with a seed of its own."""
        lent = {each.name: getattr(self, each.name) for each in fields(SkillContext) if each.init}
        return SkillContext(**{**lent, "seed": leaf_seed(self.seed, path_id)})
