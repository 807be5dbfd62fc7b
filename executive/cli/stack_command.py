"""`errand stack show`: which components a robot uses, with all their options."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
import yaml

from executive.cli.output import refusals
from executive.mission.stack_file import load_stack
from skills.stack import plain

__all__ = ["STACK", "stack"]

STACK = Annotated[
    Path | None,
    typer.Option("--stack", help="A stack file: localiser, planners, detector and so on; see errand stack show."),
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
