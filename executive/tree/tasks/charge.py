"""Task *charge*: drives onto the dock and charges the battery there."""

from __future__ import annotations

from typing import TYPE_CHECKING

from executive.tree.goals import POSE_NEAR_M, square_region
from executive.tree.task_page import TaskPage
from executive.words.command import Command
from executive.words.goal import GoalCondition, GoalKind
from executive.words.knowledge import Knowledge
from executive.words.task import Part

if TYPE_CHECKING:
    from executive.tree.node import NodeSpec
    from executive.tree.plan import PlanBuilder


class Charge(TaskPage):
    """Charges the battery at the dock."""

    word, number = "charge", 5
    spoken = ("charge your battery", "go and charge")
    item_is, docks = Part.THING, True

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans charging at the robot's dock."""
        from executive.tree.nodes.dock import charge_plan

        return charge_plan(builder)

    def promise(self, command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition | None:
        """The robot is at the dock."""
        if knowledge.dock is None:
            return None
        return GoalCondition(GoalKind.WENT, goal=(square_region("the dock", knowledge.dock, POSE_NEAR_M),))
