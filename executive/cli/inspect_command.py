"""`errand log` and `errand replay` show a run; `errand tree` shows the tree of a mission."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Final, Literal

import typer
from rich.console import Console
from rich.text import Text

from executive.cli.defaults import chosen_run
from executive.cli.number_options import quantity_option
from executive.cli.options import HOST, PORT, takes_request
from executive.cli.output import console_for, show_table, terminal_answerer
from executive.mission.request import Request
from executive.record.history import RECORDING, Entry, History, read_history, timeline
from executive.tree.node_view import NodeView, node_view, to_json
from executive.view.formats import to_btcpp, to_mermaid, to_svg
from executive.view.text import DRAWN_NODES, MANY_NODES, fold_below, fold_to, printable, readable, style_of, to_text
from executive.words.schemas import ERRORS
from skills.inputs.errors import InputError
from skills.inputs.outside import is_file, is_folder, writing
from skills.quantities import Count, Delay, Tries, Wait

LOG_SUFFIX: Final = ".mcap"
RUN: Final = typer.Argument(metavar="[RUN]", help="Folder or log.mcap; by default the last run.", show_default=False)


def log(
    run: Annotated[Path | None, RUN] = None,
    as_json: Annotated[bool, typer.Option("--json", help="All transitions as one JSON list.")] = False,
    form: Annotated[
        Literal["text", "map"], typer.Option("--format", help="map draws map, trajectory, path and particles as PNG.")
    ] = "text",
    out: Annotated[Path | None, typer.Option("-o", "--out", help="The picture.")] = None,
    at: Annotated[float, quantity_option(Delay, help="Time of the map (s); by default the end.")] = math.inf,
    robot: Annotated[str | None, typer.Option(metavar="NAME", help="Only this one of several robots.")] = None,
    every_node: Annotated[bool, typer.Option("--all", help="Also inner nodes, and ticks that took too long.")] = False,
) -> None:
    """Prints the timeline of a run: nodes with causes, detections, outcome, tracebacks of defects."""
    history = _history(run, at if out is not None else None)
    history = history if robot is None else history.of_robot(robot)
    if out is None and at < math.inf:
        raise InputError("--at is for --format map", hint="name a picture: --format map --out map.png")
    if (form == "text") != (out is None):
        what = "--out is for --format map" if out is not None else "--format map writes a file"
        raise InputError(what, hint="name both: --format map --out map.png")
    if out is not None:
        import cv2

        from executive.view.map_picture import map_picture

        _, png = cv2.imencode(".png", map_picture(history.events, at))
        with writing(out):
            out.write_bytes(png.tobytes())
        typer.echo(f"the map is in {out}", err=True)
        return
    if as_json:
        sys.stdout.write(json.dumps(list(history.transitions()), ensure_ascii=False) + "\n")
        return
    _show(history, console_for(as_json=False), every_node=every_node)


def _show(history: History, console: Console, *, every_node: bool) -> None:
    """Prints the timeline as a table, followed by the traceback of each internal error."""
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
    """Returns the prefix (robot and mission) that all path ids share; empty if they share none."""
    starts = {"/".join(path_id.split("/")[:2]) + "/" for path_id in path_ids}
    return starts.pop() if len(starts) == 1 else ""


def _row(entry: Entry, prefix: str) -> tuple[str | Text, ...]:
    if entry.state is None:
        return f"{entry.t:.2f}", "·", Text(entry.about, style="cyan"), Text(printable(entry.text))
    style = style_of(entry.state)
    symbol = Text(f"{style.symbol} {style.word}", style=style.rich)
    about = entry.about.removeprefix(prefix)
    return f"{entry.t:.2f}", symbol, Text(printable(about)), Text(printable(entry.text), style=style.rich)


def _history(run: Path | None, at_s: float | None = None) -> History:
    """Returns the history of a run, by default of the last one. Raises InputError, also for a time after its end."""
    history = read_history(chosen_run(run))
    end_s = max((event.stamp_s for event in history.events), default=0.0)
    if at_s is not None and end_s < at_s < math.inf:
        raise InputError(f"--at {at_s:g} is after the end", hint=f"give at most {end_s:.2f}", file=history.file)
    return history


def replay(
    run: Annotated[Path | None, RUN] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Write one HTML file that needs no server, and end.")
    ] = None,
    scene: Annotated[bool, typer.Option(help="Show the 3D recording beside the log.")] = True,
    view_port: PORT = 0,
    view_host: HOST = "127.0.0.1",
    view_for: Annotated[float | None, quantity_option(Wait, help="End after this time, s.")] = None,
) -> None:
    """Shows a run at any time of it: tree, map, pictures, events, 3D recording."""
    history = _history(run)
    history.trees()
    beside = history.file.parent / RECORDING
    recording = beside if scene and beside.is_file() else None
    if out is not None:
        if (view_host, view_port, view_for) != ("127.0.0.1", 0, None):
            raise InputError("with --out no page is served", hint="leave --view-port, --view-host and --view-for out")
        from executive.view.html import log_page

        with writing(out):
            out.write_text(log_page(history.events, recording), encoding="utf-8")
        return
    from executive.view.html import feed_of
    from executive.view.server import PageContent, serve, wait

    content = PageContent(feed_of(history.events), recording=recording)
    with serve(content, (view_host, view_port)) as server:
        console_for(False).print(f"{server.lines}\n(Ctrl-C ends it)", markup=False)
        wait(view_for)


TreeFormat = Literal["text", "svg", "mermaid", "xml", "json"]
_FORMS: Final[Mapping[TreeFormat, Callable[[NodeView], str]]] = {
    "svg": to_svg,
    "mermaid": to_mermaid,
    "xml": to_btcpp,
    "json": lambda view: json.dumps(to_json(view), ensure_ascii=False) + "\n",
}
_MOST: Final[Mapping[TreeFormat, int]] = {"text": MANY_NODES, "svg": DRAWN_NODES, "mermaid": DRAWN_NODES}
"""Largest number of nodes in the formats for people."""


@takes_request("sentence", "world")
def tree(
    request: Request,
    file: Annotated[str | None, typer.Argument(metavar="[FILE|SENTENCE|RUN]", show_default=False)] = None,
    form: Annotated[TreeFormat, typer.Option("--format", help="Output format.")] = "text",
    depth: Annotated[int | None, quantity_option(Tries, help="Number of levels below the root to show.")] = None,
    most: Annotated[
        int | None, quantity_option(Count, help="Number of nodes to show; folds nodes that have ended or not begun.")
    ] = None,
    at: Annotated[
        float | None, quantity_option(Delay, help="For a log: show the tree at this time (s), not at the end.")
    ] = None,
    robot: Annotated[
        str | None, typer.Option(metavar="NAME", help="For a log: the robot to show among several.")
    ] = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Write the tree to this file.")] = None,
    ascii_only: Annotated[bool, typer.Option("--ascii", help="Text without special characters.")] = False,
) -> None:
    """Shows the tree of a sentence or a mission file before it runs, or the last state of the tree of a run.

    Without an argument, of the last run.
    """
    whole = _view(file, request, at, robot)
    shown = whole if depth is None else fold_below(whole, depth)
    if most is not None:
        shown = fold_to(shown, most)
    elif form in _MOST:
        shown = readable(shown, _MOST[form]) if depth is None else fold_to(shown, _MOST[form])
    text = _FORMS[form](shown) if form in _FORMS else to_text(shown, ascii_only=ascii_only) + "\n"
    if out is None:
        sys.stdout.write(text)
    else:
        with writing(out):
            out.write_text(text, encoding="utf-8")


def _view(text: str | None, request: Request, at_s: float | None, robot: str | None) -> NodeView:
    """Returns the tree of a run, a mission file (.yaml, a file, or a shipped one), or a sentence."""
    nothing = text is None and request.sentence is None
    if nothing or (text is not None and (text.endswith(LOG_SUFFIX) or is_folder(Path(text)))):
        history = _history(None if text is None else Path(text), at_s)
        if robot is None and len(history.robots) > 1:
            known = ", ".join(history.robots)
            raise InputError("the log has several robots", hint=f"add --robot with one of: {known}", file=history.file)
        return (history if robot is None else history.of_robot(robot)).trees(at_s)[-1]
    if at_s is not None or robot is not None:
        option = "--at" if robot is None else "--robot"
        raise InputError(f"{option} is for logs", hint="name a log.mcap that a run has written")
    from executive.app.prepare.from_request import prepare

    prepared = prepare(_request(text, request), ask=terminal_answerer())
    for each in prepared.all:
        for note in each.mission.notes:
            typer.echo(note, err=True)
    trees = tuple(node_view(each.tree.root) for each in prepared.all)
    return trees[0] if len(trees) == 1 else NodeView("robots", "together", prepared.mission.name, children=trees)


def _request(text: str | None, request: Request) -> Request:
    """Returns the request whose tree is shown. Raises InputError if two are given."""
    from executive.app.prepare.mission_files import shipped_missions

    if text is None:
        return request
    if request.sentence is not None:
        raise InputError("both a sentence and --say are given", hint="leave one of them out")
    if "/" in text and " " not in text and not text.endswith((".yaml", ".yml")):
        chosen_run(Path(text))
    is_mission = text.endswith((".yaml", ".yml")) or text in shipped_missions() or is_file(Path(text))
    return replace(request, file=Path(text)) if is_mission else replace(request, sentence=text)
