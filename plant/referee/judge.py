"""Judges promises against the recorded truth. Pure functions: the same record gives the same verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from plant.referee.promise import Promise, PromiseKind, Region, Verdict
from plant.referee.story import ObjectStory
from skills.robot import FloatArray

REACH_OF_PERSON_M = 1.0
OFFER_HEIGHT_M = 0.4
_STATE_KINDS = (PromiseKind.WENT, PromiseKind.PLACED, PromiseKind.HANDED_OVER)


@dataclass(frozen=True)
class Truth:
    """The record: stories of the objects, where robots and people are now (m, world), paths, past offers."""

    stories: tuple[ObjectStory, ...]
    bases: Mapping[str, FloatArray]
    paths: Mapping[str, FloatArray]
    persons: Mapping[str, FloatArray]
    offers: frozenset[tuple[str, str]]


@dataclass(frozen=True)
class Finding:
    """Whether one promise holds, and one plain sentence."""

    holds: bool
    sentence: str


def offered(story: ObjectStory, p_WP: FloatArray) -> bool:
    """Whether an object is held out, high enough and near enough to a person standing at p_WP."""
    if not story.held_out or story.last.p_WO[2] < OFFER_HEIGHT_M:
        return False
    return _apart_m(story.last.p_WO, p_WP) <= REACH_OF_PERSON_M


def judge(promises: Sequence[Promise], truth: Truth, *, collisions: int, drops: int) -> Verdict:
    """The verdict on all promises: the last is judged by the present state, earlier ones by the record."""
    findings = [_judge_one(promises, i, truth) for i in range(len(promises))]
    why = " ".join(finding.sentence for finding in findings) or "Nothing was promised."
    return Verdict(all(finding.holds for finding in findings), why, collisions, drops)


def _judge_one(promises: Sequence[Promise], i: int, truth: Truth) -> Finding:
    """One promise; states promised before another state of the same kind may have passed."""
    past = any(_overtakes(later, promises[i]) for later in promises[i + 1 :])
    finding = _JUDGES[promises[i].kind](promises[i], truth, past)
    return Finding(finding.holds, finding.sentence[0].upper() + finding.sentence[1:])


def _overtakes(later: Promise, promise: Promise) -> bool:
    """Whether keeping the later promise may undo the state of the earlier."""
    if promise.kind is PromiseKind.WENT:
        return True
    return later.kind in (*_STATE_KINDS, PromiseKind.GRASPED) and bool(set(later.classes) & set(promise.classes))


def _judge_grasped(promise: Promise, truth: Truth, past: bool) -> Finding:
    """Lifted from the source at some time."""
    done = [story for story in _of_class(promise, truth) if _lifted_from(story, promise)]
    if len(done) >= promise.needed:
        return Finding(True, f"{_names(done)} was lifted from {_where(promise.source)}.")
    lifted = [story for story in truth.stories if story.lifts]
    other = f"; {_names(lifted)} was" if lifted else ""
    wanted = _wanted(promise)
    return Finding(False, f"{len(done)} of {promise.needed} {wanted} was lifted from {_where(promise.source)}{other}.")


def _judge_handed_over(promise: Promise, truth: Truth, past: bool) -> Finding:
    """Held out near the person."""
    people = {name: p for name, p in truth.persons.items() if promise.person in (None, name)}
    if not people:
        return Finding(False, f"There is no person {promise.person or ''} to hand anything to.".replace("  ", " "))
    things = [story for story in _of_class(promise, truth) if _lifted_from(story, promise)]
    if past:
        done = [story for story in things if any((story.name, person) in truth.offers for person in people)]
    else:
        done = [story for story in things if any(offered(story, p) for p in people.values())]
    if len(done) >= promise.needed:
        return Finding(True, f"{_names(done)} {'was' if past else 'is'} held out to {_either(people)}.")
    return Finding(False, _why_not_handed(promise, things, people))


def _why_not_handed(promise: Promise, things: Sequence[ObjectStory], people: Mapping[str, FloatArray]) -> str:
    """The sentence on a hand-over that failed: of the object in a gripper, or else of what was wanted."""
    held = [story for story in things if story.held_by is not None]
    if not held:
        return f"No {_wanted(promise)} from {_where(promise.source)} is in a gripper."
    story = held[0]
    if not story.held_out:
        return f"The {story.name} is in the gripper but not held out free."
    apart = min(_apart_m(story.last.p_WO, p) for p in people.values())
    return f"The {story.name} is held {story.last.p_WO[2]:.2f} m high, {apart:.2f} m from {_either(people)}."


def _judge_placed(promise: Promise, truth: Truth, past: bool) -> Finding:
    """Resting in the goal, let go."""
    things = [story for story in _of_class(promise, truth) if _lifted_from(story, promise)]
    done = [story for story in things if _rests_in(story, promise, past)]
    if len(done) >= promise.needed:
        return Finding(True, f"{_names(done)} {'was put' if past else 'rests'} on {_where(promise.goal)}.")
    if not things:
        return Finding(False, f"No {_wanted(promise)} was brought from {_where(promise.source)}.")
    x, y, z = things[0].last.p_WO
    state = "is in a gripper" if things[0].held_by else "is" if things[0].resting else "moves"
    where = f"at ({x:.2f}, {y:.2f}, {z:.2f})"
    return Finding(False, f"The {things[0].name} {state} {where}, not resting on {_where(promise.goal)}.")


def _judge_went(promise: Promise, truth: Truth, past: bool) -> Finding:
    """The body in the place, now or (when more was promised after) at some time."""
    robots = [name for name in truth.bases if promise.robot in (None, name)]
    for name in robots:
        points = truth.paths[name] if past else truth.bases[name][None, :]
        if any(region.contains(p) for p in points for region in promise.goal):
            return Finding(True, f"{name} {'was' if past else 'is'} in {_where(promise.goal)}.")
    if not robots:
        return Finding(False, f"There is no robot {promise.robot}.")
    x, y, _ = truth.bases[robots[0]]
    return Finding(False, f"{robots[0]} is at ({x:.2f}, {y:.2f}), not in {_where(promise.goal)}.")


def _judge_answered(promise: Promise, truth: Truth, past: bool) -> Finding:
    """The answer equal to the truth."""
    there = [s for s in _of_class(promise, truth) if s.resting and _in_any(promise.source, s.last.p_WO)]
    fact = len(there) >= promise.needed
    said = {True: "yes", False: "no", None: "nothing"}[promise.answer]
    found = f"{_names(there)} is" if there else f"there is no {_wanted(promise)}"
    return Finding(promise.answer is fact, f"The answer was {said}, and {found} in {_where(promise.source)}.")


_JUDGES: Mapping[PromiseKind, Callable[[Promise, Truth, bool], Finding]] = {
    PromiseKind.GRASPED: _judge_grasped,
    PromiseKind.HANDED_OVER: _judge_handed_over,
    PromiseKind.PLACED: _judge_placed,
    PromiseKind.WENT: _judge_went,
    PromiseKind.ANSWERED: _judge_answered,
}


def _of_class(promise: Promise, truth: Truth) -> list[ObjectStory]:
    return [story for story in truth.stories if story.class_name in promise.classes]


def _lifted_from(story: ObjectStory, promise: Promise) -> bool:
    """Whether the promise's robot lifted it, and from the source where one was named."""
    return any(
        promise.robot in (None, lift.robot) and (not promise.source or _in_any(promise.source, lift.from_W))
        for lift in story.lifts
    )


def _rests_in(story: ObjectStory, promise: Promise, past: bool) -> bool:
    """Whether it rests in the goal, or did after it was carried."""
    if past:
        return any(_in_any(promise.goal, p) for p in story.rests_W[1:])
    return story.resting and _in_any(promise.goal, story.last.p_WO)


def _in_any(regions: Sequence[Region], p_W: FloatArray) -> bool:
    return any(region.contains(p_W) for region in regions)


def _apart_m(p: FloatArray, q: FloatArray) -> float:
    """Horizontal distance."""
    return float(np.hypot(p[0] - q[0], p[1] - q[1]))


def _names(stories: Sequence[ObjectStory]) -> str:
    return " and ".join(f"the {story.name}" for story in stories)


def _wanted(promise: Promise) -> str:
    return " or ".join(promise.classes)


def _where(regions: Sequence[Region]) -> str:
    return " or ".join(dict.fromkeys(region.name for region in regions)) or "anywhere"


def _either(people: Mapping[str, FloatArray]) -> str:
    return " or ".join(people)
