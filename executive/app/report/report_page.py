"""Writes `report.html` with request, verdicts, steps, answers and pictures into a run's folder."""

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import Final
from urllib.parse import quote

import cv2
import numpy as np
from py_trees.common import Status

from executive.app.prepare.prepared import Prepared
from executive.app.report.artifacts import Artifacts, detection_picture, file_name, to_jpeg
from executive.app.report.pictures import read_picture
from executive.app.report.run_report import (
    DATE,
    Ending,
    ReportedAnswer,
    ReportedObject,
    RobotReport,
    RunReport,
    counts_text,
    title_of,
)
from executive.mission.request_fields import command_of
from executive.record.announce import PACKAGES, versions
from executive.record.history import RECORDING, Event, seen_objects
from executive.run.outcome import Finding, RunResult, Said
from executive.tree.compiler import CompiledTree
from executive.tree.node_view import NodeView
from executive.tree.plan import StepPart
from executive.view.formats import to_svg
from executive.view.html import render
from executive.view.map_picture import map_picture
from executive.view.plots import curves_of, to_plot
from executive.view.text import DRAWN_NODES, ROBOT_COLOURS, NodeStyle, Styles, executed_tree, readable, style_of
from executive.words.knowledge import Knowledge
from executive.words.outlines import inside
from executive.words.schemas import TRANSITIONS
from skills.api import ObjectObservation
from skills.inputs.errors import InputError

REPORT: Final = "report.html"
TREE: Final = "tree"
_CAPTIONS: Final = {
    "detection": "The first detection",
    "grasp": "The grasp",
    "place": "Putting it down",
    "hand_over": "The hand-over",
}
_MAP: Final = "The map, with the path of the robot"
_MAPS: Final = "The map, with the path of each robot"
_SKIPPED: Final = "skipped"


Picture = tuple[str, bytes]
"""Caption and JPEG file of a picture."""


@dataclass(frozen=True)
class StepRow:
    """Row of a step: name, state, depth of nesting, begin and end in s (None: not begun), and the last message."""

    name: str
    style: NodeStyle
    word: str
    depth: int = 0
    span_s: tuple[float, float] | None = None
    message: str = ""


@dataclass(frozen=True)
class MissionRow:
    """Row of a fleet's mission: number, request, robot, result, count of reassignments, and last message.

    `good` is None while the mission has not ended.
    """

    number: int
    request: str
    robot: str
    good: bool | None
    word: str
    reassigned: int
    message: str


@dataclass(frozen=True)
class ReportPart:
    """Part of a report on one robot, or on one mission of a fleet; `colour` is the robot's colour (hex)."""

    title: str
    colour: str
    report: Ending
    steps: Sequence[StepRow] = ()
    pictures: Sequence[Picture] = ()
    tree_svg: str = ""


@dataclass(frozen=True)
class ReportPage:
    """Content of `report.html`. `request` is the sentence or the file, `facts` are pairs of a name and a value.

    `links` are pairs of a name and the address of a file beside the report; `commands` are command lines with names.
    `alone` is the report on a single robot. For several robots, `parts` has one report for each robot, and `missions`
    has the missions of a fleet.
    """

    title: str
    request: str
    facts: Sequence[tuple[str, str]]
    alone: ReportPart | None = None
    parts: Sequence[ReportPart] = ()
    missions: Sequence[MissionRow] = ()
    answers: Sequence[ReportedAnswer] = ()
    answer_pictures: Sequence[bytes] = ()
    said: Sequence[Said] = ()
    seen: Sequence[ReportedObject] = ()
    events: Sequence[str] = ()
    map: Picture | None = None
    plots: Sequence[str] = ()
    links: Sequence[tuple[str, str]] = ()
    commands: Sequence[tuple[str, str]] = ()


@dataclass(frozen=True)
class EndedTree:
    """Last state of a robot's tree, with the report on the robot's mission."""

    tree: CompiledTree
    view: NodeView
    report: RobotReport

    @property
    def picture(self) -> str:
        """Executed nodes of the tree, drawn as SVG."""
        return to_svg(readable(executed_tree(self.view), DRAWN_NODES), title=self.tree.mission_name)

    def steps(self, events: Sequence[Event]) -> tuple[StepRow, ...]:
        """Returns a row for each step of the mission, with times from the events of the log."""
        below = (one for _, one in self.view.walk() if one.path_id == self.tree.mission.path_id)
        mission, spans = next(below, self.view), dict[str, tuple[float, float]]()
        for event in events:
            if event.topic == TRANSITIONS:
                t_s, path_id = float(event.data.get("t", event.stamp_s)), str(event.data["node"])
                spans[path_id] = (spans.get(path_id, (t_s, t_s))[0], t_s)
        return tuple(step_rows(mission, frozenset(part.path_id for part in self.tree.parts), spans))


