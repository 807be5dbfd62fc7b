"""Tasks of a distribution of its own, as the toys for the door of tasks: with a goal, an object, a text, a person."""

from contextlib import contextmanager
from types import MappingProxyType

import pytest

from executive.language import addressees, clauses, task_sentences, tokens
from executive.tree.goals import went_goal
from executive.tree.nodes.command_plans import go_to_goal, go_to_object
from executive.tree.task_page import TaskPage
from executive.words import task
from executive.words.goal import GoalCondition, GoalKind
from executive.words.task import Part, installed_tasks


class Vacuum(TaskPage):
    """Cleans the floor of a room."""

    word = "vacuum"
    goal_is, needs_goal = Part.PLACE, True
    sentences = (
        {
            "template": "(vacuum|hoover) [the floor of] [{place:goal}]",
            "samples": ["vacuum the hall", "hoover the hall"],
        },
    )

    def plan(self, builder):
        """Plans going there, and a pause for the work."""
        return builder.sequence("vacuum", go_to_goal(builder), builder.pause("work", "vacuum 5 s", 5.0))

    def promise(self, command, knowledge, elsewhere):
        """What `judge` judges, in the room."""
        return GoalCondition(GoalKind.OWN, goal=went_goal(command, knowledge).goal, task=self.word)

    def judge(self, condition, truth):
        """A robot was in the room at the end of the step."""
        ended_s = truth.now_s if condition.ended_s is None else condition.ended_s
        robots = [path.position_at(ended_s) for path in truth.robots.values()]
        there = any(condition.goal[0].contains(p_W) for p_W in robots)
        return there, f"the floor of the {condition.goal[0].name} was {'' if there else 'not '}covered."


class Water(TaskPage):
    """Waters an object."""

    word = "water"
    object_is, goal_is = Part.THING, Part.PLACE
    sentences = ({"template": "water [{thing:object}]", "samples": ["water the beer"]},)

    def plan(self, builder):
        """Plans going to the object, and a pause for the work."""
        there = go_to_object(builder, builder.key("seen"))
        return builder.sequence("water", there, builder.pause("work", "water 3 s", 3.0))


class Call(TaskPage):
    """Calls a text out."""

    word = "call"
    object_is = Part.TEXT
    sentences = ({"template": "call out {text:object}", "samples": ["call out dinner is ready"]},)

    def plan(self, builder):
        """Plans the speech."""
        return builder.skill("speak", {"text": builder.command.object.name})

    def promise(self, command, knowledge, elsewhere):
        """What `judge` judges."""
        return GoalCondition(GoalKind.OWN, task=self.word)

    def judge(self, condition, truth):
        """The robot spoke once."""
        return len(condition.spoken_s) == 1, f"the robot spoke at {condition.spoken_s}."


class Read(TaskPage):
    """Reads the number on a display."""

    word = "read"
    answers, past = True, MappingProxyType({"read": "read"})
    goal_is, needs_goal = Part.PLACE, True
    sentences = ({"template": "read the number (of|on|at) {place:goal}", "samples": ["read the number of the desk"]},)

    def plan(self, builder):
        """Plans going there, and a picture."""
        return builder.sequence("read", go_to_goal(builder), builder.pause("look", "look 2 s", 2.0))


TASKS = (Vacuum(), Water(), Call(), Read())


class Polish(TaskPage):
    """Polishes an object."""

    word = "polish"
    object_is, goal_is = Part.THING, Part.PLACE
    sentences = ({"template": "(polish|shine) [{thing:object}]", "samples": ["polish the hammer"]},)

    plan = Water.plan


class Patrol(TaskPage):
    """Walks about in a room."""

    word = "patrol"
    goal_is, needs_goal = Part.PLACE, True
    sentences = ({"template": "patrol [{room:goal}]", "samples": ["patrol the hall"]},)

    plan = Vacuum.plan


class Measure(TaskPage):
    """Measures the temperature of a place, and says it."""

    word, answers = "measure", True
    goal_is, needs_goal = Part.PLACE, True
    sentences = (
        {
            "template": "measure the temperature (in|of|at) {place:goal}",
            "samples": ["measure the temperature in the hall"],
        },
    )

    plan = Read.plan


class Sweep(Vacuum):
    """Sweeps the floor of a room."""

    word, past = "sweep", MappingProxyType({"swept": "sweep"})
    sentences = ({"template": "sweep [out] [{room:goal}]", "samples": ["sweep the hall"]},)


class Scan(Water):
    """Scans the code of an object, and says it."""

    word, answers = "scan", True
    sentences = ({"template": "scan [the code of] [{thing:object}]", "samples": ["scan the beer"]},)


class Cheer(Call):
    """Cheers a person up."""

    word, object_is = "cheer", Part.PERSON
    sentences = ({"template": "cheer {person:object} up", "samples": ["cheer Robin up"]},)


MORE_TASKS = (Polish(), Patrol(), Measure(), Sweep(), Scan(), Cheer())


@contextmanager
def tasks_installed(*tasks, beside=True):
    """Installs tasks beside the shipped ones, or alone; yields all by their words."""
    modules = (addressees, clauses, task_sentences, tokens)
    cached = ((one, each) for one in modules for each in vars(one).values() if hasattr(each, "cache_clear"))
    caches = [each for one, each in cached if each.__module__ == one.__name__]
    found = {**(installed_tasks() if beside else {}), **{each.word: each for each in tasks}}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(task, "_found", lambda: (found, {}))
        for each in caches:
            each.cache_clear()
        yield found
    for each in caches:
        each.cache_clear()
