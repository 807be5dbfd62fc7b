"""Judges goal conditions against the recorded truth. Pure functions: the same record gives the same verdict."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from plant.referee.contacts import Collision
from plant.referee.goal import GoalCondition, GoalKind, Region, Verdict
from plant.referee.object_history import Lift, ObjectHistory
from skills.robot import FloatArray

NEAR_PERSON_M = 2.0
NAMED_REGIONS = 3
PERSON = "person"
_STATE_KINDS = (GoalKind.WENT, GoalKind.PLACED, GoalKind.HANDED_OVER)


@dataclass(frozen=True)
class Truth:
    """The record: histories of the objects, where robots and people are now (m, world), and their paths.

    A path is an array (N, 4) of points (m, world) and when they were reached (s); `given` says when which object last
    rested on whose tray.
    """

    histories: tuple[ObjectHistory, ...]
    bases: Mapping[str, FloatArray]
    paths: Mapping[str, FloatArray]
    persons: Mapping[str, FloatArray]
    given: Mapping[tuple[str, str], float]

    def path_since(self, robot: str, since_s: float) -> FloatArray:
        """Where a robot was at a time and went from there, (N, 3)."""
        path = self.paths[robot]
        return path[max(0, int(np.searchsorted(path[:, 3], since_s)) - 1) :, :3]


@dataclass(frozen=True)
class Finding:
    """Whether one condition holds, and one plain sentence."""

    holds: bool
    sentence: str


def judge(conditions: Sequence[GoalCondition], truth: Truth, *, bumps: Sequence[Collision]) -> Verdict:
    """The verdict on all conditions: the last is judged by the present state, earlier ones by the record."""
    findings = [_judge_one(conditions, i, truth) for i in range(len(conditions))]
    success = all(finding.holds for finding in findings) if findings else None
    since_s = min((condition.since_s for condition in conditions), default=0.0)
    bumps = [bump for bump in bumps if bump.time_s >= since_s]
    own = [bump for bump in bumps if not bump.walked_in]
    drops = sum(when_s >= since_s for history in truth.histories for when_s in history.dropped_s)
    return Verdict(
        success,
        " ".join(finding.sentence for finding in findings),
        collisions=len(own),
        drops=drops,
        people_hit=sum(bump.person is not None for bump in own),
        hit_by_people=len(bumps) - len(own),
        robots_hit=sum(bump.other_robot is not None for bump in own),
    )


def _judge_one(conditions: Sequence[GoalCondition], i: int, truth: Truth) -> Finding:
    """One condition; a state that a later condition overtakes may have passed."""
    past = conditions[i].passing or any(_overtakes(later, conditions[i]) for later in conditions[i + 1 :])
    finding = _JUDGES[conditions[i].kind](conditions[i], truth, past)
    return Finding(finding.holds, finding.sentence[0].upper() + finding.sentence[1:])


def _overtakes(later: GoalCondition, condition: GoalCondition) -> bool:
    """Whether fulfilling the later condition may undo the state of the earlier."""
    if condition.kind is GoalKind.WENT:
        return True
    return later.kind in (*_STATE_KINDS, GoalKind.GRASPED) and bool(set(later.classes) & set(condition.classes))


def _judge_grasped(condition: GoalCondition, truth: Truth, past: bool) -> Finding:
    """Lifted from the source at some time."""
    done = {history: lift for history in _of_class(condition, truth) if (lift := _lift(history, condition)) is not None}
    if len(done) >= condition.needed:
        froms = (f"the {history.name} was lifted{_from(condition, lift)}" for history, lift in done.items())
        return Finding(True, f"{' and '.join(froms)}.")
    lifted = [history for history in truth.histories if history.lifts_since(condition.since_s)]
    other = [history for history in lifted if history not in done]
    was = f"; {_names(other)} {_were(other)}" if other else ""
    return Finding(False, f"{_tally(done, condition)} lifted{_out_of(condition.source)}{was}.")


def _judge_handed_over(condition: GoalCondition, truth: Truth, past: bool) -> Finding:
    """Resting on the person's tray, let go."""
    people = {name: p for name, p in truth.persons.items() if condition.person in (None, name)}
    if not people:
        return Finding(False, f"There is no person {condition.person or ''} to hand anything to.".replace("  ", " "))
    objects = [history for history in _of_class(condition, truth) if _lift(history, condition) is not None]
    if past:
        done = [history for history in objects if _was_given(history, people, condition, truth)]
    else:
        done = [one for one in objects if one.on_tray_of in people and not one.lies_where_others_put_it]
    if len(done) >= condition.needed:
        verb = _were(done) + " put" if past else "rests" if len(done) == 1 else "rest"
        return Finding(True, f"{_names(done)} {verb} on {_either(people)}'s tray.")
    return Finding(False, _why_not_handed(condition, objects, people))


