"""Conditions as data, as they stand in a compiled tree; `condition` makes what looks at them in one run."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

from executive.mission.file.model import StaleData
from executive.tree.behaviours.conditions import (
    Condition,
    Freshness,
    LeaseHeld,
    StopReleased,
    Verdict,
    battery_above,
    battery_reserve,
    holding,
    localised,
)
from executive.tree.behaviours.context import RunContext
from skills.api import Cause, Failed
from skills.robot import Pose2D

BATTERY_FRESHNESS = Freshness(10.0, StaleData.ACCEPT)
PLACE_FRESHNESS = Freshness(2.0, StaleData.WAIT)
PLACE_PATIENCE_S = 5.0


class Requirement(Protocol):
    """A condition as data."""

    def condition(self, context: RunContext) -> Condition:
        """The condition for one run that begins now."""


@dataclass(frozen=True)
class BatteryAtLeast:
    """The battery's charge (0 to 1) is at least `charge`; `stale` says what an old reading means (None: accept it)."""

    charge: float
    stale: StaleData | None = None

    def condition(self, context: RunContext) -> Condition:
        """A condition on the battery."""
        return battery_above(self.charge, replace(BATTERY_FRESHNESS, policy=self.stale or BATTERY_FRESHNESS.policy))


@dataclass(frozen=True)
class KnowsPlace:
    """The robot knows where it is; `stale` says what an old estimate means (None: wait for a new one)."""

    stale: StaleData | None = None
    patience_s: float = PLACE_PATIENCE_S

    def condition(self, context: RunContext) -> Condition:
        """A condition on the localiser, with some seconds of patience."""
        return localised(self.patience_s, replace(PLACE_FRESHNESS, policy=self.stale or PLACE_FRESHNESS.policy))


@dataclass(frozen=True)
class BatteryForWork:
    """The battery's charge (0 to 1) is at least `low`, and enough for the way to the dock."""

    low: float
    dock: Pose2D

    def condition(self, context: RunContext) -> Condition:
        """A condition on battery and place."""
        return battery_reserve(self.low, self.dock)


@dataclass(frozen=True)
class Holds:
    """The gripper holds `thing`."""

    thing: str

    def condition(self, context: RunContext) -> Condition:
        """A condition on the gripper."""
        return holding(self.thing)


@dataclass(frozen=True)
class NoStopButton:
    """No stop button is pressed."""

    def condition(self, context: RunContext) -> Condition:
        """A condition on the run's stop button."""
        return StopReleased()


@dataclass(frozen=True)
class OwnLease:
    """Nobody else holds the robot's lease."""

    def condition(self, context: RunContext) -> Condition:
        """A condition on the lease."""
        return LeaseHeld()


@dataclass(frozen=True)
class NotAfter:
    """At most `limit_s` on the robot's clock have passed since the run began."""

    limit_s: float

    def condition(self, context: RunContext) -> Condition:
        """A condition that counts from now."""
        return TimeLeft(self.limit_s, context.clock.now())


@dataclass(frozen=True)
class TimeLeft(Condition):
    """Time is left: `limit_s` counts from `begun_s` on the robot's clock; TIMEOUT when not."""

    limit_s: float
    begun_s: float

    def violated(self, context: RunContext) -> Verdict:
        """A failure when the time is over."""
        if context.clock.now() - self.begun_s <= self.limit_s:
            return None
        return Failed(Cause.TIMEOUT, f"more than {self.limit_s:g} s have passed since the mission began")
