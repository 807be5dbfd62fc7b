"""`errand stack show`: which components a robot uses, with all their options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
import yaml

from executive.cli.output import refusals
from executive.mission.stack_file import load_stack
from skills.files.outside import is_file, is_there
from skills.stack import DEFAULT_FILE, plain

__all__ = ["STACK", "stack", "stack_file"]


def stack_file(given: Path | None) -> Path | None:
    """A stack file as it was given, or the one of that name that comes with Errand."""
    if given is None or given != Path(given.name) or is_there(given):
        return given
    own = DEFAULT_FILE.with_name(f"{given}_stack.yaml")
    return own if is_file(own) else given


STACK = Annotated[
    Path | None,
    typer.Option(
        "--stack",
        callback=stack_file,
        help="A stack file: localiser, planners and so on; see errand stack show. 'no_map': for unknown places.",
    ),
]

stack = typer.Typer(
    name="stack", help="What a robot uses: localiser, planners, controller, detector.", rich_markup_mode=None
)


@stack.callback()
def _group() -> None:
    """What a robot uses."""


@stack.command()
def show(stack: STACK = None) -> None:
    """Print a stack with all its options as YAML, which --stack takes again."""
    with refusals():
        chosen = load_stack(stack)
    typer.echo(yaml.safe_dump(plain(chosen), sort_keys=False), nl=False)
