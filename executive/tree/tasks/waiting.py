"""Task *wait*: goes to a place, if one is named, and waits there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from executive.tree.goals import went_goal
from executive.tree.task_page import TaskPage
from executive.words.command import Command
from executive.words.goal import GoalCondition
from executive.words.knowledge import Knowledge
from executive.words.task import Part

if TYPE_CHECKING:
    from executive.tree.node import NodeSpec
    from executive.tree.plan import PlanBuilder

LONGEST_WAIT_S: Final = 86400.0


class Wait(TaskPage):
    """Waits for a time."""

    word, number = "wait", 4
    spoken = ("wait for ten seconds", "wait in the hall for a minute")
    object_is, goal_is, item_is = Part.TIME, Part.PLACE, Part.THING
    several = True

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans going to the named place, if any, and a pause. Raises InputError for a time that cannot be waited."""
        from executive.tree.nodes.carry import goal_in_words
        from executive.tree.nodes.command_plans import go_to_goal

        command = builder.command
        if command.item is not None:
            raise builder.error(f"the {command.item} cannot be carried by waiting", "take it there in its own step")
        duration_s = command.amount or 0.0
        if not 0.0 < duration_s <= LONGEST_WAIT_S:
            what = "a wait lasts a day at most" if duration_s else "it is not said for how long to wait"
            raise builder.error(what, 'name a time up to a day, such as "10 seconds"')
        pause = builder.pause("wait", f"wait {duration_s:g} s", duration_s)
        if command.goal is None:
            return builder.sequence("wait here", pause)
        return builder.sequence(f"wait at {goal_in_words(builder, command.goal)}", go_to_goal(builder), pause)

    def promise(self, command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition | None:
        """The robot is at the named place."""
        return None if command.goal is None else went_goal(command, knowledge)
