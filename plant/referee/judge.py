"""Judges goal conditions against the recorded truth. Pure functions: the same record gives the same verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from plant.referee.goal import GoalCondition, GoalKind, Region, Verdict
from plant.referee.object_history import ObjectHistory
from skills.robot import FloatArray

REACH_OF_PERSON_M = 1.0
OFFER_HEIGHT_M = 0.4
_STATE_KINDS = (GoalKind.WENT, GoalKind.PLACED, GoalKind.HANDED_OVER)


@dataclass(frozen=True)
class Truth:
    """The record: histories of the objects, where robots and people are now (m, world), paths, past offers."""

    histories: tuple[ObjectHistory, ...]
    bases: Mapping[str, FloatArray]
    paths: Mapping[str, FloatArray]
    persons: Mapping[str, FloatArray]
    offers: frozenset[tuple[str, str]]


@dataclass(frozen=True)
class Finding:
    """Whether one condition holds, and one plain sentence."""

    holds: bool
    sentence: str


def offered(history: ObjectHistory, p_WP: FloatArray) -> bool:
    """Whether an object is held out, high enough and near enough to a person standing at p_WP."""
    if not history.held_out or history.last.p_WO[2] < OFFER_HEIGHT_M:
        return False
    return _apart_m(history.last.p_WO, p_WP) <= REACH_OF_PERSON_M


def judge(conditions: Sequence[GoalCondition], truth: Truth, *, collisions: int, drops: int) -> Verdict:
    """The verdict on all conditions: the last is judged by the present state, earlier ones by the record."""
    findings = [_judge_one(conditions, i, truth) for i in range(len(conditions))]
    why = " ".join(finding.sentence for finding in findings) or "There are no goal conditions."
    return Verdict(all(finding.holds for finding in findings), why, collisions, drops)


def _judge_one(conditions: Sequence[GoalCondition], i: int, truth: Truth) -> Finding:
    """One condition; a state that a later condition overtakes may have passed."""
    past = any(_overtakes(later, conditions[i]) for later in conditions[i + 1 :])
    finding = _JUDGES[conditions[i].kind](conditions[i], truth, past)
    return Finding(finding.holds, finding.sentence[0].upper() + finding.sentence[1:])


def _overtakes(later: GoalCondition, condition: GoalCondition) -> bool:
    """Whether fulfilling the later condition may undo the state of the earlier."""
    if condition.kind is GoalKind.WENT:
        return True
    return later.kind in (*_STATE_KINDS, GoalKind.GRASPED) and bool(set(later.classes) & set(condition.classes))


def _judge_grasped(condition: GoalCondition, truth: Truth, past: bool) -> Finding:
    """Lifted from the source at some time."""
    done = [history for history in _of_class(condition, truth) if _lifted_from(history, condition)]
    if len(done) >= condition.needed:
        return Finding(True, f"{_names(done)} was lifted from {_where(condition.source)}.")
    lifted = [history for history in truth.histories if history.lifts]
    other = f"; {_names(lifted)} was" if lifted else ""
    wanted = _wanted(condition)
    return Finding(
        False, f"{len(done)} of {condition.needed} {wanted} was lifted from {_where(condition.source)}{other}."
    )


def _judge_handed_over(condition: GoalCondition, truth: Truth, past: bool) -> Finding:
    """Held out near the person."""
    people = {name: p for name, p in truth.persons.items() if condition.person in (None, name)}
    if not people:
        return Finding(False, f"There is no person {condition.person or ''} to hand anything to.".replace("  ", " "))
    objects = [history for history in _of_class(condition, truth) if _lifted_from(history, condition)]
    if past:
        done = [history for history in objects if any((history.name, person) in truth.offers for person in people)]
    else:
        done = [history for history in objects if any(offered(history, p) for p in people.values())]
    if len(done) >= condition.needed:
        return Finding(True, f"{_names(done)} {'was' if past else 'is'} held out to {_either(people)}.")
    return Finding(False, _why_not_handed(condition, objects, people))


def _why_not_handed(
    condition: GoalCondition, objects: Sequence[ObjectHistory], people: Mapping[str, FloatArray]
) -> str:
    """The sentence on a hand-over that failed: of the object in a gripper, or else of what was wanted."""
    held = [history for history in objects if history.held_by is not None]
    if not held:
        return f"No {_wanted(condition)} from {_where(condition.source)} is in a gripper."
    history = held[0]
    if not history.held_out:
        return f"The {history.name} is in the gripper but not held out free."
    apart = min(_apart_m(history.last.p_WO, p) for p in people.values())
    return f"The {history.name} is held {history.last.p_WO[2]:.2f} m high, {apart:.2f} m from {_either(people)}."


def _judge_placed(condition: GoalCondition, truth: Truth, past: bool) -> Finding:
    """Resting in the goal, let go."""
    objects = [history for history in _of_class(condition, truth) if _lifted_from(history, condition)]
    done = [history for history in objects if _rests_in(history, condition, past)]
    if len(done) >= condition.needed:
        return Finding(True, f"{_names(done)} {'was put' if past else 'rests'} on {_where(condition.goal)}.")
    if not objects:
        return Finding(False, f"No {_wanted(condition)} was brought from {_where(condition.source)}.")
    x, y, z = objects[0].last.p_WO
    state = "is in a gripper" if objects[0].held_by else "is" if objects[0].resting else "moves"
    where = f"at ({x:.2f}, {y:.2f}, {z:.2f})"
    return Finding(False, f"The {objects[0].name} {state} {where}, not resting on {_where(condition.goal)}.")


def _judge_went(condition: GoalCondition, truth: Truth, past: bool) -> Finding:
    """The body in the place, now or (when overtaken) at some time."""
    robots = [name for name in truth.bases if condition.robot in (None, name)]
    for name in robots:
        points = truth.paths[name] if past else truth.bases[name][None, :]
        if any(region.contains(p) for p in points for region in condition.goal):
            return Finding(True, f"{name} {'was' if past else 'is'} in {_where(condition.goal)}.")
    if not robots:
        return Finding(False, f"There is no robot {condition.robot}.")
    x, y, _ = truth.bases[robots[0]]
    return Finding(False, f"{robots[0]} is at ({x:.2f}, {y:.2f}), not in {_where(condition.goal)}.")


def _judge_answered(condition: GoalCondition, truth: Truth, past: bool) -> Finding:
    """The answer equal to the truth."""
    there = [s for s in _of_class(condition, truth) if s.resting and _in_any(condition.source, s.last.p_WO)]
    fact = len(there) >= condition.needed
    said = {True: "yes", False: "no", None: "nothing"}[condition.answer]
    found = f"{_names(there)} is" if there else f"there is no {_wanted(condition)}"
    return Finding(condition.answer is fact, f"The answer was {said}, and {found} in {_where(condition.source)}.")


_JUDGES: Mapping[GoalKind, Callable[[GoalCondition, Truth, bool], Finding]] = {
    GoalKind.GRASPED: _judge_grasped,
    GoalKind.HANDED_OVER: _judge_handed_over,
    GoalKind.PLACED: _judge_placed,
    GoalKind.WENT: _judge_went,
    GoalKind.ANSWERED: _judge_answered,
}


def _of_class(condition: GoalCondition, truth: Truth) -> list[ObjectHistory]:
    return [history for history in truth.histories if history.class_name in condition.classes]


def _lifted_from(history: ObjectHistory, condition: GoalCondition) -> bool:
    """Whether the condition's robot lifted it, and from the source where one was named."""
    return any(
        condition.robot in (None, lift.robot) and (not condition.source or _in_any(condition.source, lift.from_W))
        for lift in history.lifts
    )


def _rests_in(history: ObjectHistory, condition: GoalCondition, past: bool) -> bool:
    """Whether it rests in the goal, or did after it was carried."""
    if past:
        return any(_in_any(condition.goal, p) for p in history.rests_W[1:])
    return history.resting and _in_any(condition.goal, history.last.p_WO)


def _in_any(regions: Sequence[Region], p_W: FloatArray) -> bool:
    return any(region.contains(p_W) for region in regions)


def _apart_m(p: FloatArray, q: FloatArray) -> float:
    """Horizontal distance."""
    return float(np.hypot(p[0] - q[0], p[1] - q[1]))


def _names(histories: Sequence[ObjectHistory]) -> str:
    return " and ".join(f"the {history.name}" for history in histories)


def _wanted(condition: GoalCondition) -> str:
    return " or ".join(condition.classes)


def _where(regions: Sequence[Region]) -> str:
    return " or ".join(dict.fromkeys(region.name for region in regions)) or "anywhere"


def _either(people: Mapping[str, FloatArray]) -> str:
    return " or ".join(people)
