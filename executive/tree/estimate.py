"""Estimates a mission in which nothing fails: time, distance and charge, with errors for impossible steps.

A walk follows the tree's nodes in the order in which they run; of alternatives it takes the first possible one.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Final, Protocol

from pydantic import Field

from executive.tree.node import NodeSpec
from skills.api import Zone
from skills.inputs.errors import InputError
from skills.inputs.schema import Strict, validate
from skills.inputs.yaml_source import read_yaml
from skills.robot import Pose2D

_Mark = tuple[Pose2D, Mapping[str, Pose2D], float]
Positive = Annotated[float, Field(gt=0.0)]
CHARGE: Final = "charge"


class DriveTimes(Strict):
    """Duration of a drive: `overhead_s`, and `per_metre_s` for each metre of progress along its path."""

    overhead_s: Positive
    per_metre_s: Positive


class BatteryUse(Strict):
    """Charge per second that is drawn or restored, as a fraction of a full battery."""

    driving_per_s: Positive
    standing_per_s: Positive
    charging_per_s: Positive


class Estimates(Strict):
    """Schema of `estimates.yaml`: typical durations, and the charge that they draw."""

    drive: DriveTimes
    skills: dict[str, Positive]
    other_skill_s: Positive
    battery: BatteryUse


@dataclass(frozen=True)
class Route:
    """Route between two poses: its length (m), and its progress (m), in which turns count as well.

    `limited` are its stretches with a speed limit: the progress (m) along each, and the limit (m/s).
    """

    length_m: float
    progress_m: float
    limited: tuple[tuple[float, float], ...] = ()


class RoutePlanner(Protocol):
    """Planner of routes on the map."""

    def route(self, start: Pose2D, goal: Pose2D, zones: tuple[Zone, ...] = ()) -> Route:
        """Plans the route from start to goal that obeys the zones. Raises ValueError with a sentence if none exists."""


@dataclass(frozen=True)
class Estimate:
    """Least duration on the robot's clock (s), distance driven (m), and charge used (fraction of a full battery).

    The mission may take `spare_s` longer (infinite: unknown) for the `reasons`, such as "1 to 3 rounds".
    """

    duration_s: float = 0.0
    distance_m: float = 0.0
    charge: float = 0.0
    spare_s: float = 0.0
    reasons: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Formats the estimate; its time is "about 2 min 05 s" or "2 min 05 s to 5 min 10 s (1 to 3 rounds)"."""
        least = minutes_text(self.duration_s)
        if round(self.spare_s if math.isfinite(self.spare_s) else 1.0) == 0:
            time = f"about {least}"
        else:
            most = "or more" if math.isinf(self.spare_s) else f"to {minutes_text(self.most_s)}"
            time = f"{least} {most} ({'; '.join(self.reasons)})"
        charge = f"{self.charge:.1%} of the battery" if self.charge <= 1.0 else "more than one charge"
        return f"{time}, {self.distance_m:.0f} m of driving and {charge} when all goes well"

    @property
    def most_s(self) -> float:
        """Longest duration (s) without failures."""
        return self.duration_s + self.spare_s

    def __add__(self, other: Estimate) -> Estimate:
        return Estimate(
            self.duration_s + other.duration_s,
            self.distance_m + other.distance_m,
            self.charge + other.charge,
            self.spare_s + other.spare_s,
            tuple(dict.fromkeys((*self.reasons, *other.reasons))),
        )

    def up_to(self, most_s: float, *reasons: str) -> Estimate:
        """Returns the estimate with `most_s` as the longest duration, and puts these reasons before the others."""
        all_reasons = tuple(dict.fromkeys((*reasons, *self.reasons)))
        return replace(self, spare_s=max(0.0, most_s - self.duration_s), reasons=all_reasons)


