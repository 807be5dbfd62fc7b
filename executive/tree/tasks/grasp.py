"""Task *grasp*: finds an object, approaches it and takes hold of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from executive.mission.world_names import in_world
from executive.tree.goals import classes_of, regions_of
from executive.tree.task_page import TaskPage
from executive.words.command import Command
from executive.words.goal import GoalCondition, GoalKind
from executive.words.knowledge import Knowledge
from executive.words.task import Part

if TYPE_CHECKING:
    from executive.tree.node import NodeSpec
    from executive.tree.plan import PlanBuilder


class Grasp(TaskPage):
    """Takes hold of an object."""

    word, number = "grasp", 1
    spoken = ("take the beer", "grab a coke from the kitchen table")
    object_is, goal_is, item_is = Part.THING, Part.PLACE, Part.THING
    takes = True

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans finding, approaching and grasping the object, also elsewhere than at its usual place."""
        from executive.tree.nodes.command_plans import grasp_plan

        return grasp_plan(builder)

    def promise(self, command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition:
        """An object of the kind that was on one of the surfaces is held."""
        classes, regions = classes_of(command.object, knowledge), regions_of(command, knowledge, elsewhere)
        meant = in_world(() if command.object is None else command.object.relations, knowledge, command.goal)
        count, wanted = command.object_count, str(command.object)
        return GoalCondition(GoalKind.GRASPED, classes, count, regions, wanted=wanted, relations=meant)