def write_report(
    prepared: Prepared, report: RunReport, ended: Sequence[EndedTree], artifacts: Artifacts, events: Sequence[Event]
) -> Path:
    """Writes the report of a run and the picture of each tree into its folder; returns the report's path.

    `ended` are the robots' trees, `events` are those of the run's log, `artifacts` has the run's pictures.
    """
    out, several = prepared.request.out, prepared.several
    names, request = tuple(prepared.robots), prepared.request
    asked = "commands" if request.file is None else f"mission file {request.file.name}"
    parts = [part_of(each, names, artifacts, events) for each in ended]
    for each, part in zip(ended, parts, strict=True):
        (out / f"{file_name(TREE, each.tree.robot_name, names)}.svg").write_text(part.tree_svg, encoding="utf-8")
    page = ReportPage(
        title=title_of(each.mission.name for each in prepared.all),
        request=asked if request.sentence is None else f"“{request.sentence}”",
        facts=(*_facts(report, "" if several else ended[0].tree.robot_name), *facts_now()),
        links=links_in(out, Path(report.log).name),
        commands=(("run", command_of(request)), ("replay", shlex.join(["errand", "replay", report.log]))),
        alone=None if several else parts[0],
        parts=parts if several else (),
        answers=report.answers,
        answer_pictures=artifacts.pictures,
        said=report.said,
        seen=report.seen_objects,
        events=report.seen.events,
        map=map_of(artifacts, events, several=several),
        plots=[to_plot(each) for each in curves_of(events)],
    )
    return save_report(out, page)


def part_of(
    ended: EndedTree, robots: Sequence[str], artifacts: Artifacts, events: Sequence[Event], *, title: str | None = None
) -> ReportPart:
    """Builds the part of a report on one robot; its title is by default the robot's name and kind."""
    name, report = ended.tree.robot_name, ended.report
    return ReportPart(
        title=title or f"{name} ({report.kind})",
        colour=ROBOT_COLOURS[(*sorted(robots), name).index(name) % len(ROBOT_COLOURS)],
        report=report,
        steps=ended.steps(events),
        pictures=tuple(_pictures(artifacts, name, robots)) if title is None else (),
        tree_svg=ended.picture,
    )


def save_report(out: Path, page: ReportPage) -> Path:
    """Writes a report page into the folder `out`; returns its path."""
    path = out / REPORT
    path.write_text(render("run.html", page=page), encoding="utf-8")
    return path


def step_rows(
    node: NodeView, parts: frozenset[str], spans: Mapping[str, tuple[float, float]], depth: int = 0
) -> Iterator[StepRow]:
    """Yields a row for each command of a mission, and for each node that groups several commands.

    `spans` are the times (s) of the first and last transition of each node. A decorator and its child share a row, with
    the decorator's status and the child's name.
    """
    outer, within = node, [node]
    while (only := _decorated(within[-1], parts)) is not None:
        within.append(only)
    inner, below = within[-1], _steps(within[-1])
    nested = len(below) > 1 and inner.path_id not in parts and _parts_in(inner, parts) > (1 if depth else 0)
    if depth or not nested:
        row = _row(outer, within, spans, max(0, depth - 1))
        yield replace(row, message="") if nested and row.word == Styles.SUCCESS.value.word else row
    if nested:
        for child in below:
            yield from step_rows(child, parts, spans, depth + 1)


def _decorated(node: NodeView, parts: frozenset[str]) -> NodeView | None:
    """Returns the child that shares a row with a node: the only child, or the only child that contains commands.

    None for the node of a command, and for a node with several children that contain commands.
    """
    below = () if node.path_id in parts else _steps(node)
    if len(below) > 1 and node.behaviour.control != "Sequence":
        below = tuple(child for child in below if _parts_in(child, parts))
    return below[0] if len(below) == 1 else None


def _parts_in(node: NodeView, parts: frozenset[str]) -> int:
    return sum(one.path_id in parts for _, one in node.walk())


def _steps(node: NodeView) -> tuple[NodeView, ...]:
    return tuple(child for child in node.children if not child.behaviour.plumbing)


