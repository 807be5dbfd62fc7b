"""Where the command line writes: people read the console, scripts the last line of standard output."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import typer
from rich.console import Console

from executive.mission.errors import InputError

NOT_ACHIEVED = 1
BAD_INPUT = 2


def console_for(as_json: bool) -> Console:
    """The console for people: standard error when standard output belongs to a script."""
    return Console(stderr=as_json, highlight=False, soft_wrap=True)


def print_json(value: Mapping[str, Any] | Sequence[Any]) -> None:
    """One JSON object or array on one line of standard output."""
    sys.stdout.write(json.dumps(value, ensure_ascii=False, allow_nan=False) + "\n")
    sys.stdout.flush()


@contextmanager
def refusals() -> Iterator[None]:
    """Bad input becomes one line on standard error for each error, and exit status 2."""
    try:
        yield
    except InputError as error:
        for each in (error, *error.others):
            typer.echo(f"errand: {each}", err=True)
        raise typer.Exit(BAD_INPUT) from error
