"""Checks a text as `errand check` does, in a process that stays: messages at lines, tree, goals, routes on the map."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

from executive.app.prepare.checker import Checked, Checker
from executive.app.prepare.prepared import Prepared
from executive.mission.request import Request
from executive.record.announce import map_message
from executive.tree.compiler import CompiledTree
from executive.tree.estimate import Route, RoutePlanner
from executive.tree.node import NodeSpec
from executive.tree.node_view import NodeView, node_view, outline
from executive.words.goal import GoalCondition
from skills.api import PlanningError, Zone
from skills.footprint import Footprint
from skills.grid_map import load_grid_map
from skills.inputs.errors import InputError
from skills.navigate.planner import plan_path
from skills.robot import Pose2D
from skills.stack import default_component

MOST_LEGS: Final = 40
_WORD: Final = re.compile(r"'([^']{1,80})'")
_MEANT: Final = re.compile(r"did you mean '([^']{1,80})'")


@dataclass(frozen=True)
class Message:
    """Error or warning of the check at a line (from 1). `replacement` is a word on that line, and what to write."""

    line: int
    text: str
    hint: str
    is_error: bool
    replacement: tuple[str, str] | None = None


@dataclass(frozen=True)
class Judged:
    """Command of the mission, with what the referee will judge, and its line."""

    command: str
    goal: str
    line: int | None


@dataclass(frozen=True)
class Leg:
    """Drive of the plan, with the line of its step."""

    start: Pose2D
    goal: Pose2D
    line: int | None


@dataclass(frozen=True)
class Insight:
    """Result of checking a text: messages, summary, the time taken, and what was compiled of the text in `file`."""

    messages: tuple[Message, ...] = ()
    summary: str = ""
    took_s: float = 0.0
    file: Path = Path()
    compiled: tuple[CompiledTree, ...] = ()
    routes: tuple[tuple[Prepared, tuple[tuple[Pose2D, Pose2D], ...]], ...] = ()

    @property
    def errors(self) -> int:
        """Number of errors."""
        return sum(message.is_error for message in self.messages)

    @property
    def prepared(self) -> Prepared | None:
        """Mission of the first robot; None if the mission could not be prepared."""
        return self.routes[0][0] if self.routes else None

    @cached_property
    def trees(self) -> tuple[NodeView, ...]:
        """Rows of the trees, as the mission's author wrote them."""
        return tuple(outline(node_view(tree.root)) for tree in self.compiled)

    @cached_property
    def judged(self) -> tuple[Judged, ...]:
        """Commands of all robots with what the referee judges."""
        return tuple(each for tree in self.compiled for each in _judged(tree, self.file))

    @cached_property
    def legs(self) -> tuple[Leg, ...]:
        """Drives for which the check has planned routes."""
        found = list[Leg]()
        for prepared, asked in self.routes:
            nodes = _goals_of(prepared.tree)
            found += [Leg(start, goal, _line_of(nodes.get(goal), self.file)) for start, goal in asked]
        return tuple(found[:MOST_LEGS])


class _RecordedRoutes:
    """Planner that notes the routes for which a check asks."""

    def __init__(self, planner: RoutePlanner) -> None:
        self._planner = planner
        self.asked: dict[tuple[Pose2D, Pose2D], Route] = {}

    def route(self, start: Pose2D, goal: Pose2D, zones: tuple[Zone, ...] = ()) -> Route:
        """Plans a route as the planner does."""
        route = self._planner.route(start, goal, zones)
        self.asked[start, goal] = route
        return route


class _NotingChecker(Checker):
    """Checker that notes the prepared missions and their routes."""

    def __init__(self) -> None:
        super().__init__()
        self.noted: list[tuple[Prepared, _RecordedRoutes]] = []

    def planner(self, prepared: Prepared) -> RoutePlanner:
        """Returns a planner that notes its routes."""
        self.noted.append((prepared, _RecordedRoutes(super().planner(prepared))))
        return self.noted[-1][1]


class MissionChecks:
    """Checks of the texts of missions; one at a time, from any thread."""

    def __init__(self) -> None:
        self._checker, self._lock = _NotingChecker(), threading.Lock()

    def check(self, file: Path, shown_as: str) -> Insight:
        """Checks the mission of a file, whose name in messages is `shown_as`."""
        with self._lock:
            began_s = time.perf_counter()
            self._checker.noted.clear()
            checked = self._checker.check(Request(file=file))
            noted = list(self._checker.noted)
        return _insight(checked, noted, file, shown_as, time.perf_counter() - began_s)


def _insight(
    checked: Checked, noted: Sequence[tuple[Prepared, _RecordedRoutes]], file: Path, shown_as: str, took_s: float
) -> Insight:
    lines = file.read_text(encoding="utf-8").splitlines()
    errors = [(error, True) for error in checked.errors] + [(error, False) for error in checked.warnings]
    messages = [_message(error, is_error, file, shown_as, lines) for error, is_error in errors]
    return Insight(
        messages=tuple(sorted(messages, key=lambda each: (each.line, not each.is_error))),
        summary="; ".join(checked.summary) if checked.ok else "",
        took_s=took_s,
        file=file,
        compiled=checked.trees,
        routes=tuple((prepared, tuple(routes.asked)) for prepared, routes in noted),
    )