def _was_given(history: ObjectHistory, people: Collection[str], condition: GoalCondition, truth: Truth) -> bool:
    """Whether it rested on the tray of one of the people after it was lifted."""
    lift = _lift(history, condition)
    given_s = (truth.given.get((history.name, person), -np.inf) for person in people)
    return lift is not None and any(when_s >= lift.time_s for when_s in given_s)


def _why_not_handed(
    condition: GoalCondition, objects: Sequence[ObjectHistory], people: Mapping[str, FloatArray]
) -> str:
    """The sentence on a hand-over that failed: where the object is, or else what was wanted."""
    if not objects:
        return f"No {_wanted(condition)} was brought{_out_of(condition.source)}."
    history = next((one for one in objects if one.held_by is not None), objects[0])
    apart = min(_apart_m(history.last.p_WO, p) for p in people.values())
    where = f"{history.last.p_WO[2]:.2f} m high, {apart:.2f} m from {_either(people)}"
    if history.held_by is not None:
        return f"The {history.name} is still in the gripper, {where}."
    return f"The {history.name} {'rests' if history.resting else 'moves'} {where}, not on the tray."


def _judge_placed(condition: GoalCondition, truth: Truth, past: bool) -> Finding:
    """Resting in the goal, let go."""
    objects = [history for history in _of_class(condition, truth) if _lift(history, condition) is not None]
    own = [history for history in objects if past or not history.lies_where_others_put_it]
    done = {history: p for history in own if (p := _rest_in(history, condition, past)) is not None}
    if len(done) >= condition.needed:
        verb = "was put" if past else "rests"
        ons = (f"the {history.name} {verb} on {_region_at(condition.goal, p)}" for history, p in done.items())
        return Finding(True, f"{' and '.join(ons)}.")
    if not objects:
        return Finding(False, f"No {_wanted(condition)} was brought{_out_of(condition.source)}.")
    elsewhere = [history for history in objects if history not in done]
    if not elsewhere:
        return Finding(False, f"{_tally(done, condition)} put on {_where(condition.goal)}.")
    x, y, z = elsewhere[0].last.p_WO
    state = "is in a gripper" if elsewhere[0].held_by else "is" if elsewhere[0].resting else "moves"
    missed = f"the {elsewhere[0].name} {state} at ({x:.2f}, {y:.2f}, {z:.2f}), not resting on {_where(condition.goal)}"
    return Finding(False, f"{_tally(done, condition)} put there; {missed}." if done else f"{missed}.")


def _judge_went(condition: GoalCondition, truth: Truth, past: bool) -> Finding:
    """The body in the place, now or (when overtaken) at some time."""
    robots = [name for name in truth.bases if condition.robot in (None, name)]
    if condition.person is not None and robots:
        return _judge_near_person(condition, robots[0], truth, past)
    for name in robots:
        points = truth.path_since(name, condition.since_s) if past else truth.bases[name][None, :]
        there = next((on for p in points if (on := _region_at(condition.goal, p)) is not None), None)
        if there is not None:
            return Finding(True, f"{name} {'was' if past else 'is'} at {there}.")
    if not robots:
        return Finding(False, f"There is no robot {condition.robot}.")
    x, y, _ = truth.bases[robots[0]]
    return Finding(False, f"{robots[0]} is at ({x:.2f}, {y:.2f}), not at {_where(condition.goal)}.")


def _judge_near_person(condition: GoalCondition, robot: str, truth: Truth, past: bool) -> Finding:
    """The robot near a person, now or (when overtaken) at some time."""
    person = condition.person or ""
    p_WP = truth.persons.get(person)
    if p_WP is None:
        return Finding(False, f"there is no person {person} to go to.")
    points = truth.path_since(robot, condition.since_s) if past else [truth.bases[robot]]
    apart_m = min(_apart_m(p, p_WP) for p in points)
    return Finding(apart_m <= NEAR_PERSON_M, f"{robot} {'was' if past else 'is'} {apart_m:.1f} m from {person}.")


def _judge_answered(condition: GoalCondition, truth: Truth, past: bool) -> Finding:
    """The answer equal to the truth at the time when it was given."""
    if condition.classes == (PERSON,):
        people = ((name, p_W) for name, p_W in truth.persons.items() if condition.person in (None, name))
        there = [f"{name} is in {on}" for name, p_W in people if (on := _region_at(condition.source, p_W)) is not None]
        nothing = f"{condition.person or 'nobody'} is {'not ' if condition.person else ''}in {_where(condition.source)}"
    else:
        then_s = condition.answered_s
        rest = (
            (each, (each.last.p_WO if each.resting else None) if then_s is None else each.at(then_s))
            for each in _of_class(condition, truth)
        )
        there = [
            f"the {history.name} {'is' if then_s is None else 'was'} on {on}"
            for history, p_W in rest
            if p_W is not None and (on := _region_at(condition.source, p_W)) is not None
        ]
        nothing = f"there is no {_wanted(condition)}{_in(condition.source)}"
    fact = len(there) >= condition.needed
    said = {True: "yes", False: "no", None: "nothing"}[condition.answer]
    found = " and ".join(there) or nothing
    return Finding(condition.answer is fact, f"the answer was {said}, and {found}.")


