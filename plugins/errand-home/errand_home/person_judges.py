"""Judges of the tasks on described people, by a simulation's truth: who was found, what was said, and to whom."""

import math
import re
from collections.abc import Sequence
from typing import Final

from errand_home.persons import appearance_of
from errand_home.topics import about_people
from errand_people.judges import faced_people
from errand_people.looks import Appearance, Colour, Gesture, Pose, gesture_text
from executive.words.command import START
from executive.words.goal import GoalCondition, Region
from executive.words.outlines import distance_m
from plant.models.person_figure import CLOTHES, Figure
from plant.referee.findings import region_at, where
from plant.referee.object_history import Truth
from skills.inputs.errors import listing

NEXT_M: Final = 0.5
"""Difference up to which two people are equally near to a place."""
SEPARATOR: Final = "? "
"""Text between a known question and its answer in the classes of a condition."""
_CLOCK: Final = re.compile(r"It is [0-2]\d:[0-5]\d")


def true_appearance(person: str, truth: Truth) -> Appearance:
    """Returns the true appearance of a person; the colour is that of the dye nearest to the clothes."""
    placement = truth.people.get(person)
    figure = (None if placement is None else placement.figure) or Figure()
    pose, gesture, worn = Pose(figure.posture), Gesture(figure.gesture), figure.clothes
    if worn is None:
        return Appearance(pose, gesture)
    return Appearance(pose, gesture, Colour(min((math.dist(dye, worn), name) for name, dye in CLOTHES.items())[1]))


def fits(person: str, wanted: Appearance, truth: Truth) -> bool:
    """Returns whether a person has all traits of an appearance."""
    own = true_appearance(person, truth).traits()
    return all(own.get(trait) == value for trait, value in wanted.traits().items())


def judge_sought(condition: GoalCondition, truth: Truth) -> tuple[bool, str]:
    """Judges whether a robot stands before a person who fits the description, in the room and nearest to the place."""
    end_s, wanted = truth.ended_s(condition), appearance_of(condition.wanted) or Appearance()
    right = _people_at(condition.goal, condition.source, wanted, truth, end_s)
    faced = [*faced_people(condition, truth, end_s)]
    met = next((person for person in faced if person in right), None)
    is_before = f"{condition.robot or 'the robot'} is before {met or listing(faced or ['nobody'])}"
    return (
        met is not None,
        f"{is_before}; {condition.wanted} in {where(condition.goal)}: {listing(right or ['nobody'])}.",
    )


def judge_delivered(condition: GoalCondition, truth: Truth) -> tuple[bool, str]:
    """Judges whether a person who fits the description has an object of the classes."""
    wanted = appearance_of(condition.wanted) or Appearance()
    right = _people_at(condition.goal, (), wanted, truth, truth.ended_s(condition))
    takers = {one.name: one.on_tray_of for one in truth.histories if one.class_name in condition.classes}
    has = listing([f"{person} has the {name}" for name, person in takers.items() if person] or ["nobody has it"])
    meant = f"{condition.wanted} in {where(condition.goal)}: {listing(right or ['nobody'])}"
    return any(person in right for person in takers.values()), f"{has}; {meant}."


def judge_reported(condition: GoalCondition, truth: Truth) -> tuple[bool, str]:
    """Judges whether the last words are true, and whether they were said to the listener."""
    last, said_s = _last_words(condition)
    heard, asked = _listener(condition, truth, said_s), about_people(condition.wanted)
    if asked is None:
        due = ("a time of day",) if condition.wanted == "time" else condition.classes
        right = last in due or (condition.wanted == "time" and _CLOCK.fullmatch(last) is not None)
    elif asked.appearance is not None:
        due = (str(len(_people_at(condition.source[:1], (), asked.appearance, truth, said_s))),)
        right = _number_in(last) == due[0]
    else:
        people = _people_at(condition.source[:1], condition.source[1:], Appearance(), truth, said_s)
        due = tuple(dict.fromkeys(_trait(name, asked.info, truth) for name in people))
        right = any(last.endswith(f" is {each}") for each in due)
    said = f"it said {last!r} to {heard or 'nobody'}" if last else "it said nothing"
    return right and heard is not None, f"{said}; right: {listing(due or ['nothing'], last='or')}."


def judge_replied(condition: GoalCondition, truth: Truth) -> tuple[bool, str]:
    """Judges whether the last words answer the question of the person before the robot."""
    last, said_s = _last_words(condition)
    heard = next(faced_people(condition, truth, said_s), None)
    answers = truth.people[heard].answers if heard is not None and heard in truth.people else {}
    asked = next((said for part, said in answers.items() if "question" in part.lower()), "").strip("? ")
    pairs = [each.split(SEPARATOR, 1) for each in condition.classes]
    due = [pair[1] for pair in pairs if pair[0] == asked]
    said = f"it said {last!r} to {heard or 'nobody'}, who asks {asked!r}" if last else "it said nothing"
    return last in due, f"{said}; right: {listing(due or ['not known'], last='or')}."


def _last_words(condition: GoalCondition) -> tuple[str, float]:
    return (condition.said[-1], condition.spoken_s[-1]) if condition.said and condition.spoken_s else ("", math.inf)


def _number_in(said: str) -> str:
    """Number that a sentence tells; "no" is 0."""
    found = re.search(r"\b(?:are|is) (no|\d+)\b", said)
    return "" if found is None else found[1].replace("no", "0")


def _listener(condition: GoalCondition, truth: Truth, time_s: float) -> str | None:
    """Listener at a time: without a goal anybody near, at the start the speaker, else a person before the robot."""
    if condition.person is None and not condition.goal:
        return next(faced_people(condition, truth, time_s), "anybody who is there")
    if condition.goal and condition.goal[0].name == START:
        paths = truth.robots_of(condition).values()
        there = any(region_at(condition.goal, path.position_at(time_s)) is not None for path in paths)
        return "the speaker" if there else None
    heard = [one for one in faced_people(condition, truth, time_s) if condition.person in (None, one)]
    inside = (one for one in heard if region_at(condition.goal, truth.persons[one].position_at(time_s)) is not None)
    return next(iter(heard) if not condition.goal else inside, None)


def _people_at(
    rooms: Sequence[Region], near: Sequence[Region], wanted: Appearance, truth: Truth, time_s: float
) -> list[str]:
    """People who fit an appearance in a room, or those of them who are nearest to a place in it."""
    at_W = {name: path.position_at(time_s) for name, path in truth.persons.items()}
    there = [name for name, p_W in at_W.items() if region_at(rooms, p_W) is not None and fits(name, wanted, truth)]
    if not near or not there:
        return there
    away_m = {name: distance_m(near[0].polygon_W, (at_W[name][0], at_W[name][1])) for name in there}
    return [name for name in there if away_m[name] <= min(away_m.values()) + NEXT_M]


def _trait(person: str, info: str, truth: Truth) -> str:
    own = true_appearance(person, truth)
    if info == "name":
        return f"called {person}"
    return str(own.pose) if info == "pose" else gesture_text(own.gesture or Gesture.NONE)