def _message(error: InputError, is_error: bool, file: Path, shown_as: str, lines: Sequence[str]) -> Message:
    own = error.file == file
    line = max(1, min(error.line or 1, max(1, len(lines)))) if own else 1
    where = "" if own or error.file is None else f"{error.file}:{error.line or 1}: "
    text = f"{where}{error.message}".replace(str(file), shown_as).replace(file.name, shown_as)
    meant, on_line = _MEANT.search(error.hint), lines[line - 1] if lines else ""
    word = next((word for word in _WORD.findall(error.message) if word in on_line), None)
    replacement = (word, meant[1]) if meant is not None and word is not None else None
    return Message(line, text, error.hint, is_error, replacement)


def _line_of(node: NodeSpec | None, file: Path) -> int | None:
    source = None if node is None else node.source
    return source.line if source is not None and source.file == file else None


def _goals_of(tree: CompiledTree) -> Mapping[Pose2D, NodeSpec]:
    """Returns the nodes that drive to a known pose, by the pose."""
    found = dict[Pose2D, NodeSpec]()
    for node in tree.root.walk():
        goal = getattr(node.options.get("inputs", {}).get("goal"), "value", None)
        if node.skill is not None and isinstance(goal, Pose2D):
            found.setdefault(goal, node)
    return found


def _judged(tree: CompiledTree, file: Path) -> Iterator[Judged]:
    nodes = {node.path_id: node for node in tree.root.walk()}
    for part in tree.parts:
        skill = "" if part.skill is None else f"skill {part.skill.__name__}"
        said = str(part.command) if part.command is not None else skill
        line = _line_of(nodes.get(part.path_id) or nodes.get(part.node), file)
        yield Judged(said, "not judged" if part.goal is None else goal_words(part.goal), line)


def goal_words(goal: GoalCondition) -> str:
    """Returns what the referee judges, in one line."""
    what = goal.wanted or ", ".join(goal.classes)
    where = {"from": goal.source, "at": goal.goal}
    names = {word: list(dict.fromkeys(region.name for region in regions)) for word, regions in where.items()}
    parts = [
        goal.kind.value,
        f"{goal.count} × {what}" if goal.count > 1 else what,
        *(f"{word} {' or '.join(each[:3])}{' …' if each[3:] else ''}" for word, each in names.items() if each),
        f"person {goal.person}" if goal.person else "",
        goal.when.value,
    ]
    return ", ".join(filter(None, parts))


@dataclass(frozen=True)
class PlanMap:
    """Map of a mission's world with the planned drives, as plain data."""

    world: Mapping[str, Any]
    paths: tuple[tuple[int | None, tuple[tuple[float, float], ...]], ...] = ()


class PlanMaps:
    """Maps with planned drives. Each path is planned once."""

    def __init__(self) -> None:
        self._worlds: dict[Path, Mapping[str, Any]] = {}
        self._paths: dict[tuple[Path, str, Pose2D, Pose2D], tuple[tuple[float, float], ...]] = {}
        self._lock = threading.Lock()

    def map_of(self, insight: Insight) -> PlanMap | None:
        """Returns the map of a checked mission; None for a mission that could not be prepared."""
        prepared = insight.prepared
        if prepared is None:
            return None
        with self._lock:
            folder, planner = prepared.world.folder, _PathPlanner(prepared)
            if folder not in self._worlds:
                grid = load_grid_map(prepared.world.scan_map_path)
                self._worlds[folder] = map_message(grid, prepared.knowledge, world=prepared.world.name)
            paths = []
            for leg in insight.legs:
                key = (folder, prepared.robot.kind, leg.start, leg.goal)
                if key not in self._paths:
                    self._paths[key] = planner.path(leg.start, leg.goal)
                paths.append((leg.line, self._paths[key]))
            return PlanMap(self._worlds[folder], tuple(paths))


class _PathPlanner:
    """Planner of paths in the map of one mission's world."""

    def __init__(self, prepared: Prepared) -> None:
        self._prepared = prepared

    @cached_property
    def _costmap(self) -> Any:
        return default_component("costmap").build(load_grid_map(self._prepared.world.keepout_map_path))

    def path(self, start: Pose2D, goal: Pose2D) -> tuple[tuple[float, float], ...]:
        """Returns the points of a path; a straight line where none is found."""
        try:
            path = plan_path(self._costmap, Footprint.of(self._prepared.robot.capabilities), start, goal)
        except PlanningError:
            return (start.x_m, start.y_m), (goal.x_m, goal.y_m)
        every = max(1, len(path.poses) // 60)
        poses = [*path.poses[::every], path.poses[-1]]
        return tuple((round(float(pose[0]), 3), round(float(pose[1]), 3)) for pose in poses)
