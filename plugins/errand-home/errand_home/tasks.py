"""Household tasks: *compare* objects; *seek* people, *report*, *answer* and *deliver* to them."""

from __future__ import annotations

from datetime import date
from typing import TYPE_CHECKING, Any

from errand_home.facts import facts_of
from errand_home.topics import about_people, own_sentence
from executive.tree.goals import classes_of, regions_of, room_region, square_region
from executive.tree.task_page import TaskPage
from executive.words.command import START, Command
from executive.words.goal import GoalCondition, GoalKind, Region, When
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


class Seek(TaskPage):
    """Finds a person by pose, gesture or colour of clothes in the room of a place, and goes to them."""

    word = "seek"
    object_is, goal_is, needs_goal = Part.TEXT, Part.PLACE, True
    spoken = (
        "find the waving person in the kitchen",
        "greet the person wearing a blue coat in the study",
    )

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans the search and the way beside the person."""
        from errand_home.person_nodes import seek_plan

        return seek_plan(builder)

    def promise(self, command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition:
        """Returns the condition that the robot is before a person who fits, the one nearest to the place."""
        room, near = _around(str(command.goal), knowledge)
        own: dict[str, Any] = {"when": When.END_OF_STEP, "wanted": _text_of(command), "task": self.word}
        return GoalCondition(GoalKind.OWN, goal=room, source=near, **own)

    def judge(self, condition: GoalCondition, truth: Truth) -> tuple[bool, str]:
        """Judges who is before the robot by the true appearance."""
        from errand_home.person_judges import judge_sought

        return judge_sought(condition, truth)


class Report(TaskPage):
    """Says something of the robot, the team, the date or people to the person at the goal, or where the robot is."""

    word = "report"
    object_is, goal_is = Part.TEXT, Part.PLACE
    answers = True
    verbs = ("say", "tell")
    spoken = (
        "tell me the time",
        "tell me how many waving persons are in the kitchen",
        "tell the name of the person at the desk to the person at the dresser",
    )

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans finding it out, the way to the listener, and the sentence."""
        from errand_home.person_nodes import report_plan

        return report_plan(builder)

    def promise(self, command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition:
        """Returns the condition that what the robot says is true, and said to the listener."""
        topic, goal = _text_of(command), str(command.goal)
        asked, person = about_people(topic), knowledge.person(goal)
        source: tuple[Region, ...] = ()
        due: tuple[str, ...] = ()
        if asked is not None:
            room, near = _around(asked.place, knowledge)
            source = (*room, *near)
        elif topic != "time":
            due = (own_sentence(topic, facts_of(knowledge), knowledge.robot.name, date.today(), 0.0),)
        listener: tuple[Region, ...] = ()
        if goal == START:
            listener = (square_region(START, knowledge.start),)
        elif command.goal is not None and person is None:
            listener, _ = _around(goal, knowledge)
        own: dict[str, Any] = {"when": When.END_OF_STEP, "wanted": topic, "task": self.word}
        return GoalCondition(GoalKind.OWN, due, source=source, goal=listener, person=person, **own)

    def judge(self, condition: GoalCondition, truth: Truth) -> tuple[bool, str]:
        """Judges the last sentence, and to whom it was said."""
        from errand_home.person_judges import judge_reported

        return judge_reported(condition, truth)


class Answer(TaskPage):
    """Answers a question, or a quiz, of the person before the robot."""

    word = "answer"
    object_is = Part.TEXT
    verbs = ("answer",)
    spoken = ("meet Jane in the study and answer a quiz",)

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans asking for the question, and the answer from the facts."""
        from errand_home.person_nodes import answer_plan

        return answer_plan(builder)

    def promise(self, command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition:
        """Returns the condition that the answer is that of the facts."""
        known = tuple(f"{each.question}? {each.answer}" for each in facts_of(knowledge).quiz)
        return GoalCondition(GoalKind.OWN, known, when=When.END_OF_STEP, wanted=_text_of(command), task=self.word)

    def judge(self, condition: GoalCondition, truth: Truth) -> tuple[bool, str]:
        """Judges the last sentence by the question that the person asks."""
        from errand_home.person_judges import judge_replied

        return judge_replied(condition, truth)


class Deliver(TaskPage):
    """Hands an object to a person who is described by pose, gesture or colour of clothes."""

    word = "deliver"
    object_is, goal_is, item_is, needs_goal = Part.TEXT, Part.PLACE, Part.THING, True
    spoken = ("take the cola from the desk and give it to the waving person in the study",)

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans the search with the object in the gripper, and the hand-over."""
        from errand_home.person_nodes import deliver_plan

        return deliver_plan(builder)

    def promise(self, command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition:
        """Returns the condition that a person who fits has the object."""
        room, _ = _around(str(command.goal), knowledge)
        classes = classes_of(command.item, knowledge)
        return GoalCondition(GoalKind.OWN, classes, goal=room, wanted=_text_of(command), task=self.word)

    def judge(self, condition: GoalCondition, truth: Truth) -> tuple[bool, str]:
        """Judges who has the object by the true appearance."""
        from errand_home.person_judges import judge_delivered

        return judge_delivered(condition, truth)


def _text_of(command: Command) -> str:
    """Text of a command's object."""
    return "" if command.object is None else str(command.object.plain)


def _around(place: str, knowledge: Knowledge) -> tuple[tuple[Region, ...], tuple[Region, ...]]:
    """Region of the room of a place, and that of the place itself when it is a surface."""
    known = knowledge.place(place)
    near = (Region(known, knowledge.surfaces[known].polygon),) if known in knowledge.surfaces else ()
    return room_region(known, knowledge), near