def minutes_text(duration_s: float) -> str:
    """Formats a duration (s) as "45 s", "2 min 05 s" or "1 h 05 min"."""
    minutes, seconds = divmod(round(duration_s), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {seconds:02d} s" if minutes else f"{seconds} s"


class CannotError(Exception):
    """Raised for a node that cannot succeed; `error` is None if the user need not know."""

    def __init__(self, error: InputError | None) -> None:
        super().__init__(str(error))
        self.error = error


@dataclass
class Walk:
    """State of a walk: the robot's pose, the poses stored by nodes, and the charge drawn since the battery was full."""

    planner: RoutePlanner
    estimates: Estimates
    pose: Pose2D
    zones: tuple[Zone, ...] = ()
    noted: dict[str, Pose2D] = field(default_factory=dict)
    written: set[str] = field(default_factory=set)
    errors: list[InputError] = field(default_factory=list)
    warnings: list[InputError] = field(default_factory=list)
    drawn: float = 0.0

    def mark(self) -> _Mark:
        """Returns the present pose, the stored poses and the drawn charge, as a state to return to."""
        return self.pose, dict(self.noted), self.drawn

    def go_to(self, mark: _Mark) -> None:
        """Returns to an earlier state of the walk."""
        self.pose, noted, self.drawn = mark
        self.noted = dict(noted)

    def draw(self, node: NodeSpec, taken: Estimate) -> Estimate:
        """Adds the charge that a skill draws or restores; warns at the skill that empties the battery."""
        before, self.drawn = self.drawn, 0.0 if node.name == CHARGE else self.drawn + taken.charge
        if before <= 1.0 < self.drawn:
            hint = f"charge before it (`skill: {CHARGE}`) or split the mission, or it is interrupted for the dock"
            self.warnings.append(InputError.at(node.source, "a full battery does not last until here", hint=hint))
        return taken

    def follow(self, node: NodeSpec, *, first: bool) -> Estimate:
        """Estimates a node. Records and omits an impossible step; with `first`, raises the step's error instead."""
        try:
            taken: Estimate = node.behaviour.estimate(node, self, first)
            return taken
        except CannotError as cannot:
            if first:
                raise
            if cannot.error is not None:
                self.errors.append(cannot.error)
            return Estimate()

    def all_of(self, node: NodeSpec, first: bool) -> Estimate:
        """Estimates the children, which run one after another."""
        return sum((self.follow(child, first=first) for child in node.behaviour.usual_children(node)), Estimate())

    def possible(self, node: NodeSpec, *, most: int | None = 1) -> Estimate:
        """Estimates the first possible branches. Raises the first branch's error if no branch is possible."""
        reasons: list[InputError] = []
        done: list[Estimate] = []
        for branch in node.behaviour.usual_children(node):
            here = self.mark()
            try:
                done.append(self.follow(branch, first=True))
            except CannotError as cannot:
                self.go_to(here)
                reasons += [] if cannot.error is None else [cannot.error]
            if len(done) == most:
                break
        if not done:
            raise CannotError(reasons[0] if reasons else None)
        return sum(done, Estimate())

    def each_from_here(self, branches: Sequence[NodeSpec], first: bool) -> list[tuple[Estimate, _Mark]]:
        """Estimates each branch from the present state; returns each estimate with the state at the branch's end."""
        here, found = self.mark(), []
        for branch in branches:
            self.go_to(here)
            found.append((self.follow(branch, first=first), self.mark()))
        return found


def estimate_tree(
    root: NodeSpec, *, start: Pose2D, planner: RoutePlanner, estimates: Estimates, zones: tuple[Zone, ...] = ()
) -> tuple[Estimate, tuple[InputError, ...], tuple[InputError, ...]]:
    """Estimates a tree that begins at `start`, for a robot that obeys `zones`.

    Also returns errors for unreachable places, and warnings, each with its line.
    """
    walk = Walk(planner, estimates, start, zones)
    return walk.follow(root, first=False), tuple(walk.errors), tuple(walk.warnings)


@functools.cache
def load_estimates() -> Estimates:
    """Loads the shipped typical durations."""
    return validate(Estimates, read_yaml(Path(__file__).with_name("estimates.yaml")))
