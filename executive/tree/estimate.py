"""Estimate of a mission without failures: time, distance and charge, with errors for parts that are impossible.

A walk follows the tree's nodes in the order in which they run; of alternatives it takes the first possible one.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Final, Protocol

from pydantic import BaseModel, ConfigDict, Field

from executive.tree.board import Constant, FromBoard
from executive.tree.node import NodeSpec
from skills.api import Zone
from skills.inputs.errors import InputError
from skills.inputs.schema import validate
from skills.inputs.yaml_source import read_yaml
from skills.robot import Pose2D

_Mark = tuple[Pose2D, Mapping[str, Pose2D], float]
Positive = Annotated[float, Field(gt=0.0)]
_DRIVES: Final = frozenset({"navigate", "guide_person"})
CHARGE: Final = "charge"
DAY_S: Final = 86400.0
USUALLY_FOUND: Final = 3
"""Assumed number of objects that are found one after the other, since their true number is unknown before the run."""


class _Data(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


class DriveTimes(_Data):
    """Duration of a drive: `overhead_s`, and `per_metre_s` for each metre of progress along its path."""

    overhead_s: Positive
    per_metre_s: Positive


class BatteryUse(_Data):
    """Charge per second that is drawn or restored, as a share of a full battery."""

    driving_per_s: Positive
    standing_per_s: Positive
    charging_per_s: Positive


class Estimates(_Data):
    """Schema of `estimates.yaml`: typical durations, and the charge that they draw."""

    drive: DriveTimes
    skills: dict[str, Positive]
    other_skill_s: Positive
    battery: BatteryUse


@dataclass(frozen=True)
class Route:
    """Route between two poses: its length (m), and its progress (m), in which turns count as well.

    `limited` are its parts under a speed limit: the progress of each (m), and the limit (m/s).
    """

    length_m: float
    progress_m: float
    limited: tuple[tuple[float, float], ...] = ()


class RoutePlanner(Protocol):
    """Planner of routes on the map."""

    def route(self, start: Pose2D, goal: Pose2D, zones: tuple[Zone, ...] = ()) -> Route:
        """Plans the route from start to goal that minds the zones. Raises ValueError with one sentence if none does."""


@dataclass(frozen=True)
class Estimate:
    """Least duration on the robot's clock (s), distance driven (m), and charge used (share of a full battery).

    It may take `spare_s` longer (infinite: unknown) for the `reasons`: "1 to 3 rounds", "until 18:00".
    """

    duration_s: float = 0.0
    distance_m: float = 0.0
    charge: float = 0.0
    spare_s: float = 0.0
    reasons: tuple[str, ...] = ()

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
        """Returns the estimate with `most_s` as its longest duration, for these reasons before its own."""
        all_reasons = tuple(dict.fromkeys((*reasons, *self.reasons)))
        return replace(self, spare_s=max(0.0, most_s - self.duration_s), reasons=all_reasons)


class _CannotError(Exception):
    """Node that cannot succeed; `error` is None where the user need not know."""

    def __init__(self, error: InputError | None) -> None:
        super().__init__(str(error))
        self.error = error


@dataclass
class _Walk:
    """State of the walk: the robot's pose, the poses it has noted, the charge drawn since the battery was full."""

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
        """Returns the present pose, noted poses and drawn charge."""
        return self.pose, dict(self.noted), self.drawn

    def go_to(self, mark: _Mark) -> None:
        """Sets pose, noted poses and drawn charge."""
        self.pose, noted, self.drawn = mark
        self.noted = dict(noted)

    def draw(self, node: NodeSpec, taken: Estimate) -> Estimate:
        """Adds the charge that a skill draws or restores; warns at the skill that empties the battery."""
        before, self.drawn = self.drawn, 0.0 if node.name == CHARGE else self.drawn + taken.charge
        if before <= 1.0 < self.drawn:
            hint = f"charge before it (`skill: {CHARGE}`) or split the mission, or it is interrupted for the dock"
            self.warnings.append(InputError.at(node.source, "a full battery does not last until here", hint=hint))
        return taken


def estimate_tree(
    root: NodeSpec, *, start: Pose2D, planner: RoutePlanner, estimates: Estimates, zones: tuple[Zone, ...] = ()
) -> tuple[Estimate, tuple[InputError, ...], tuple[InputError, ...]]:
    """Estimates a tree from `start` on, in which the robot minds `zones`.

    Returns also errors for unreachable places, and warnings, with their lines.
    """
    walk = _Walk(planner, estimates, start, zones)
    return _followed(root, walk, first=False), tuple(walk.errors), tuple(walk.warnings)


@functools.cache
def load_estimates() -> Estimates:
    """Loads the shipped typical durations."""
    return validate(Estimates, read_yaml(Path(__file__).with_name("estimates.yaml")))


