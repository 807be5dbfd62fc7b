"""Checks missions without running them: errors, warnings, and estimates of time, path and charge."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import TopologicalSorter
from html import escape
from pathlib import Path
from typing import Final

from executive.app.prepare.feasibility import check_prepared, route_planner_of
from executive.app.prepare.from_request import prepare
from executive.app.prepare.placed_robots import robot_stack, shared_detector
from executive.app.prepare.prepared import Prepared
from executive.app.prepare.worlds import crossing_rooms, refuse_unusable, unsayable_names
from executive.mission.request import Request
from executive.tree.compiler import CompiledTree
from executive.tree.estimate import Estimate, RoutePlanner, minutes_text
from executive.tree.node_view import node_view
from executive.view.text import DRAWN_NODES, readable
from skills.inputs.errors import InputError

MOST_LETTERS: Final = 300
_SHOWN: Final = 2
"""Lines of one kind in the text of a result, before the others are counted."""


@dataclass(frozen=True)
class Checked:
    """Result of a check: errors and warnings, the tree of each robot, and one estimate for all robots together.

    `file` is the mission file; None for a mission without a file. `detectors` says how own detectors are read.
    """

    file: Path | None
    errors: tuple[InputError, ...] = ()
    trees: tuple[CompiledTree, ...] = ()
    estimate: Estimate = field(default_factory=Estimate)
    warnings: tuple[InputError, ...] = ()
    time_limit_s: float = math.inf
    detectors: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """True if the mission has no errors."""
        return not self.errors

    @property
    def _lines(self) -> list[str]:
        """Errors, warnings and commands, of each the first and the number of the others, and the estimate."""
        errors, warnings = ([*map(str, each)] for each in (self.errors, self.warnings))
        commands = [str(command) for tree in self.trees for command in tree.commands]
        lines = list[str]()
        for what, found in (("error: ", errors), ("warning: ", warnings), ("", commands)):
            most = _SHOWN if len(found) > _SHOWN + 1 else len(found)
            lines += [what + each for each in found[:most]]
            lines += [f"{what}and {len(found) - most} more"] if found[most:] else []
        return [*lines, *self.summary] if self.ok else lines

    @property
    def summary(self) -> tuple[str, ...]:
        """The estimate, and where a run may be cut short, its time limit."""
        limit = f"a run ends after {minutes_text(self.time_limit_s)} at the latest, unless --time-limit says otherwise"
        return (str(self.estimate), *([limit] if self.estimate.most_s > self.time_limit_s else ()))

    def __str__(self) -> str:
        return "\n".join(self._lines)

    def _repr_html_(self) -> str:
        """Returns the errors, warnings and commands, or the estimate, and the tree of each robot."""
        from executive.view.formats import to_svg  # only notebooks show it

        lines = self._lines
        pictures = (to_svg(readable(node_view(tree.root), DRAWN_NODES)) for tree in self.trees)
        return "".join(f"<p>{escape(line)}</p>" for line in lines) + "".join(pictures)


class Checker:
    """Checker of missions, which plans each route once for each pair of a world and a kind of robot."""

    def __init__(self) -> None:
        self._routes: dict[tuple[Path, str, Path | None], RoutePlanner] = {}
        self._unsayable: dict[Path, tuple[InputError, ...]] = {}

    def check(self, request: Request) -> Checked:
        """Checks a request; reports defects of the mission as errors in the result instead of raising them."""
        trees, file = tuple[CompiledTree, ...](), request.file
        try:
            prepared = prepare(request)
            trees = tuple(each.tree for each in prepared.all)
            refuse_unusable(prepared.world, prepared.request.seed)
            stacks = [robot_stack(each.robot) for each in prepared.all if each.robot.stack_file is not None]
            detectors = tuple(filter(None, dict.fromkeys(shared_detector(stack).about for stack in stacks)))
            checked = {each.mission.robot_name: check_prepared(each, self.planner(each)) for each in prepared.all}
        except InputError as error:
            return Checked(file, _placed(file, (error, *error.others)), trees)
        except Exception as defect:  # the other files must be checked as well
            what = f"errand cannot check it ({type(defect).__name__}: {defect})"[:MOST_LETTERS]
            return Checked(file, _placed(file, (InputError(what, hint="report it with this file"),)), trees)
        errors = tuple(error for each in checked.values() for error in each.errors)
        warnings = tuple(warning for each in checked.values() for warning in each.warnings)
        estimates = {name: each.estimate for name, each in checked.items()}
        warnings += crossing_rooms(prepared.world, prepared.knowledge)
        if prepared.world.folder not in self._unsayable:
            self._unsayable[prepared.world.folder] = unsayable_names(prepared.world, prepared.knowledge)
        warnings += self._unsayable[prepared.world.folder]
        total, limit_s = _total(prepared, estimates), prepared.time_limit_s
        return Checked(file, _placed(file, errors), trees, total, warnings, limit_s, detectors)

    def planner(self, prepared: Prepared) -> RoutePlanner:
        """Returns the planner of routes for the robot of a mission."""
        world, robot = prepared.world, prepared.robot
        key = (world.folder, robot.kind, robot.stack_file)
        if key not in self._routes:
            self._routes[key] = route_planner_of(world, robot)
        return self._routes[key]


def _total(prepared: Prepared, estimates: Mapping[str, Estimate]) -> Estimate:
    """Combines the estimates of several robots: latest end, sum of the distances, largest charge."""
    after = {each.mission.robot_name: each.after for each in prepared.all}
    done_s: dict[str, float] = {}
    latest_s: dict[str, float] = {}
    for name in TopologicalSorter(after).static_order():
        done_s[name] = estimates[name].duration_s + max((done_s[first] for first in after[name]), default=0.0)
        latest_s[name] = estimates[name].most_s + max((latest_s[first] for first in after[name]), default=0.0)
    whole = Estimate(
        max(done_s.values()),
        sum(each.distance_m for each in estimates.values()),
        max(each.charge for each in estimates.values()),
    )
    return whole.up_to(max(latest_s.values()), *(reason for each in estimates.values() for reason in each.reasons))


def _placed(file: Path | None, errors: Sequence[InputError]) -> tuple[InputError, ...]:
    """Sorts errors by file and line; an error without a file gets the first line of `file`."""
    if file is None:
        return tuple(errors)
    placed = [
        error if error.file is not None else InputError(error.message, hint=error.hint, file=file, line=1)
        for error in errors
    ]
    return tuple(sorted(placed, key=lambda error: (str(error.file) != str(file), str(error.file), error.line or 0)))
