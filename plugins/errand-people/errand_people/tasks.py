"""Tasks on people: *follow*, *guide*, *greet* and *meet*."""

from __future__ import annotations

from typing import TYPE_CHECKING

from executive.tree.goals import room_region
from executive.tree.task_page import TaskPage
from executive.words.command import SPEAKER, START, Command
from executive.words.goal import GoalCondition, GoalKind, When
from executive.words.knowledge import Knowledge
from executive.words.task import Part

if TYPE_CHECKING:
    from executive.tree.node import NodeSpec
    from executive.tree.plan import PlanBuilder
    from plant.referee.object_history import Truth


class _OnPerson(TaskPage):
    """Task whose object is a person, judged in the room that its goal names."""

    object_is, goal_is = Part.PERSON, Part.PLACE

    def promise(self, command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition | None:
        """It was done with the person, known or any, in the room; greeting the unknown speaker is not judged."""
        name = "" if command.object is None else command.object.name
        if self.several and name == SPEAKER:
            return None
        room = room_region(None if command.goal == START else command.goal, knowledge)
        kind, task = (GoalKind.MET, "") if self.meets else (GoalKind.OWN, self.word)
        return GoalCondition(kind, person=knowledge.person(name), goal=room, when=When.END_OF_STEP, task=task)


class Follow(_OnPerson):
    """Follows a person until the person stands at the goal, or until told."""

    spoken = ("follow me", "follow Robin to the hall")
    verbs = ("follow",)
    ability = "follow and guide people"
    unkept = (
        {
            "said": r"(?:follow|accompany|tail|shadow|guide|lead) [^,.;]*? for (?:at most |up to |about )?(?:[\w.]+ )?"
            r"(?:\w+ )?(?:seconds?|minutes?|hours?)\b",
            "reason": "I follow and guide up to a place, or until you say stop, and not for a time as in '{}'",
        },
    )
    word, number = "follow", 6
    moves = True

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans following the person."""
        from errand_people.nodes import follow_plan

        return follow_plan(builder)

    def judge(self, condition: GoalCondition, truth: Truth) -> tuple[bool, str]:
        """Judges the paths of robots and people."""
        from errand_people.judges import judge_followed

        found = judge_followed(condition, truth)
        return found.holds, found.sentence


class Guide(_OnPerson):
    """Goes ahead of a person to the goal, at the person's pace."""

    spoken = ("guide Robin to the kitchen", "take me to the hall")
    verbs = ("guide", "lead", "escort", "accompany", "usher")
    word, number = "guide", 7
    moves = needs_goal = True

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans guiding the person."""
        from errand_people.nodes import guide_plan

        return guide_plan(builder)

    def judge(self, condition: GoalCondition, truth: Truth) -> tuple[bool, str]:
        """Judges the paths of robots and people."""
        from errand_people.judges import judge_guided

        found = judge_guided(condition, truth)
        return found.holds, found.sentence


class Greet(_OnPerson):
    """Greets a person; of an open number of people, each person at the goal once."""

    spoken = ("greet everybody in the hall", "welcome the guests in the kitchen")
    verbs = ("greet", "welcome", "salute", "introduce")
    word, number = "greet", 8
    several = True

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans greeting the person, or everybody."""
        from errand_people.nodes import greet_plan

        return greet_plan(builder)

    def judge(self, condition: GoalCondition, truth: Truth) -> tuple[bool, str]:
        """Judges the paths of robots and people, and when the robot spoke."""
        from errand_people.judges import judge_greeted

        found = judge_greeted(condition, truth)
        return found.holds, found.sentence


class Meet(_OnPerson):
    """Finds a person and goes to them; at a place that is named, the person is met there or not at all."""

    spoken = ("meet Robin in the hall", "get acquainted with Robin")
    verbs = ("meet", "contact")
    word, number = "meet", 9
    meets = True

    def plan(self, builder: PlanBuilder) -> NodeSpec:
        """Plans finding the person."""
        from errand_people.nodes import meet_plan, person_of

        goal = builder.command.goal
        return meet_plan(builder, person_of(builder), None if goal is None else builder.place(goal))
