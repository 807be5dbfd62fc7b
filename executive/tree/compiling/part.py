"""What is made of a part of a mission: nodes, and what they are to bring about."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from executive.mission.gripper import InGripper
from executive.tree.node import NodeSpec
from executive.words.command import Command
from executive.words.goal import GoalCondition
from skills.api import Skill

__all__ = ["Assembled", "StepPart"]


@dataclass(frozen=True)
class StepPart:
    """A part of a mission with something to show for it: a command, or a skill on its own.

    `path_id` is that of its subtree, `node` that of its outermost node where it is another; `skill` the skill on its
    own, `goal` what it must bring about (None: nothing that a referee can see). `held` is what the gripper holds before
    it; with `opening`, that is what it held when the mission began.
    """

    path_id: str
    command: Command | None = None
    skill: type[Skill[Any]] | None = None
    goal: GoalCondition | None = None
    held: InGripper | None = None
    opening: bool = True
    node: str = ""


@dataclass(frozen=True)
class Assembled:
    """Nodes in a row, and what they are to bring about, in order."""

    nodes: tuple[NodeSpec, ...] = ()
    parts: tuple[StepPart, ...] = ()

    def __add__(self, other: Assembled) -> Assembled:
        return Assembled(self.nodes + other.nodes, self.parts + other.parts)
