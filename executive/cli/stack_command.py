"""`errand stack show`: which components a robot uses, with all their options."""

from __future__ import annotations

import typer

from executive.cli.options import takes_request
from executive.mission.request import Request
from executive.mission.stack_file import load_stack
from skills.files.yaml_scalars import yaml_of
from skills.stack import plain

stack = typer.Typer(
    name="stack", help="What a robot uses: localiser, planners, controller, detector.", rich_markup_mode=None
)


@stack.callback()
def _group() -> None:
    """What a robot uses."""


@stack.command()
@takes_request("stack")
def show(request: Request) -> None:
    """Prints a stack with all its options as YAML, which --stack takes again."""
    chosen = load_stack(request.stack)
    typer.echo(yaml_of(plain(chosen), flow_style=False), nl=False)
