"""Household tasks: *compare*."""

from __future__ import annotations

from typing import TYPE_CHECKING

from executive.tree.goals import classes_of, regions_of
from executive.tree.task_page import TaskPage
from executive.words.command import Command
from executive.words.goal import GoalCondition, GoalKind
from executive.words.knowledge import Knowledge
from executive.words.task import Part

if TYPE_CHECKING:
    from executive.tree.node import NodeSpec
    from executive.tree.plan import PlanBuilder
    from plant.referee.object_history import Truth


class Compare(TaskPage):
    """Finds the biggest, smallest, thinnest, heaviest or lightest objects at a place, and says which they are."""

    word = "compare"
    object_is, goal_is = Part.THING, Part.PLACE
    needs_goal = several = answers = True
    spoken = (
        "tell me what is the biggest object on the kitchen counter",
        "tell me what are the three heaviest drinks on the kitchen counter",
    )

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans the look, the way back to the speaker, and the answer."""
        from errand_home.nodes import compare_plan

        return compare_plan(builder)

    def promise(self, command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition:
        """Returns the condition that what the robot says is true of the objects at the place."""
        classes, source = classes_of(command.object, knowledge), regions_of(command, knowledge, ())
        wanted, count = str(command.object), command.object_count
        return GoalCondition(GoalKind.OWN, classes, count, source, wanted=wanted, task=self.word)

    def judge(self, condition: GoalCondition, truth: Truth) -> tuple[bool, str]:
        """Judges what the robot said by the sizes and weights of the objects."""
        from errand_home.judges import judge_compared

        return judge_compared(condition, truth)
