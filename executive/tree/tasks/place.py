"""Task *place*: puts the held object down at a place."""

from __future__ import annotations

from typing import TYPE_CHECKING

from executive.tree.goals import carried_goal
from executive.tree.task_page import TaskPage
from executive.words.command import Command
from executive.words.goal import GoalCondition
from executive.words.knowledge import Knowledge
from executive.words.task import Part

if TYPE_CHECKING:
    from executive.tree.node import NodeSpec
    from executive.tree.plan import PlanBuilder


class Place(TaskPage):
    """Puts an object down."""

    word, number = "place", 3
    spoken = ("put the beer on the desk", "set the cup down on the kitchen table")
    object_is, goal_is, item_is = Part.THING, Part.PLACE, Part.THING
    puts = True

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans carrying the object to the place, and putting it down there."""
        from executive.tree.nodes.carry import carry_plan

        return carry_plan(builder)

    def promise(self, command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition:
        """The object is at the place, or the person has it."""
        return carried_goal(command, knowledge)
