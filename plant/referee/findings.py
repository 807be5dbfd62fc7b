"""Findings of the referee, helpers of all judges, and the judges for following, guiding and greeting."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from executive.words.goal import GoalCondition, GoalKind, Region, When
from plant.referee.object_history import HIDES_M, ObjectHistory, TakenPicture, TimedPath, Truth
from skills.inputs.errors import count_text, definite
from skills.relations import Scene, Standing, choose
from skills.robot import FloatArray

NAMED_REGIONS = 3
NEAR_M: Final[Mapping[GoalKind, float]] = MappingProxyType(
    {GoalKind.WENT: 2.0, GoalKind.MET: 2.0, GoalKind.FOLLOWED: 3.0, GoalKind.GUIDED: 3.0, GoalKind.GREETED: 2.5}
)
"""Greatest distance of the robot's body from the person for each kind."""
LOST_M: Final = 5.0
LONGEST_LOSS_S: Final = 10.0
"""A robot that was farther than this from the person, for longer than this, has lost the person."""
SLACK_M: Final = 0.05
"""Distance by which the relations of an object may be missed."""
_SAMPLE_S: Final = 0.1


@dataclass(frozen=True)
class Finding:
    """Result for one condition: whether it holds, and the reason as a sentence."""

    holds: bool
    sentence: str


def step_end_s(condition: GoalCondition, truth: Truth) -> float:
    """Time at which the step that belongs to a condition ended; the present time while it runs."""
    return truth.now_s if condition.ended_s is None else min(condition.ended_s, truth.now_s)


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


def judge_company(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges whether a robot was near a person at the person's goal and, when following, never lost them."""
    people = {name: path for name, path in truth.persons.items() if condition.person in (None, name)}
    if not people:
        return Finding(False, f"there is no person {condition.person or ''}".rstrip() + " to go to.")
    findings = [
        _judge_pair(condition, robot, name, truth)
        for robot in truth.robots
        if condition.robot in (None, robot)
        for name in sorted(people, key=lambda name: _apart_m(condition, truth.robots[robot], people[name], truth))
    ]
    missing = Finding(False, f"there is no robot {condition.robot}.")
    return next((each for each in findings if each.holds), findings[0] if findings else missing)


def lost_s(robot: TimedPath, person: TimedPath, from_s: float, until_s: float) -> float:
    """Longest time (s) for which a robot was farther than `LOST_M` from a person."""
    times = np.arange(max(from_s, person.points[0, 3]), until_s, _SAMPLE_S)
    far = np.hypot(*(robot.positions_at(times) - person.positions_at(times))[:, :2].T) > LOST_M
    longest = run = 0
    for each in far:
        run = run + 1 if each else 0
        longest = max(longest, run)
    return _SAMPLE_S * longest


def _judge_pair(condition: GoalCondition, robot: str, person: str, truth: Truth) -> Finding:
    """Judges one robot with one person."""
    path, other, until_s = truth.robots[robot], truth.persons[person], step_end_s(condition, truth)
    apart_m, verb = _apart_m(condition, path, other, truth), "was" if is_past(condition) else "is"
    sentence = f"{robot} {verb} {apart_m:.1f} m from {person}"
    if condition.kind is GoalKind.FOLLOWED and (gone_s := lost_s(path, other, condition.from_s, until_s)):
        sentence += f", and was over {LOST_M:g} m away for {gone_s:.0f} s"
        if gone_s > LONGEST_LOSS_S:
            return Finding(False, f"{sentence}.")
    goal = condition.goal if condition.kind is not GoalKind.WENT else ()
    if goal and region_at(goal, other.position_at(until_s)) is None:
        x, y, _ = other.position_at(until_s)
        return Finding(False, f"{sentence}, who stood at ({x:.2f}, {y:.2f}), not in {where(goal)}.")
    there = f" in {region_at(goal, other.position_at(until_s))}" if goal else ""
    return Finding(apart_m <= NEAR_M[condition.kind], f"{sentence}{there}.")


def _apart_m(condition: GoalCondition, robot: TimedPath, person: TimedPath, truth: Truth) -> float:
    """Distance between a robot and a person at the time to which a condition refers, in metres."""
    until_s = step_end_s(condition, truth)
    at_W = person.position_at(until_s)
    if condition.when is When.SOME_TIME:
        return min(distance_m(p_W, at_W) for p_W in robot.positions_between(condition.from_s, until_s))
    return distance_m(robot.position_at(until_s), at_W)


def judge_pictured(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges whether enough pictures of the step show the wanted object or point, or were taken in the source."""
    from_s, until_s = condition.from_s, step_end_s(condition, truth)
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


def judge_greeted(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges whether the robot spoke near each person who stayed in the region, once per person.

    A person who came or left during the step may be greeted or not.
    """
    from scipy.optimize import linear_sum_assignment  # takes half a second, and few missions have greetings

    from_s, until_s = condition.from_s, step_end_s(condition, truth)
    robots = [path for name, path in truth.robots.items() if condition.robot in (None, name)]
    among = {name: path for name, path in truth.persons.items() if condition.person in (None, name)}
    goal = condition.goal
    inside = {
        name: [not goal or region_at(goal, p_W) is not None for p_W in path.positions_between(from_s, until_s)]
        for name, path in among.items()
    }
    stayed = [name for name, ins in inside.items() if all(ins)]
    present = [name for name in among if any(inside[name])]
    times_s = condition.spoken_s
    near = np.array([[_spoke_near(condition, robots, among[name], t_s) for t_s in times_s] for name in stayed])
    greeted = near.size and int(near[linear_sum_assignment(near, maximize=True)].sum())
    said, there = len(times_s), f"{' and '.join(stayed) or 'nobody'} stood in {where(condition.goal)}"
    was = f"{'was' if len(stayed) == 1 else 'were'}{' not' if stayed and not greeted else ''} greeted"
    some = f"{greeted} of {len(stayed)} " if 0 < greeted < len(stayed) else ""
    heard = f" and {some}{was}" if stayed else ""
    extra = f"; the robot spoke {count_text(said, 'time')}" if said != greeted else ""
    return Finding(greeted == len(stayed) and said <= max(1, len(present)), f"{there}{heard}{extra}.")


def _spoke_near(condition: GoalCondition, robots: list[TimedPath], person: TimedPath, time_s: float) -> bool:
    """Returns whether a robot was near a person at a time."""
    p_W: FloatArray = person.position_at(time_s)
    return any(distance_m(robot.position_at(time_s), p_W) <= NEAR_M[condition.kind] for robot in robots)
