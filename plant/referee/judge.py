"""Judges goal conditions by the recorded truth. Pure functions: the same record gives the same verdict."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

from executive.words.goal import GoalCondition, GoalKind, RefereeReport, Region, When
from executive.words.task import task_named
from plant.referee.entities import Collision
from plant.referee.findings import (
    Finding,
    distance_m,
    has_relations,
    is_past,
    judge_answered,
    judge_company,
    judge_pictured,
    of_class,
    region_at,
    said,
    the,
    wanted,
    where,
)
from plant.referee.object_history import ON_TRAY_GAP_S, SETTLE_S, Lift, ObjectHistory, TimedPath, Truth
from skills.inputs.errors import definite, listing
from skills.inputs.plugins import PluginDefect, call_plugin
from skills.robot import FloatArray

DOOR_LOOK_S = 2.0
"""Longest time between the robot's look at a door and its answer."""
_ABOUT_OBJECTS = frozenset(
    (GoalKind.GRASPED, GoalKind.HANDED_OVER, GoalKind.PLACED, GoalKind.ANSWERED, GoalKind.CLEARED, GoalKind.PICTURED)
)


def judge(conditions: Sequence[GoalCondition], truth: Truth, *, collisions: Sequence[Collision]) -> RefereeReport:
    """Judges all conditions at the times at which they must hold, and counts collisions and drops.

    The robot is not blamed when the simulation has lost an object of each condition that does not hold: success is then
    None.
    """
    findings = [_JUDGES[condition.kind](condition, truth) for condition in conditions]
    since_s = min((condition.since_s for condition in conditions), default=0.0)
    lost = [one for one in truth.histories if one.lost_s is not None and one.lost_s >= since_s]
    failed = [condition for condition, finding in zip(conditions, findings, strict=True) if not finding.holds]
    excused = all(_is_about(condition, lost, truth) for condition in failed)
    success = not failed or (None if excused else False)
    findings += [Finding(True, f"the simulation lost {definite(one.name)}.") for one in lost]
    collisions = [each for each in collisions if each.time_s >= since_s]
    own = [each for each in collisions if not each.walked_in]
    bins = [each for one in conditions if one.kind is GoalKind.PLACED for each in one.goal if each.is_bin]
    fell = [(one, when_s) for one in truth.histories for when_s in one.dropped_s if when_s >= since_s]
    drops = sum(region_at(bins, next(iter(one.own_rests_W(when_s)), one.last.p_WO)) is None for one, when_s in fell)
    return RefereeReport(
        success if conditions else None,
        " ".join(dict.fromkeys(each.sentence[0].upper() + each.sentence[1:] for each in findings)),
        collisions=len(own),
        drops=drops,
        people_hit=sum(each.person is not None for each in own),
        hit_by_people=len(collisions) - len(own),
        robots_hit=sum(each.other_robot is not None for each in own),
    )


def _is_about(condition: GoalCondition, objects: Sequence[ObjectHistory], truth: Truth) -> bool:
    """Returns whether a condition is about one of some objects."""
    return condition.kind in _ABOUT_OBJECTS and any(one in objects for one in of_class(condition, truth))


def _taken_again(history: ObjectHistory, condition: GoalCondition, truth: Truth) -> bool:
    """Returns whether a later step of the same mission lifted an object again."""
    ended_s = truth.ended_s(condition)
    return any(
        lift.time_s > ended_s and from_s <= lift.time_s <= until_s + SETTLE_S
        for lift in history.lifts
        for from_s, until_s in condition.taken_s
    )


