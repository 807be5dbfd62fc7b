"""Findings of the referee, helpers of all judges, and the judges of company, pictures and answers."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from executive.words.goal import GoalCondition, GoalKind, Region, When
from plant.referee.object_history import HIDES_M, ObjectHistory, TakenPicture, TimedPath, Truth
from skills.inputs.errors import definite
from skills.relations import Scene, Standing, choose
from skills.robot import FloatArray

NAMED_REGIONS = 3
PERSON = "person"
NEAR_M: Final = 2.0
"""Greatest distance of the robot's body from a person to whom it has gone."""
SLACK_M: Final = 0.05
"""Distance by which the relations of an object may be missed."""


@dataclass(frozen=True)
class Finding:
    """Result for one condition: whether it holds, and the reason as a sentence."""

    holds: bool
    sentence: str


def is_past(condition: GoalCondition) -> bool:
    """Returns whether a condition concerns an earlier time, not the end of the mission."""
    return condition.when is not When.END_OF_MISSION and condition.ended_s is not None


def region_at(regions: Sequence[Region], p_W: FloatArray) -> str | None:
    """Name, with its article, of the first region that contains a point; None when none does."""
    return next((the(region.name) for region in regions if region.contains(p_W)), None)


def has_relations(
    history: ObjectHistory, at_W: FloatArray, time_s: float, condition: GoalCondition, truth: Truth
) -> bool:
    """Returns whether an object at a position is one that the condition's relations mean, among those at rest then."""
    regions = condition.goal if condition.kind is GoalKind.PLACED else condition.source
    region = next((each for each in regions if each.contains(at_W)), None)
    if not condition.relations or region is None or region.viewer is None:
        return not condition.relations
    places = {one: one.place_at(time_s) for one in truth.histories} | {history: at_W}
    here = {
        one: Standing((float(p_W[0]), float(p_W[1])), one.sides_m)
        for one, p_W in places.items()
        if p_W is not None and region.contains(p_W)
    }
    landmarks = {landmark for relation in condition.relations for landmark in relation.landmarks}
    objects = {each: [at for one, at in here.items() if one.class_name in each.classes] for each in landmarks}
    scene = Scene(region.polygon_W, region.viewer, objects)
    of_class = [one for one in here if one.class_name in condition.classes or not condition.classes]
    same = [history] if condition.kind is GoalKind.PLACED else of_class
    candidates, every = [here[one] for one in same], condition.kind is GoalKind.ANSWERED
    return history in [same[k] for k in choose(condition.relations, candidates, scene, SLACK_M, every=every)]


def the(name: str) -> str:
    """Name of a place with its article; a pose or a proper name has no article."""
    return name if name.startswith("(") or name[:1].isupper() else definite(name)


def distance_m(p: FloatArray, q: FloatArray) -> float:
    """Horizontal distance between two points (m)."""
    return float(np.hypot(p[0] - q[0], p[1] - q[1]))


def where(regions: Sequence[Region]) -> str:
    """Names of the regions if they are few, else their number."""
    names = tuple(dict.fromkeys(the(region.name) for region in regions))
    return " or ".join(names) if len(names) <= NAMED_REGIONS else f"any of {len(names)} places"


def judge_company(
    condition: GoalCondition,
    truth: Truth,
    near_m: float = NEAR_M,
    on_the_way: Callable[[TimedPath, TimedPath], Finding] = lambda robot, person: Finding(True, ""),
) -> Finding:
    """Judges whether a robot was near a person at the person's goal.

    `on_the_way` judges the paths of a robot and a person before that; the finding quotes its words.
    """
    people = truth.persons_of(condition)
    if not people:
        return Finding(False, f"there is no person {condition.person or ''}".rstrip() + " to go to.")
    findings = [
        _judge_pair(condition, robot, name, truth, near_m, on_the_way(path, people[name]))
        for robot, path in truth.robots_of(condition).items()
        for name in sorted(people, key=lambda name: _apart_m(condition, path, people[name], truth))
    ]
    missing = Finding(False, f"there is no robot {condition.robot}.")
    return next((each for each in findings if each.holds), findings[0] if findings else missing)


def _judge_pair(
    condition: GoalCondition, robot: str, person: str, truth: Truth, near_m: float, way: Finding
) -> Finding:
    """Judges one robot with one person."""
    path, other = truth.robots[robot], truth.persons[person]
    apart_m, verb = _apart_m(condition, path, other, truth), "was" if is_past(condition) else "is"
    sentence = f"{robot} {verb} {apart_m:.1f} m from {person}{way.sentence}"
    if not way.holds:
        return Finding(False, f"{sentence}.")
    goal = condition.goal if condition.kind is not GoalKind.WENT else ()
    at_W = other.position_at(truth.ended_s(condition))
    if goal and region_at(goal, at_W) is None:
        return Finding(False, f"{sentence}, who stood at ({at_W[0]:.2f}, {at_W[1]:.2f}), not in {where(goal)}.")
    there = f" in {region_at(goal, at_W)}" if goal else ""
    return Finding(apart_m <= near_m, f"{sentence}{there}.")


