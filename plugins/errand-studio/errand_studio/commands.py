"""`errand studio` serves the studio."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from executive.cli.options import PORT
from executive.cli.output import console_for
from skills.inputs.errors import InputError
from skills.inputs.outside import is_folder, is_there

MOST_PORT: Final = 65_535


def studio(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with mission files.")] = Path(),
    out: Annotated[Path | None, typer.Option("--out", help="Folder of runs; by default `out` in the folder.")] = None,
    view_port: PORT = 0,
) -> None:
    """Writes, checks, runs and compares the missions of a folder in the browser."""
    if not is_folder(folder):
        raise InputError("there is no such folder", hint="name a folder for mission files", file=folder)
    runs = out or folder / "out"
    if is_there(runs) and not is_folder(runs):
        raise InputError("it is a file, and no folder of runs", hint="name another --out", file=runs)
    from errand_studio.app import serve
    from errand_studio.workshop import Workshop

    console = console_for(False)
    workshop = Workshop(folder, runs, live_port=min(view_port + 1, MOST_PORT) if view_port else 0)
    serve(workshop, view_port, lambda line: console.print(line, markup=False, soft_wrap=True))