def _judge_cleared(condition: GoalCondition, truth: Truth, past: bool) -> Finding:
    """All that rested in the source rests in the goal; without a goal, no longer in the source."""
    source, since_s = condition.source, condition.since_s
    there = [one for one in truth.histories if _was_in(one, source, since_s)]
    if not there:
        return Finding(True, f"nothing stood on {_where(source)}.")
    if not condition.goal:
        still = [one for one in there if _region_at(source, one.last.p_WO) is not None]
        left = [one for one in still if not (past and one.lifts_since(since_s))]
        told = f"{_names(left)} {'is' if len(left) == 1 else 'are'}" if left else "nothing is"
        return Finding(not left, f"{told} left on {_where(source)}.")
    missing = [one for one in there if _rest_in(one, condition, past) is None]
    if not missing:
        return Finding(True, f"{_names(there)} {'stands' if len(there) == 1 else 'stand'} on {_where(condition.goal)}.")
    return Finding(
        False, f"{_names(missing)} {'does' if len(missing) == 1 else 'do'} not stand on {_where(condition.goal)}."
    )


def _was_in(history: ObjectHistory, regions: Sequence[Region], since_s: float) -> bool:
    """Whether it rested in one of the regions then, or did since."""
    return any(_region_at(regions, p) is not None for p in (*history.rested_W(since_s), history.last.p_WO))


_JUDGES: Mapping[GoalKind, Callable[[GoalCondition, Truth, bool], Finding]] = {
    GoalKind.GRASPED: _judge_grasped,
    GoalKind.HANDED_OVER: _judge_handed_over,
    GoalKind.PLACED: _judge_placed,
    GoalKind.WENT: _judge_went,
    GoalKind.ANSWERED: _judge_answered,
    GoalKind.CLEARED: _judge_cleared,
}


def _of_class(condition: GoalCondition, truth: Truth) -> list[ObjectHistory]:
    return [history for history in truth.histories if history.class_name in condition.classes]


def _lift(history: ObjectHistory, condition: GoalCondition) -> Lift | None:
    """The first time that the condition's robot lifted it, from the source where one was named."""
    return next(
        (
            lift
            for lift in history.lifts_since(condition.since_s)
            if condition.robot in (None, lift.robot)
            and (not condition.source or _region_at(condition.source, lift.from_W) is not None)
        ),
        None,
    )


def _rest_in(history: ObjectHistory, condition: GoalCondition, past: bool) -> FloatArray | None:
    """Where in the goal it rests, or did after it was carried; None when nowhere."""
    rests = history.own_rests_W(condition.since_s) if past else [history.last.p_WO] if history.resting else []
    return next((p for p in rests if _region_at(condition.goal, p) is not None), None)


def _region_at(regions: Sequence[Region], p_W: FloatArray) -> str | None:
    """The name, with its article, of the first region that a point lies in."""
    return next((_the(region.name) for region in regions if region.contains(p_W)), None)


def _the(name: str) -> str:
    """A place's name with the article; a pose or a proper name has none."""
    return name if name.startswith(("(", "the ")) or name[:1].isupper() else f"the {name}"


def _apart_m(p: FloatArray, q: FloatArray) -> float:
    """Horizontal distance."""
    return float(np.hypot(p[0] - q[0], p[1] - q[1]))


def _names(histories: Iterable[ObjectHistory]) -> str:
    return " and ".join(f"the {history.name}" for history in histories)


def _were(histories: Sequence[ObjectHistory]) -> str:
    return "was" if len(histories) == 1 else "were"


def _wanted(condition: GoalCondition) -> str:
    return condition.wanted or " or ".join(condition.classes)


def _tally(done: Collection[ObjectHistory], condition: GoalCondition) -> str:
    """How much of what was asked for was done: "no beer was", "1 of 2 beer was", "2 of 3 beer were"."""
    if condition.needed == 1:
        return f"no {_wanted(condition)} was"
    return f"{len(done)} of {condition.needed} {_wanted(condition)} {'was' if len(done) == 1 else 'were'}"


def _from(condition: GoalCondition, lift: Lift) -> str:
    """The source that a lift was from."""
    region = _region_at(condition.source, lift.from_W)
    return "" if region is None else f" from {region}"


def _where(regions: Sequence[Region]) -> str:
    """Regions by name while they are few, else how many."""
    names = tuple(dict.fromkeys(_the(region.name) for region in regions))
    return " or ".join(names) if len(names) <= NAMED_REGIONS else f"any of {len(names)} places"


def _out_of(regions: Sequence[Region]) -> str:
    return f" from {_where(regions)}" if regions else ""


def _in(regions: Sequence[Region]) -> str:
    return f" on {_where(regions)}" if regions else ""


def _either(people: Mapping[str, FloatArray]) -> str:
    return " or ".join(people)