def _row(outer: NodeView, within: Sequence[NodeView], spans: Mapping[str, tuple[float, float]], depth: int) -> StepRow:
    inner, state = within[-1], outer.state
    skipped = state.status is Status.SUCCESS and any(
        above.behaviour.skips and below.state.status is Status.FAILURE for above, below in pairwise(within)
    )
    style = Styles.CANCELLED.value if skipped else style_of(state)
    word = _SKIPPED if skipped else f"{style.word} ({state.cause_text})".removesuffix(" ()")
    return StepRow(inner.title(), style, word, depth, spans.get(outer.path_id), state.message)


def _facts(report: RunReport, robot_name: str) -> tuple[tuple[str, str], ...]:
    """Returns the facts on a run as pairs of name and value; with several robots `name` is empty."""
    facts = (
        ("world", f"{report.world}, seed {report.seed}"),
        ("duration", report.duration_text),
        *((("zones", "; ".join(report.zones)),) if report.zones else ()),
        *(("robot", note) for note in report.notes),
    )
    if not robot_name:
        return facts
    contacts = () if report.referee is None else (("contacts", counts_text(report.referee)),)
    return (("robot", robot_name), *facts, *contacts)


def facts_now() -> tuple[tuple[str, str], ...]:
    """Date and version of a report, as pairs of name and value."""
    return ("date", datetime.now().strftime(DATE)), ("version", versions(PACKAGES[:1])[PACKAGES[0]])


def links_in(out: Path, log: str) -> tuple[tuple[str, str], ...]:
    """Links to the files of a run that are in its folder: the name of each and its address from the report."""
    files = (("recording in 3D", RECORDING), ("event log", log), ("tree", f"{TREE}.svg"))
    return tuple((name, quote(file)) for name, file in files if (out / file).is_file())


def map_of(artifacts: Artifacts, events: Sequence[Event], *, several: bool) -> Picture | None:
    """Returns the world from above if the run was recorded, else the robot's own map; None if there is neither."""
    caption = _MAPS if several else _MAP
    if (drawn := _drawn(artifacts, "map")) is not None:
        return caption, drawn
    try:
        picture = map_picture(events)
    except InputError:
        return None
    return caption, to_jpeg(np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8))


def _pictures(artifacts: Artifacts, robot: str, robots: Sequence[str]) -> Iterator[Picture]:
    """Yields a robot's pictures with captions: from the recorded run, else of a detection, and those of its skills."""
    detection = artifacts.of_robot(robot).detection
    for name, caption in _CAPTIONS.items():
        if (drawn := _drawn(artifacts, file_name(name, robot, robots))) is not None:
            yield caption, drawn
        elif name == "detection" and detection is not None and not artifacts.pictures:
            yield caption, to_jpeg(detection_picture(detection))
    yield from artifacts.of_robot(robot).shown


def _drawn(artifacts: Artifacts, name: str) -> bytes | None:
    return to_jpeg(read_picture(artifacts.drawn[name])) if name in artifacts.drawn else None


def with_findings(
    report: RunReport, knowledge: Knowledge, result: RunResult, artifacts: Artifacts, events: Sequence[Event]
) -> RunReport:
    """Adds to a report the answers and the speech of all missions in the order of time, and the seen objects."""
    parts = [part for tree in result.trees.values() for part in tree.parts]
    findings = sorted((one for each in result.every for one in each.findings), key=lambda one: one.t_s)
    said = sorted((one for each in result.every for one in each.said), key=lambda one: one.t_s)
    return replace(
        report,
        answers=tuple(_answer(one, parts, artifacts) for one in findings),
        said=tuple(said),
        seen_objects=tuple(_reported(seen, knowledge) for seen in seen_objects(events)),
    )


def _answer(finding: Finding, parts: Sequence[StepPart], artifacts: Artifacts) -> ReportedAnswer:
    """Returns an answer for the report, with its picture and the place that its command names."""
    path_id = finding.path_id
    commands = (part.command for part in parts if f"{path_id}/".startswith(f"{part.path_id}/"))
    return ReportedAnswer(
        question=finding.question,
        answer=finding.answer,
        sentence=finding.sentence,
        t_s=finding.t_s,
        place=next((command.goal for command in commands if command is not None), None),
        picture=artifacts.numbers.get((path_id, finding.t_s)),
        at_least=finding.at_least,
    )


def _reported(seen: ObjectObservation, knowledge: Knowledge) -> ReportedObject:
    """Returns a seen object with its room."""
    x_m, y_m, _ = seen.position_W
    rooms = (name for name, outline in knowledge.rooms.items() if inside(outline, (x_m, y_m)))
    place = knowledge.room(seen.surface) if seen.surface in knowledge.surfaces else next(rooms, None)
    return ReportedObject(str(seen.kind), seen.surface, place, seen.position_W, seen.stamp_s)