def _followed(node: NodeSpec, walk: _Walk, *, first: bool) -> Estimate:
    """Estimates a node. An impossible part is noted and omitted; with `first` its error is raised instead."""
    try:
        return _VISITS.get(node.kind, _all_of)(node, walk, first)
    except _CannotError as cannot:
        if first:
            raise
        if cannot.error is not None:
            walk.errors.append(cannot.error)
        return Estimate()


def expected_children(node: NodeSpec) -> tuple[NodeSpec, ...]:
    """Returns the children that run one after the other without failures."""
    follow = _EXPECTED.get(node.kind)
    return node.children if follow is None else follow(node)


def _all_of(node: NodeSpec, walk: _Walk, first: bool) -> Estimate:
    """Estimates the children one after the other."""
    return sum((_followed(child, walk, first=first) for child in expected_children(node)), Estimate())


def _first_of(node: NodeSpec, walk: _Walk, first: bool) -> Estimate:
    """Estimates the first possible branch. Raises the first branch's error if there is none."""
    reasons: list[InputError] = []
    for child in expected_children(node):
        tried = _tried(child, walk, reasons)
        if tried is not None:
            return tried
    raise _CannotError(reasons[0] if reasons else None)


def _all_that_can(node: NodeSpec, walk: _Walk, first: bool) -> Estimate:
    """Estimates all possible branches. Raises the first branch's error if there is none."""
    reasons: list[InputError] = []
    done = [tried for child in expected_children(node) if (tried := _tried(child, walk, reasons)) is not None]
    if not done:
        raise _CannotError(reasons[0] if reasons else None)
    return sum(done, Estimate())


def _tried(branch: NodeSpec, walk: _Walk, reasons: list[InputError]) -> Estimate | None:
    """Estimates a branch. An impossible one gives None, leaves the walk unchanged and adds its error to `reasons`."""
    here = walk.mark()
    try:
        return _followed(branch, walk, first=True)
    except _CannotError as cannot:
        walk.go_to(here)
        reasons += [] if cannot.error is None else [cannot.error]
        return None


def _each_from_here(branches: Sequence[NodeSpec], walk: _Walk, first: bool) -> list[tuple[Estimate, _Mark]]:
    """Estimates each branch from the present state of the walk; returns each with the state at its end."""
    here, found = walk.mark(), []
    for branch in branches:
        walk.go_to(here)
        found.append((_followed(branch, walk, first=first), walk.mark()))
    return found


def _if_known(node: NodeSpec, walk: _Walk, first: bool) -> Estimate:
    """Estimates a branch that is possible only after an earlier node has written its key."""
    if node.options["key"] not in walk.written:
        raise _CannotError(None)
    return _followed(node.children[0], walk, first=first)


def _remember(node: NodeSpec, walk: _Walk, first: bool) -> Estimate:
    walk.noted[node.options["key"]] = walk.pose
    return Estimate()


def _skill(node: NodeSpec, walk: _Walk, first: bool) -> Estimate:
    goal = _goal(node, walk)
    walk.written.update(node.options["outputs"].values())
    if goal is None:
        duration_s = walk.estimates.skills.get(node.name, walk.estimates.other_skill_s)
        return walk.draw(node, Estimate(duration_s, 0.0, duration_s * walk.estimates.battery.standing_per_s))
    try:
        route = walk.planner.route(walk.pose, goal, walk.zones)
    except ValueError as error:
        hint = f"name another place or pose, or correct the world's map{' or the zones' if walk.zones else ''}"
        raise _CannotError(InputError.at(node.source, str(error).rstrip("."), hint=hint)) from error
    walk.pose = goal
    drive = walk.estimates.drive
    slower_s = sum(max(0.0, part_m / limit_m_s - drive.per_metre_s * part_m) for part_m, limit_m_s in route.limited)
    duration_s = drive.overhead_s + drive.per_metre_s * route.progress_m + slower_s
    charge = duration_s * walk.estimates.battery.driving_per_s
    return walk.draw(node, Estimate(duration_s, route.length_m, charge))


def _goal(node: NodeSpec, walk: _Walk) -> Pose2D | None:
    """Goal of a drive, as far as it is known before the run."""
    binding = node.options["inputs"].get("goal") if node.name in _DRIVES else None
    if isinstance(binding, FromBoard):
        return walk.noted.get(binding.key)
    return binding.value if isinstance(binding, Constant) and isinstance(binding.value, Pose2D) else None


def _one_of(node: NodeSpec, walk: _Walk, first: bool) -> Estimate:
    """Estimates the decision, then the range from the shortest branch to the longest; a single one may not run."""
    decides, *branches = node.children
    begun, here = _followed(decides, walk, first=first), walk.mark()
    taken = [] if len(branches) > 1 else [(Estimate(), here)]
    taken += _each_from_here(branches, walk, first)
    shortest, _ = min(taken, key=lambda each: each[0].duration_s)
    longest, end = max(taken, key=lambda each: each[0].duration_s)
    walk.go_to(end)
    most_s, why = max(each.most_s for each, _ in taken), (node.name, *longest.reasons)
    return begun + (shortest if most_s == shortest.most_s else shortest.up_to(most_s, *why))


