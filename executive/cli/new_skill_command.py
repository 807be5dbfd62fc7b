"""`errand new-skill NAME FOLDER`: the beginning of a skill of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from executive.cli.new_skill.render import render_skill
from executive.cli.output import refusals
from executive.tree.registry import installed_skills

__all__ = ["new_skill"]


def new_skill(
    name: Annotated[str, typer.Argument(help="The skill's name: lower-case words joined by _.")],
    folder: Annotated[Path, typer.Argument(help="The new folder for the package.")],
) -> None:
    """Write an installable package with one skill, its tests and its registration."""
    with refusals():
        written = render_skill(name, folder, taken=frozenset(installed_skills().names))
    for path in written:
        typer.echo(str(path))
    typer.echo(f"\nNext:\n  pip install --no-build-isolation --editable {folder}\n  pytest {folder}")