def _judge_grasped(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges whether the objects were lifted from the source, and held at the required times."""
    until_s = truth.ended_s(condition)
    from_s = condition.from_s if condition.when is When.SOME_TIME else condition.since_s
    candidates = ((one, _lift(one, condition, from_s, until_s)) for one in of_class(condition, truth))
    lifted = {
        one: lift
        for one, lift in candidates
        if lift is not None and has_relations(one, lift.from_W, lift.time_s, condition, truth)
    }
    done = {one: lift for one, lift in lifted.items() if _is_held(one, condition, until_s)}
    if len(done) >= condition.needed:
        froms = (f"{definite(history.name)} was lifted{_from(condition, lift)}" for history, lift in done.items())
        return Finding(True, f"{' and '.join(froms)}.")
    if len(lifted) >= condition.needed:
        lost = [history for history in lifted if history not in done]
        when = "to the end of the mission" if condition.when is When.END_OF_MISSION else "to the end of the step"
        return Finding(False, f"{_names(lost)} {_were(lost)} lifted, but not held {when}.")
    moved = [history for history in truth.histories if history.lifts_since(condition.since_s)]
    other = [history for history in moved if history not in done]
    was = f"; {_names(other)} {_were(other)}" if other else ""
    return Finding(False, f"{_tally(done, condition)} lifted{_out_of(condition.source)}{was}.")


def _is_held(history: ObjectHistory, condition: GoalCondition, until_s: float) -> bool:
    """Returns whether a robot holds an object at the required times."""

    def own(robot: str | None) -> bool:
        return robot is not None and condition.robot in (None, robot)

    if condition.when is When.SOME_TIME:
        return True
    if condition.when is When.ALWAYS:
        return own(history.holder_during(condition.from_s, until_s))
    if condition.ended_s is not None and not own(history.holder_at(until_s)):
        return False
    return condition.when is not When.END_OF_MISSION or own(history.holder)


def _judge_handed_over(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges whether the objects rest on the person's tray, released by the gripper."""
    people = truth.persons_of(condition)
    if not people:
        return Finding(False, f"There is no person {condition.person or ''} to hand anything to.".replace("  ", " "))
    until_s = truth.ended_s(condition)
    objects = [one for one in of_class(condition, truth) if _lift(one, condition, condition.since_s, until_s)]
    given = [one for one in objects if _was_given(one, people, condition, truth)]
    if is_past(condition):
        done = given
    else:
        there = [one for one in objects if one.on_tray_of in people and not one.placed_by_person]
        done = [one for one in given if one in there or _taken_again(one, condition, truth)]
        done = there if condition.ended_s is None else done
    if len(done) >= condition.needed:
        past = any(one.on_tray_of not in people for one in done)
        verb = _were(done) + " put" if past else "rests" if len(done) == 1 else "rest"
        return Finding(True, f"{_names(done)} {verb} on {_either(people)}'s tray.")
    now_W = {name: path.position_at(truth.now_s) for name, path in people.items()}
    return Finding(False, _why_not_handed(condition, objects, now_W))


def _was_given(history: ObjectHistory, people: Collection[str], condition: GoalCondition, truth: Truth) -> bool:
    """Returns whether an object came to rest on a person's tray, and was there at the required times."""
    until_s = truth.ended_s(condition)
    for person in people:
        for first_s, last_s in truth.given.get((history.name, person), ()):
            in_time = condition.from_s <= first_s <= until_s + SETTLE_S
            stayed = condition.when is When.SOME_TIME or last_s >= until_s - ON_TRAY_GAP_S
            if in_time and stayed and _lift(history, condition, condition.since_s, first_s) is not None:
                return True
    return False


def _why_not_handed(
    condition: GoalCondition, objects: Sequence[ObjectHistory], people: Mapping[str, FloatArray]
) -> str:
    """Sentence that says why a hand-over failed: where the object is, or which object was wanted."""
    if not objects:
        return f"No {wanted(condition)} was brought{_out_of(condition.source)}."
    history = next((one for one in objects if one.holder is not None), objects[0])
    apart = min(distance_m(history.last.p_WO, p) for p in people.values())
    there = f"{history.last.p_WO[2]:.2f} m high, {apart:.2f} m from {_either(people)}"
    if history.holder is not None:
        return f"{definite(history.name)} is still in the gripper, {there}."
    if history.on_tray_of in people:
        return f"{definite(history.name)} was not yet on the tray of {history.on_tray_of} at the end of its step."
    return f"{definite(history.name)} {'rests' if history.resting else 'moves'} {there}, not on the tray."


def _judge_placed(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges whether the objects rest in the goal, released by the gripper."""
    until_s = truth.ended_s(condition)
    objects = [one for one in of_class(condition, truth) if _lift(one, condition, condition.since_s, until_s)]
    put = {one: p_W for one in objects if (p_W := _put_in(one, condition, truth)) is not None}
    done = {one: p_W for one, p_W in put.items() if has_relations(one, p_W, until_s, condition, truth)}
    if len(done) >= condition.needed:
        verb = "was put" if is_past(condition) else "rests"
        rests = ((one, [each for each in condition.goal if each.contains(p)]) for one, p in done.items())
        ons = (f"{definite(one.name)} {verb} {_on(regions[:1])}" for one, regions in rests)
        return Finding(True, f"{' and '.join(ons)}.")
    if not objects:
        return Finding(False, f"No {wanted(condition)} was brought{_out_of(condition.source)}.")
    elsewhere = [history for history in objects if history not in done]
    if not elsewhere:
        return Finding(False, f"{_tally(done, condition)} put {_on(condition.goal)}.")
    missed = _where_it_is(elsewhere[0], condition, truth)
    if elsewhere[0] in put:
        meant = " and ".join(map(str, condition.relations))
        missed = f"{definite(elsewhere[0].name)} was put {_on(condition.goal)}, but not {meant}"
    return Finding(False, f"{_tally(done, condition)} put there; {missed}." if done else f"{missed}.")


def _on(goal: Sequence[Region]) -> str:
    """Phrase for objects at rest in a goal: "on the desk", "in the bin"."""
    return f"{'in' if any(region.is_bin for region in goal) else 'on'} {where(goal)}"


def _where_it_is(history: ObjectHistory, condition: GoalCondition, truth: Truth) -> str:
    """Clause that says where an object is that did not rest in the goal in time."""
    now = _rest_in(history, condition.goal)
    if now is not None and not history.placed_by_person:
        return f"{definite(history.name)} was not {_on(condition.goal)} at the end of its step"
    x, y, z = history.last.p_WO
    state = "is in a gripper" if history.holder else "is" if history.resting else "moves"
    return f"{definite(history.name)} {state} at ({x:.2f}, {y:.2f}, {z:.2f}), not resting {_on(condition.goal)}"


def _put_in(history: ObjectHistory, condition: GoalCondition, truth: Truth) -> FloatArray | None:
    """Position in the goal where a robot put an object; None when the object was not there at the required times."""
    until_s = truth.ended_s(condition)
    if condition.when is When.SOME_TIME:
        rests = history.own_rests_W(condition.from_s, until_s + SETTLE_S)
        return next((p_W for p_W in rests if region_at(condition.goal, p_W) is not None), None)
    now_W = None if history.placed_by_person else _rest_in(history, condition.goal)
    if condition.ended_s is None:
        return now_W
    put = history.rest_at(until_s)
    if put is None or put[0] < condition.from_s or region_at(condition.goal, put[1]) is None:
        return None
    if condition.when is not When.END_OF_MISSION or now_W is not None or _taken_again(history, condition, truth):
        return put[1]
    return None


def _judge_went(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges whether the robot's body was in the goal at the required times."""
    robots = truth.robots_of(condition)
    if not robots:
        return Finding(False, f"There is no robot {condition.robot}.")
    if condition.person is not None:
        return judge_company(condition, truth)
    findings = [_judge_at(condition, name, truth) for name in robots]
    return next((finding for finding in findings if finding.holds), findings[0])


def _points(condition: GoalCondition, path: TimedPath, truth: Truth) -> Sequence[FloatArray]:
    """Positions on a path at the required times, sorted by time."""
    until_s = truth.ended_s(condition)
    if condition.when in (When.SOME_TIME, When.ALWAYS):
        return list(path.positions_between(condition.from_s, until_s))
    if condition.when is When.END_OF_MISSION:
        return [path.position_at(until_s), path.position_at(truth.now_s)]
    return [path.position_at(until_s)]


def _judge_at(condition: GoalCondition, robot: str, truth: Truth) -> Finding:
    verb = "was" if is_past(condition) else "is"
    points = _points(condition, truth.robots[robot], truth)
    inside = [region_at(condition.goal, p_W) for p_W in points]
    if (any if condition.when is When.SOME_TIME else all)(on is not None for on in inside):
        return Finding(True, f"{robot} {verb} at {next(filter(None, inside))}.")
    outside = next(p_W for p_W, on in zip(reversed(points), reversed(inside), strict=True) if on is None)
    x, y, _ = outside
    return Finding(False, f"{robot} {verb} at ({x:.2f}, {y:.2f}), not at {where(condition.goal)}.")


def _judge_door(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges an answer by the state of the door while the robot looked; for a moving door, both answers are right."""
    was = _door_state(condition, truth, truth.now_s if condition.answered_s is None else condition.answered_s)
    is_open = condition.answer != condition.negated
    right = condition.answer is not None and was in ("moving", "open" if is_open else "closed")
    return Finding(right, f"{said(condition)}, and {the(condition.source[0].name)} was {was}.")


def _judge_opened(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges whether a door was open at the end of the step."""
    was = _door_state(condition, truth, truth.ended_s(condition))
    return Finding(was != "closed", f"{the(condition.source[0].name)} was {was}.")


def _door_state(condition: GoalCondition, truth: Truth, then_s: float) -> str:
    """State of a door during a robot's look before `then_s`: open, closed or moving."""
    (doorway,) = condition.source
    changes = next((each for (x, y), each in truth.doors.items() if doorway.contains((x, y, 0.0))), ())
    before = [share for begun_s, share in changes if begun_s <= then_s - DOOR_LOOK_S]
    shares = {*before[-1:], *(share for begun_s, share in changes if then_s - DOOR_LOOK_S < begun_s <= then_s)}
    return {frozenset(): "open", frozenset({0.0}): "open", frozenset({1.0}): "closed"}.get(frozenset(shares), "moving")


def _judge_cleared(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges whether all objects of the source rest in the goal or, without a goal, have left the source."""
    source = condition.source
    there = [one for one in truth.histories if _was_in(one, condition, truth)]
    if not there:
        return Finding(True, f"nothing stood on {where(source)}.")
    if not condition.goal:
        left = [one for one in there if _is_left(one, condition, truth)]
        rest = f"{_names(left)} {'is' if len(left) == 1 else 'are'}" if left else "nothing is"
        return Finding(not left, f"{rest} left on {where(source)}.")
    missing = [one for one in there if _put_in(one, condition, truth) is None]
    if not missing:
        return Finding(True, f"{_names(there)} {'stands' if len(there) == 1 else 'stand'} on {where(condition.goal)}.")
    do = "does" if len(missing) == 1 else "do"
    return Finding(False, f"{_names(missing)} {do} not stand on {where(condition.goal)}.")


def _was_in(history: ObjectHistory, condition: GoalCondition, truth: Truth) -> bool:
    """Returns whether an object rested in the source when the step began, or came to rest there during it."""
    from_s, until_s = condition.from_s, truth.ended_s(condition)
    came = zip(history.rested_s, history.rests_W, strict=True)
    began_W = history.place_at(from_s)
    places = [*(p_W for when_s, p_W in came if from_s < when_s <= until_s), *(() if began_W is None else (began_W,))]
    return any(region_at(condition.source, p_W) is not None for p_W in places)


def _is_left(history: ObjectHistory, condition: GoalCondition, truth: Truth) -> bool:
    """Returns whether an object was in the source at the end of the step, or is there now and was not put back."""
    until_s = truth.ended_s(condition)
    put = history.rest_at(until_s)
    then_W = put[1] if put is not None else history.place_at(until_s)
    now = region_at(condition.source, history.last.p_WO) is not None
    if condition.ended_s is None:
        return now
    if then_W is not None and region_at(condition.source, then_W) is not None:
        return True
    back = history.placed_by_person or _taken_again(history, condition, truth)
    return condition.when is When.END_OF_MISSION and now and not back


def _judge_own(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges a condition by the page of its task; one that it cannot judge does not hold."""
    task = task_named(condition.task)
    try:
        holds, sentence = call_plugin(lambda: task.judge(condition, truth))
        if holds not in (True, False) or not (isinstance(sentence, str) and sentence):
            raise TypeError("it returns no pair of True or False and a sentence")
    except (PluginDefect, TypeError, ValueError) as defect:
        return Finding(False, f"{task.named} cannot judge it ({defect}).")
    return Finding(bool(holds), sentence)


_JUDGES: Mapping[GoalKind, Callable[[GoalCondition, Truth], Finding]] = {
    GoalKind.GRASPED: _judge_grasped,
    GoalKind.HANDED_OVER: _judge_handed_over,
    GoalKind.PLACED: _judge_placed,
    GoalKind.WENT: _judge_went,
    GoalKind.ANSWERED: judge_answered,
    GoalKind.DOOR_OPEN: _judge_door,
    GoalKind.DOOR_OPENED: _judge_opened,
    GoalKind.CLEARED: _judge_cleared,
    GoalKind.MET: judge_company,
    GoalKind.PICTURED: judge_pictured,
    GoalKind.OWN: _judge_own,
}


def _lift(history: ObjectHistory, condition: GoalCondition, from_s: float, until_s: float) -> Lift | None:
    """First lift of an object by the condition's robot in an interval; from the source, if the condition has one."""
    return next(
        (
            lift
            for lift in history.lifts_since(from_s)
            if lift.time_s <= until_s + SETTLE_S
            and condition.robot in (None, lift.robot)
            and (not condition.source or region_at(condition.source, lift.from_W) is not None)
        ),
        None,
    )


def _rest_in(history: ObjectHistory, goal: Sequence[Region]) -> FloatArray | None:
    """Position of an object at rest in the goal now; None when it does not rest there."""
    return history.last.p_WO if history.resting and region_at(goal, history.last.p_WO) is not None else None


def _names(histories: Iterable[ObjectHistory]) -> str:
    return listing(definite(history.name) for history in histories)


def _were(histories: Sequence[ObjectHistory]) -> str:
    return "was" if len(histories) == 1 else "were"


def _tally(done: Collection[ObjectHistory], condition: GoalCondition) -> str:
    """Counts the objects that fulfil a condition: "no beer was", "1 of 2 beer was", "2 of 3 beer were"."""
    if condition.needed == 1:
        return f"no {wanted(condition)} was"
    return f"{len(done)} of {condition.needed} {wanted(condition)} {'was' if len(done) == 1 else 'were'}"


def _from(condition: GoalCondition, lift: Lift) -> str:
    """Phrase that names the source of a lift."""
    region = region_at(condition.source, lift.from_W)
    return "" if region is None else f" from {region}"


def _out_of(regions: Sequence[Region]) -> str:
    return f" from {where(regions)}" if regions else ""


def _either(people: Iterable[str]) -> str:
    return " or ".join(people)
