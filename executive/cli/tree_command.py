"""`errand tree`: the tree of a sentence or a mission file before it runs, or of a log as it last was."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Final

import typer

from executive.app.mission_files import shipped_missions
from executive.app.prepare import prepare
from executive.cli.number_options import quantity_option
from executive.cli.output import refusals
from executive.cli.terminal import terminal_answerer
from executive.mission.request import Request
from executive.record.history import read_history
from executive.tree.node_view import NodeView, node_view, to_json
from executive.view.btcpp import to_btcpp
from executive.view.collapse import DRAWN_NODES, MANY_NODES, fold_below, fold_to
from executive.view.mermaid import to_mermaid
from executive.view.svg import to_svg
from executive.view.text import to_text
from skills.files.errors import InputError
from skills.files.outside import is_file
from skills.quantities import Count, Delay, Tries

LOG_SUFFIX: Final = ".mcap"


class TreeFormat(StrEnum):
    """How `errand tree` shows a tree."""

    TEXT = "text"
    SVG = "svg"
    MERMAID = "mermaid"
    XML = "xml"
    JSON = "json"


_FORMS: Final[Mapping[TreeFormat, Callable[[NodeView, bool], str]]] = MappingProxyType(
    {
        TreeFormat.TEXT: lambda view, ascii_only: to_text(view, ascii_only=ascii_only) + "\n",
        TreeFormat.SVG: lambda view, _: to_svg(view),
        TreeFormat.MERMAID: lambda view, _: to_mermaid(view),
        TreeFormat.XML: lambda view, _: to_btcpp(view),
        TreeFormat.JSON: lambda view, _: json.dumps(to_json(view), ensure_ascii=False) + "\n",
    }
)
_MOST: Final[Mapping[TreeFormat, int]] = (
    MappingProxyType(  # programs, which read the other forms, do not mind a large tree
        {TreeFormat.TEXT: MANY_NODES, TreeFormat.SVG: DRAWN_NODES, TreeFormat.MERMAID: DRAWN_NODES}
    )
)


def tree(
    file: Annotated[str | None, typer.Argument(metavar="FILE|SENTENCE|LOG", show_default=False)] = None,
    say: Annotated[str | None, typer.Option(help='What is said, as in "Hey Alice, fetch me a drink".')] = None,
    world: Annotated[str | None, typer.Option(help="World by name or folder; flat unless said.")] = None,
    form: Annotated[TreeFormat, typer.Option("--format", help="How to show it.")] = TreeFormat.TEXT,
    depth: Annotated[int | None, quantity_option(Tries, help="Show only so many levels below the root.")] = None,
    most: Annotated[
        int | None, quantity_option(Count, help="Fold what is done or not begun beyond so many nodes.")
    ] = None,
    at: Annotated[float | None, quantity_option(Delay, help="Of a log: at this time (s), not at its end.")] = None,
    robot: Annotated[str | None, typer.Option(metavar="NAME", help="Of a log: of this one of several robots.")] = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Write it to this file.")] = None,
    ascii_only: Annotated[bool, typer.Option("--ascii", help="Text without special characters.")] = False,
) -> None:
    """Show the tree of a sentence or a mission file before it runs, or of a log as it last was."""
    with refusals():
        whole = _view(file, say, world, at, robot)
        shown = whole if depth is None else fold_below(whole, depth)
        few = most or _MOST.get(form)
        text = _FORMS[form](shown if few is None else fold_to(shown, few), ascii_only)
        if output is None:
            sys.stdout.write(text)
        else:
            _write(output, text)


def _view(text: str | None, say: str | None, world: str | None, at_s: float | None, robot: str | None) -> NodeView:
    """What ends in .mcap is a log, what ends in .yaml, exists or is shipped a mission file, and all else a sentence."""
    if text is not None and text.endswith(LOG_SUFFIX):
        history = read_history(Path(text))
        if robot is None and len(history.robots) > 1:
            known = ", ".join(history.robots)
            raise InputError("the log has several robots", hint=f"add --robot with one of: {known}", file=history.file)
        return (history if robot is None else history.of_robot(robot)).trees(at_s)[-1]
    if at_s is not None or robot is not None:
        option = "--at" if robot is None else "--robot"
        raise InputError(f"{option} is for logs", hint="name a log.mcap that a run has written")
    prepared = prepare(_request(text, say, world), ask=terminal_answerer())
    for each in prepared.all:
        for note in each.mission.notes:
            typer.echo(note, err=True)
    trees = tuple(node_view(each.tree.root) for each in prepared.all)
    return trees[0] if len(trees) == 1 else NodeView("robots", "together", prepared.mission.name, children=trees)


def _request(text: str | None, say: str | None, world: str | None) -> Request:
    if text is not None and say is not None:
        raise InputError("a sentence and --say were given", hint="leave one of them out")
    if text is not None and (text.endswith((".yaml", ".yml")) or text in shipped_missions() or is_file(Path(text))):
        return Request(file=Path(text), world=world)
    sentence = say if text is None else text
    if sentence is None:
        raise InputError("a mission file, a sentence or a log is needed", hint='try: errand tree "go to the kitchen"')
    return Request(sentence, world=world)


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write it ({error.strerror})", hint="name another file", file=path) from error
