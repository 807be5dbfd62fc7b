"""Task *find*: looks whether an object or a person is there, and answers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from executive.mission.world_names import in_world
from executive.tree.goals import FLOOR_M, classes_of, regions_of
from executive.tree.task_page import TaskPage
from executive.words.command import Command
from executive.words.goal import GoalCondition, GoalKind, Region
from executive.words.knowledge import ANYBODY, Knowledge
from executive.words.task import Part

if TYPE_CHECKING:
    from executive.tree.node import NodeSpec
    from executive.tree.plan import PlanBuilder


class Find(TaskPage):
    """Looks whether an object or a person is at a place."""

    word, number = "find", 2
    spoken = ("find the hammer", "is there a beer in the kitchen", "look for a coke in the hall")
    object_is, goal_is, item_is = Part.THING, Part.PLACE, Part.THING
    several = looks = True

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans a look at the place's surfaces, or a search of rooms for people."""
        from executive.tree.nodes.search import find_plan

        return find_plan(builder)

    def promise(self, command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition:
        """The answer is right."""
        assert command.object is not None
        who, asked, count = knowledge.somebody(command.object.name), str(command.object), command.object_count
        place = None if command.goal is None else knowledge.place(command.goal)
        if who is not None:
            rooms = tuple(Region(name, knowledge.rooms[name]) for name in knowledge.rooms_to_search(who, place))
            person = None if who == ANYBODY else who
            return GoalCondition(GoalKind.ANSWERED, (ANYBODY,), count, rooms, person=person, wanted=asked)
        classes, regions = classes_of(command.object, knowledge), regions_of(command, knowledge, elsewhere)
        around = [name for name in knowledge.rooms if place in (None, name)]
        floors = tuple(Region(f"the floor of the {name}", knowledge.rooms[name], *FLOOR_M) for name in around)
        meant = in_world(command.object.relations, knowledge, command.goal)
        floors = () if meant else floors
        return GoalCondition(GoalKind.ANSWERED, classes, count, regions, wanted=asked, maybe=floors, relations=meant)
