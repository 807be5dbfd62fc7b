"""`errand log`: the timeline of an event log."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import cv2
import typer
from rich.console import Console
from rich.text import Text

from executive.cli.number_options import quantity_option
from executive.cli.output import console_for, refusals, show_table
from executive.record.history import History, read_history
from executive.record.ros2 import write_ros2
from executive.record.schemas import ERRORS
from executive.record.timeline import Entry, timeline
from executive.view.map_picture import map_picture
from executive.view.styles import style_of
from executive.view.text import printable
from skills.files.errors import InputError
from skills.quantities import Delay


def log(
    file: Annotated[Path, typer.Argument(metavar="LOG", help="A log.mcap that a run has written.", show_default=False)],
    as_json: Annotated[bool, typer.Option("--json", help="All transitions as one JSON list.")] = False,
    ros2: Annotated[Path | None, typer.Option(help="Write it anew as a ROS 2 bag (MCAP), and end.")] = None,
    map_file: Annotated[
        Path | None, typer.Option("--map", help="Draw map, way, path and particles as PNG, and end.")
    ] = None,
    at: Annotated[float, quantity_option(Delay, help="When the map is drawn (s); else at the end.")] = math.inf,
    robot: Annotated[str | None, typer.Option(metavar="NAME", help="Only this one of several robots.")] = None,
    every_node: Annotated[bool, typer.Option("--all", help="Also inner nodes and late ticks.")] = False,
) -> None:
    """Print what happened in a run: what each node did and why, detections, the outcome, tracebacks of defects."""
    with refusals():
        history = read_history(file)
        history = history if robot is None else history.of_robot(robot)
        if ros2 is not None:
            typer.echo(f"{write_ros2(history.events, ros2)} messages in {ros2}", err=True)
            return
        if map_file is not None:
            _draw(history, map_file, at)
            return
        if as_json:
            sys.stdout.write(json.dumps(list(history.transitions()), ensure_ascii=False) + "\n")
            return
        _show(history, console_for(as_json=False), every_node=every_node)


def _draw(history: History, file: Path, at_s: float) -> None:
    """Write the map's picture. Raises InputError: it cannot be written."""
    _, png = cv2.imencode(".png", map_picture(history.events, at_s))
    try:
        file.write_bytes(png.tobytes())
    except OSError as error:
        raise InputError(f"cannot write it ({error.strerror})", hint="name another file", file=file) from error
    typer.echo(f"the map is in {file}", err=True)


def _show(history: History, console: Console, *, every_node: bool) -> None:
    """The timeline as a table, and the traceback of each defect below it."""
    entries = list(timeline(history.events, leaves_only=not every_node))
    prefix = _common([entry.about for entry in entries if entry.state is not None])
    several = len(history.robots) > 1
    rows = ((entry.robot, *_row(entry, prefix)) if several else _row(entry, prefix) for entry in entries)
    show_table(console, (*(("robot",) if several else ()), "t (s)", "", "node or topic", "what"), rows)
    for event in history.events:
        if event.topic == ERRORS:
            head = f"{event.stamp_s:.2f} s, {event.data.get('node')}:"
            lines = str(event.data.get("traceback", "")).splitlines()
            console.print("", *map(printable, (head, *lines)), sep="\n", markup=False)


def _common(path_ids: Sequence[str]) -> str:
    """The parts, robot and mission, with which all path ids begin; empty where they differ."""
    starts = {"/".join(path_id.split("/")[:2]) + "/" for path_id in path_ids}
    return starts.pop() if len(starts) == 1 else ""


def _row(entry: Entry, prefix: str) -> tuple[str | Text, ...]:
    if entry.state is None:
        return f"{entry.t:.2f}", "·", Text(entry.about, style="cyan"), Text(printable(entry.text))
    style = style_of(entry.state)
    symbol = Text(f"{style.symbol} {style.word}", style=style.rich)
    about = entry.about.removeprefix(prefix)
    return f"{entry.t:.2f}", symbol, Text(printable(about)), Text(printable(entry.text), style=style.rich)