def _together(node: NodeSpec, walk: _Walk, first: bool) -> Estimate:
    """Estimates parallel branches, which stop when as many as are needed are done.

    The walk continues where the branch with the longest drive ends.
    """
    branches = _each_from_here(node.children, walk, first)
    ends_s = sorted(taken.duration_s for taken, _ in branches)[node.options["needed"] - 1]
    shares = [min(1.0, ends_s / taken.duration_s) if taken.duration_s else 1.0 for taken, _ in branches]
    distance_m = sum(share * taken.distance_m for share, (taken, _) in zip(shares, branches, strict=True))
    charge = sum(share * taken.charge for share, (taken, _) in zip(shares, branches, strict=True))
    walk.go_to(max(branches, key=lambda each: each[0].distance_m)[1])
    reasons = tuple(dict.fromkeys(reason for taken, _ in branches for reason in taken.reasons))
    most_s, needed = max(taken.most_s for taken, _ in branches), node.options["needed"]
    if needed < len(branches) and most_s > ends_s:
        done = "the first" if needed == 1 else f"the first {needed}"
        reasons = (f"until {done} of {len(branches)} steps is done", *reasons)
    return Estimate(ends_s, distance_m, charge).up_to(most_s, *reasons)


def _rounds(node: NodeSpec, walk: _Walk, first: bool) -> Estimate:
    """Estimates a known number of rounds, else at least one; the second round stands for all later ones."""
    times, fixed = node.options["times"], node.options["mode"] == "times"
    begun = _all_of(node, walk, first)
    if fixed and times:
        return _repeated(node, walk, first, begun, times)
    if not times:
        endless = "for ever" if fixed else f"{node.options['mode']} {node.options['words']}"
        return begun.up_to(math.inf, endless)
    if times == 1:
        return begun
    here = walk.mark()
    most_s = _repeated(node, walk, first, begun, times).most_s
    walk.go_to(here)
    return begun.up_to(most_s, f"1 to {times} rounds")


def _repeated(node: NodeSpec, walk: _Walk, first: bool, begun: Estimate, times: int) -> Estimate:
    """Estimates all rounds, of which the first is `begun`."""
    if times == 1:
        return begun
    again, more = _all_of(node, walk, first), times - 1
    rest = Estimate(more * again.duration_s, more * again.distance_m, more * again.charge, more * again.spare_s)
    rounds = begun + rest
    pauses_s = max(0.0, more * node.options["every_s"] - rounds.duration_s * more / times)
    return rounds + Estimate(pauses_s, 0.0, pauses_s * walk.estimates.battery.standing_per_s)


def _in_zones(node: NodeSpec, walk: _Walk, first: bool) -> Estimate:
    """Estimates the child, which minds further zones."""
    outer, walk.zones = walk.zones, tuple(dict.fromkeys((*walk.zones, *node.options["zones"])))
    try:
        return _all_of(node, walk, first)
    finally:
        walk.zones = outer


def _in_time(node: NodeSpec, walk: _Walk, first: bool) -> Estimate:
    """Limits the estimate to a timeout."""
    taken, limit_s = _all_of(node, walk, first), node.options["limit_s"]
    return taken if taken.most_s <= limit_s else taken.up_to(limit_s, f"{limit_s:g} s at most")


_VISITS: Final[Mapping[str, Callable[[NodeSpec, _Walk, bool], Estimate]]] = {
    "skill": _skill,
    "pause": lambda node, walk, first: Estimate(node.options["duration_s"]),
    "remember": _remember,
    "selector": _first_of,
    "round": _all_that_can,
    "only if known": _if_known,
    "only if near": _if_known,
    "try": _first_of,
    "choose": _one_of,
    "together": _together,
    "repeat": _rounds,
    "wait until": lambda node, walk, first: Estimate().up_to(DAY_S, f"until {node.options['words']}"),
    "wait for": lambda node, *walk: _all_of(node, *walk).up_to(math.inf, f"until {node.options['words']}"),
    "timeout": _in_time,
    "zones": _in_zones,
}


_EXPECTED: Final[Mapping[str, Callable[[NodeSpec], tuple[NodeSpec, ...]]]] = {
    "selector": lambda node: tuple(child for child in node.children if child.options.get("known_as") is None),
    "recover": lambda node: node.children[:1],
    "go back": lambda node: node.children[:1],
    "afterwards": lambda node: node.children[:1] if node.options["only_after_failure"] else node.children,
    "interrupts": lambda node: node.children[-1:],
    "for each found": lambda node: node.children * USUALLY_FOUND,
    "only if holding": lambda node: (),
}
