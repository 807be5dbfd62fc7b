"""`errand studio` serves the studio."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from executive.cli.options import HOST, PORT
from executive.cli.output import console_for
from skills.inputs.errors import InputError


def studio(
    folder: Annotated[Path, typer.Argument(metavar="[FOLDER]", help="Folder with mission files.")] = Path(),
    out: Annotated[Path | None, typer.Option("--out", help="Folder of runs; by default `out` in the folder.")] = None,
    view_port: PORT = 0,
    view_host: HOST = "127.0.0.1",
) -> None:
    """Writes, checks, runs and compares the missions of a folder in the browser."""
    if not folder.is_dir():
        raise InputError("there is no such folder", hint="name a folder for mission files", file=folder)
    from errand_studio.app import serve
    from errand_studio.workshop import Workshop

    console = console_for(False)
    workshop = Workshop(folder, out or folder / "out")
    serve(workshop, (view_host, view_port), lambda line: console.print(line, markup=False, soft_wrap=True))
