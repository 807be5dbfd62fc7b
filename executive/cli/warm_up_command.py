"""`errand warm-up`: the numeric code is compiled for this machine."""

from __future__ import annotations

import time

import typer

from executive.app.kernels import compile_kernels, newly_compiled
from executive.cli.output import refusals
from skills.files.errors import count_text

__all__ = ["warm_up"]


def warm_up() -> None:
    """Compile the numeric code for this machine, so that the first run begins at once."""
    begun_s = time.monotonic()
    with refusals():
        compile_kernels()
    typer.echo(f"{count_text(newly_compiled(), 'function')} compiled in {time.monotonic() - begun_s:.0f} s")
