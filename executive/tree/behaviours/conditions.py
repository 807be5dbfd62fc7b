"""Conditions that must hold while nodes run, and what they make of readings that are too old.

A condition answers with None when it holds, `Failed` when it does not, and `Waiting` when that cannot be said yet.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from executive.mission.file.model import StaleData
from executive.tree.behaviours.context import RunContext
from skills.api import Cause, Failed
from skills.robot import Pose2D


@dataclass(frozen=True)
class Waiting:
    """Nothing can be said yet; one plain sentence on what is waited for. The nodes below stand still meanwhile."""

    message: str


Verdict = Failed | Waiting | None


class Condition(Protocol):
    """Something that must hold while a subtree runs."""

    def begin(self, context: RunContext) -> None:
        """The subtree starts anew. Nothing is remembered unless a condition says so."""
        return

    def violated(self, context: RunContext) -> Verdict:
        """What speaks against going on, None when nothing does. Called before each tick of the subtree."""


@dataclass(frozen=True)
class Freshness:
    """How old (s) a reading may be, what happens when it is older, and how long WAIT waits at most (s)."""

    max_age_s: float = 1.0
    policy: StaleData = StaleData.WAIT
    patience_s: float = 5.0


class Fresh:
    """A condition that is judged only by readings that are fresh enough.

    Reading fresh, or policy ACCEPT: as the condition. Too old: Waiting (WAIT) until the patience is over, then, or at
    once (FAIL), Failed with PRECONDITION.
    """

    def __init__(
        self, condition: Condition, what: str, stamp_s: Callable[[RunContext], float], freshness: Freshness
    ) -> None:
        """`what` names the reading in a sentence; `stamp_s` gives the time at which it was taken."""
        self._condition, self._what, self._stamp_s, self._freshness = condition, what, stamp_s, freshness
        self._stale_since_s: float | None = None

    def begin(self, context: RunContext) -> None:
        """Forget how long was waited."""
        self._stale_since_s = None
        self._condition.begin(context)

    def violated(self, context: RunContext) -> Verdict:
        """Judge the age first, then the condition."""
        now_s, fresh = context.clock.now(), self._freshness
        age_s = now_s - self._stamp_s(context)
        if age_s <= fresh.max_age_s or fresh.policy is StaleData.ACCEPT:
            self._stale_since_s = None
            return self._condition.violated(context)
        self._stale_since_s = now_s if self._stale_since_s is None else self._stale_since_s
        old = f"the last reading of {self._what} is {age_s:.1f} s old"
        said = old if math.isfinite(age_s) else f"there is no reading of {self._what} yet"
        if fresh.policy is StaleData.WAIT and now_s - self._stale_since_s <= fresh.patience_s:
            return Waiting(f"waits for {self._what}: {said}")
        return Failed(Cause.PRECONDITION, said)


class Holding:
    """The gripper holds something. A loss shorter than `patience_s` on the robot's clock is let pass.

    PRECONDITION when nothing is held at the start, EXECUTION when it is lost on the way.
    """

    def __init__(self, thing: str, patience_s: float = 0.5) -> None:
        self._thing, self._patience_s = thing, patience_s
        self._last_held_s: float | None = None

    def begin(self, context: RunContext) -> None:
        """Forget what was held before."""
        self._last_held_s = None

    def violated(self, context: RunContext) -> Verdict:
        """A failure when the gripper has been empty for longer than the patience."""
        now = context.clock.now()
        if context.robot.gripper().holding:
            self._last_held_s = now
            return None
        if self._last_held_s is None:
            return Failed(Cause.PRECONDITION, f"there is no {self._thing} in the gripper")
        if now - self._last_held_s <= self._patience_s:
            return None
        return Failed(Cause.EXECUTION, f"the {self._thing} was lost on the way")


def holding(thing: str, freshness: Freshness = Freshness()) -> Condition:
    """The gripper holds something, as its own fresh readings say."""
    return Fresh(Holding(thing), "the gripper", lambda context: context.robot.gripper().stamp_s, freshness)


class Localised:
    """The robot knows where it is. Not knowing for up to `patience_s` (robot's clock) is let pass; PRECONDITION."""

    def __init__(self, patience_s: float = 2.0) -> None:
        self._patience_s = patience_s
        self._lost_since_s: float | None = None

    def begin(self, context: RunContext) -> None:
        """Forget for how long the place was unknown."""
        self._lost_since_s = None

    def violated(self, context: RunContext) -> Verdict:
        """A failure when the place has been unknown for longer than the patience."""
        if context.localiser.estimate().localised:
            self._lost_since_s = None
            return None
        now = context.clock.now()
        self._lost_since_s = now if self._lost_since_s is None else self._lost_since_s
        if now - self._lost_since_s <= self._patience_s:
            return None
        return Failed(Cause.PRECONDITION, "the robot does not know where it is")


class BatteryAbove(Condition):
    """The state of charge (0 to 1) is at least `least`; PRECONDITION when not."""

    def __init__(self, least: float) -> None:
        self._least = least

    def violated(self, context: RunContext) -> Verdict:
        """A failure when the charge is below."""
        charge = context.robot.battery().charge
        if charge >= self._least:
            return None
        return Failed(Cause.PRECONDITION, f"the battery is at {charge:.0%}, less than {self._least:.0%}")


class StopReleased(Condition):
    """No stop button is pressed. The mission stands still as long as one is."""

    def violated(self, context: RunContext) -> Verdict:
        """Waiting while it is pressed."""
        pressed = context.stop_pressed()
        return None if pressed is None else Waiting(pressed)


class LeaseHeld(Condition):
    """Nobody else may move the robot. The mission stands still as long as somebody does."""

    def violated(self, context: RunContext) -> Verdict:
        """Waiting while another holds the lease."""
        held = context.robot.lease_holder()
        if held is None or held.holder == context.lease.holder:
            return None
        return Waiting(f"{held.holder} holds the lease of {context.robot.name}")


class BatteryReserve(Condition):
    """The charge (0 to 1) is at least `low`, and enough for the way to the dock; PRECONDITION when not.

    The way is taken as twice the distance as the crow flies, at `per_m` of charge for each metre.
    """

    def __init__(self, low: float, dock: Pose2D, per_m: float = 0.0008) -> None:
        self._low, self._dock, self._per_m = low, dock, per_m

    def violated(self, context: RunContext) -> Verdict:
        """A failure when the charge is below."""
        battery, here = context.robot.battery(), context.pose()
        way_m = 2.0 * math.hypot(here.x_m - self._dock.x_m, here.y_m - self._dock.y_m)
        least = max(self._low, self._per_m * way_m)
        if battery.charge >= least:
            return None
        return Failed(Cause.PRECONDITION, f"the battery is at {battery.charge:.0%}, less than {least:.0%}")


def battery_reserve(low: float, dock: Pose2D, freshness: Freshness = Freshness(10.0, StaleData.ACCEPT)) -> Condition:
    """Enough charge is left for some work and for the way to the dock."""
    return Fresh(BatteryReserve(low, dock), "the battery", lambda c: c.robot.battery().stamp_s, freshness)


def battery_above(least: float, freshness: Freshness = Freshness(10.0, StaleData.ACCEPT)) -> Condition:
    """Enough charge is left; an old reading will do unless said otherwise, since charge changes slowly."""
    return Fresh(BatteryAbove(least), "the battery", lambda context: context.robot.battery().stamp_s, freshness)


def localised(patience_s: float = 2.0, freshness: Freshness = Freshness(2.0, StaleData.WAIT)) -> Condition:
    """The robot knows where it is, as its scans say; with old ones it stands and waits."""
    return Fresh(Localised(patience_s), "its place", lambda c: c.localiser.estimate().stamp_s, freshness)
