"""`errand replay`: a log as a page with a slider, served or written as one HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from executive.cli.number_options import quantity_option
from executive.cli.output import console_for, refusals
from executive.record.history import History, read_history
from executive.view.html import feed_of, log_page
from executive.view.server import PageContent, serve, wait
from skills.files.errors import InputError
from skills.quantities import Port, Wait

RECORDING = "recording.html"


def replay(
    file: Annotated[Path, typer.Argument(metavar="LOG", help="A log.mcap that a run has written.", show_default=False)],
    html: Annotated[Path | None, typer.Option(help="Write one HTML file that needs no server, and end.")] = None,
    scene: Annotated[bool, typer.Option(help="With the 3D recording that lies beside the log.")] = True,
    port: Annotated[int, quantity_option(Port, help="Serve here; 0 takes a free port.")] = 0,
    view_for: Annotated[float | None, quantity_option(Wait, help="End after so many seconds.")] = None,
) -> None:
    """Show what happened in a run, at any time of it: tree, map, pictures, events, 3D recording."""
    with refusals():
        history = read_history(file)
        history.trees()
        beside = file.parent / RECORDING
        recording = beside if scene and beside.is_file() else None
        if html is not None:
            _write(html, log_page(history.events, recording))
            return
        _serve(history, recording, port, view_for)


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write it ({error.strerror})", hint="name another file", file=path) from error


def _serve(history: History, recording: Path | None, port: int, view_for_s: float | None) -> None:
    content = PageContent(feed_of(history.events), recording=recording)
    with serve(content, port) as server:
        console_for(False).print(f"{server.url}\n(Ctrl-C ends it)", markup=False)
        wait(view_for_s)
