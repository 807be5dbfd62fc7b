"""Judges of the tasks on people, by a simulation's truth."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from executive.words.goal import GoalCondition, Region
from plant.referee.findings import Finding, distance_m, judge_company, region_at, where
from plant.referee.object_history import TimedPath, Truth
from skills.inputs.errors import count_text
from skills.robot import FloatArray

NEAR_M: Final = 3.0
"""Greatest distance of the robot's body from the person whom it follows or guides."""
GREETS_WITHIN_M: Final = 2.5
"""Greatest distance of the robot's body from a person whom it greets."""
FACED_WITHIN_M: Final = 2.0
"""Greatest distance of the robot's body from the person to whom it has gone or speaks."""
FACES_RAD: Final = 1.05
"""Greatest bearing of that person from the robot's direction."""
LEAST_M: Final = 0.05
"""Distance of the hand from the body below which the hand gives no direction."""
LOST_M: Final = 5.0
LONGEST_LOSS_S: Final = 10.0
"""A robot that was farther than this from the person, for longer than this, has lost the person."""
_SAMPLE_S: Final = 0.1


def judge_followed(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges whether a robot is near the person, who stands at the goal, and never lost them for long."""

    def on_the_way(robot: TimedPath, person: TimedPath) -> Finding:
        gone_s = lost_s(robot, person, condition.from_s, truth.ended_s(condition))
        away = f", and was over {LOST_M:g} m away for {gone_s:.0f} s" if gone_s else ""
        return Finding(gone_s <= LONGEST_LOSS_S, away)

    return judge_company(_with_person(condition, truth), truth, NEAR_M, on_the_way)


def judge_guided(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges whether the person stands at the goal, and a robot near them."""
    return judge_company(_with_person(condition, truth), truth, NEAR_M)


def _with_person(condition: GoalCondition, truth: Truth) -> GoalCondition:
    """Condition of the person before a robot, or next to it, when the step began, where it names nobody."""
    at_s, people, robots = condition.from_s, truth.persons_of(condition), truth.robots_of(condition).values()
    away_m = [
        (distance_m(robot.position_at(at_s), path.position_at(at_s)), name)
        for name, path in people.items()
        for robot in robots
    ]
    nearest = min(away_m)[1] if away_m else None
    return replace(condition, person=next((name for name in faced_people(condition, truth, at_s)), nearest))


def faced_people(condition: GoalCondition, truth: Truth, time_s: float) -> Iterator[str]:
    """Yields the people near and ahead of a robot at a time, first whom it faces most.

    The robot's stowed hand is ahead of its body.
    """
    found = list[tuple[float, float, str]]()
    for robot, path in truth.robots_of(condition).items():
        p_WB, hand = path.position_at(time_s), truth.hands.get(robot)
        ahead_W = None if hand is None or not len(hand.positions.points) else hand.positions.position_at(time_s) - p_WB
        for name, walked in truth.persons_of(condition).items():
            to_W = walked.position_at(time_s) - p_WB
            away_m, bearing_rad = float(np.hypot(*to_W[:2])), _bearing_rad(ahead_W, to_W)
            if away_m <= FACED_WITHIN_M and bearing_rad <= FACES_RAD:
                found.append((bearing_rad, away_m, name))
    yield from (name for *_, name in sorted(found))


def _bearing_rad(ahead_W: FloatArray | None, to_W: FloatArray) -> float:
    """Angle between two directions in the plane; 0 for a robot without an arm."""
    if ahead_W is None or float(np.hypot(*ahead_W[:2])) < LEAST_M:
        return 0.0
    turned = math.atan2(to_W[1], to_W[0]) - math.atan2(ahead_W[1], ahead_W[0])
    return abs(math.remainder(turned, math.tau))


def lost_s(robot: TimedPath, person: TimedPath, from_s: float, until_s: float) -> float:
    """Longest time (s) for which a robot was farther than `LOST_M` from a person."""
    times = np.arange(max(from_s, person.points[0, 3]), until_s, _SAMPLE_S)
    far = np.hypot(*(robot.positions_at(times) - person.positions_at(times))[:, :2].T) > LOST_M
    longest = run = 0
    for each in far:
        run = run + 1 if each else 0
        longest = max(longest, run)
    return _SAMPLE_S * longest


def judge_greeted(condition: GoalCondition, truth: Truth) -> Finding:
    """Judges whether the robot spoke near each person who stayed in the region, once per person.

    A person who came or left during the step may be greeted, too, while they stand there.
    """
    from scipy.optimize import linear_sum_assignment  # takes half a second, and few missions have greetings

    from_s, until_s, goal = condition.from_s, truth.ended_s(condition), condition.goal
    robots, among = truth.robots_of(condition).values(), truth.persons_of(condition)
    inside = {
        name: [not goal or region_at(goal, p_W) is not None for p_W in path.positions_between(from_s, until_s)]
        for name, path in among.items()
    }
    stayed = {name for name, ins in inside.items() if all(ins)}
    present = [name for name in among if any(inside[name])]
    times_s, said = condition.spoken_s, len(condition.spoken_s)
    heard = [[_spoke_near(robots, among[name], goal, t_s) for t_s in times_s] for name in present]
    near = np.array(heard, bool).reshape(len(present), said)
    first = np.array([2 if name in stayed else 1 for name in present]).reshape(-1, 1)
    pairs = zip(*linear_sum_assignment(first * near, maximize=True), strict=True)
    greeted = {present[row] for row, column in pairs if near[row, column]}
    stood = [name for name in present if name in stayed | greeted]
    verb = "stayed" if present and not stood else "stood"
    there = f"{' and '.join(stood) or 'nobody'} {verb} in {where(goal)}"
    was = f"{'was' if len(stood) == 1 else 'were'}{' not' if stood and not greeted else ''} greeted"
    some = f"{len(greeted)} of {len(stood)} " if 0 < len(greeted) < len(stood) else ""
    extra = f"; the robot spoke {count_text(said, 'time')}" if said != len(greeted) else ""
    right = stayed <= greeted and said <= max(1, len(present))
    return Finding(right, f"{there}{f' and {some}{was}' if stood else ''}{extra}.")


def _spoke_near(robots: Iterable[TimedPath], person: TimedPath, goal: Sequence[Region], time_s: float) -> bool:
    """Returns whether a robot was near a person, who stood in a region of the goal, at a time."""
    p_W = person.position_at(time_s)
    apart = (robot.position_at(time_s) - p_W for robot in robots)
    there = not goal or region_at(goal, p_W) is not None
    return there and any(float(np.hypot(*off[:2])) <= GREETS_WITHIN_M for off in apart)