def _apart_m(condition: GoalCondition, robot: TimedPath, person: TimedPath, truth: Truth) -> float:
    """Distance between a robot and a person at the time to which a condition refers, in metres."""
    until_s = truth.ended_s(condition)
    at_W = person.position_at(until_s)
    if condition.when is When.SOME_TIME:
        return min(distance_m(p_W, at_W) for p_W in robot.positions_between(condition.from_s, until_s))
    return distance_m(robot.position_at(until_s), at_W)


def judge_pictured(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges whether enough pictures of the step show the wanted object or point, or were taken in the source."""
    from_s, until_s = condition.from_s, truth.ended_s(condition)
    own = [each for each in truth.pictures if condition.robot in (None, each.robot)]
    taken = [each for each in own if from_s <= each.time_s <= until_s]
    right = sum(_shows(each, condition, truth) for each in taken)
    what = definite(condition.wanted) if condition.wanted else where(condition.goal or condition.source)
    if len(taken) == condition.needed == 1:
        return Finding(right == 1, f"the picture {'shows' if right else 'does not show'} {what}.")
    return Finding(right >= condition.needed, f"{right} of {max(len(taken), condition.needed)} pictures show {what}.")


def _shows(taken: TakenPicture, condition: GoalCondition, truth: Truth) -> bool:
    """Returns whether a picture shows what a condition wants; from a source it need only be in the field of view."""
    if condition.source and region_at(condition.source, taken.X_WC.translation()) is None:
        return False
    if condition.classes:
        return any(one.class_name in condition.classes and one.name in taken.seen for one in truth.histories)
    hides_m = math.inf if condition.source else HIDES_M
    middles = [(*np.mean(each.polygon_W, axis=0), 0.5 * (each.z_min_m + each.z_max_m)) for each in condition.goal]
    return all(taken.shows(np.array(middle), hides_m) for middle in middles)


def of_class(condition: GoalCondition, truth: Truth) -> list[ObjectHistory]:
    """Objects of the classes that a condition is about."""
    return [one for one in truth.histories if not condition.classes or one.class_name in condition.classes]


def wanted(condition: GoalCondition) -> str:
    """Name of what a condition is about."""
    return condition.wanted or " or ".join(condition.classes) or "object"


def judge_answered(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges an answer by what was there while the robot looked; what was there for a part of it may count or not."""
    verb, told, people = "is" if condition.answered_s is None else "was", condition.answer, truth.persons_of(condition)
    found: Iterable[tuple[str, _Places]]
    if condition.classes == (PERSON,):
        on, who, found = "in", condition.person or "nobody", ((name, partial(_stood, people[name])) for name in people)
        nothing = f"{who} {verb} {'not ' if condition.person else ''}in {where(condition.source)}"
    else:
        objects = of_class(condition, truth)
        on, found = "on", ((definite(one.name), partial(_rested, one, condition, truth)) for one in objects)
        nothing = f"there is no {wanted(condition)}{f' on {where(condition.source)}' if condition.source else ''}"
    there, aside = list[str](), list[str]()
    for name, places in found:
        is_sure, region = _seen_at(condition, places, truth)
        if region is not None:
            (there if is_sure else aside).append(f"{name} {verb} {on} {the(region.name)}")
    most = len(there) + len(aside)
    right = told is not None and told <= most and (condition.at_least or told >= len(there))
    if isinstance(told, bool):
        right = most >= condition.needed if told != condition.negated else len(there) < condition.needed
    return Finding(right, f"{said(condition)}, and {' and '.join((*there, *aside)) or nothing}.")


def said(condition: GoalCondition) -> str:
    """Words for the answer that a condition is about: yes, no, nothing, 2 or at least 2, with its question."""
    number = f"at least {condition.answer}" if condition.at_least else str(condition.answer)
    asked = condition.question and f' to "{condition.question}"'
    return f"the answer{asked} was " + {"True": "yes", "False": "no", "None": "nothing"}.get(number, number)


_Places = Callable[[float, float], Iterable[FloatArray | None]]
"""Returns the places of a person or an object in an interval (s), None where it is none that is meant."""


def _stood(path: TimedPath, from_s: float, until_s: float) -> Iterable[FloatArray]:
    return (path.position_at(from_s), *path.positions_between(from_s, until_s)[1:])


def _rested(
    one: ObjectHistory, condition: GoalCondition, truth: Truth, from_s: float, until_s: float
) -> Iterable[FloatArray | None]:
    for time_s in (from_s, *(each for each in one.rested_s if from_s < each < until_s), until_s):
        p_W = one.place_at(time_s) if condition.answered_s is not None else one.last.p_WO if one.resting else None
        yield p_W if p_W is not None and has_relations(one, p_W, time_s, condition, truth) else None


def _seen_at(condition: GoalCondition, places: _Places, truth: Truth) -> tuple[bool, Region | None]:
    """Region where something was while the robot looked there, and whether it surely was: during the whole look."""
    now_s, found = truth.now_s if condition.answered_s is None else condition.answered_s, None
    for region in (*condition.source, *condition.maybe):
        looks = [look for look in condition.looked_s if look[0] == region.name] or condition.looked_s
        span_s = min((look[1] for look in looks), default=now_s), max((look[2] for look in looks), default=now_s)
        inside = [p_W is not None and region.contains(p_W) for p_W in places(*span_s)]
        if all(inside) and region in condition.source:
            return True, region
        found = found or (region if any(inside) else None)
    return False, found
