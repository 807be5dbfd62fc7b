"""`errand missions` and `errand init`: the missions that come with Errand; `errand new-skill`: a skill of one's own."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Annotated, Final

import typer

from executive.app.mission_files import FOLDER, shipped_missions
from executive.cli.output import console_for, show_table
from skills.files.errors import InputError

__all__ = ["init", "missions", "new_skill"]

_FOR_EDITORS: Final = "# yaml-language-server"


def missions() -> None:
    """List the missions that come with Errand."""
    rows = [(name, _first_words(file)) for name, file in shipped_missions().items()]
    show_table(console_for(as_json=False), ("mission", "what it shows"), rows)


def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where to put them.", show_default=False)],
) -> None:
    """Copy the missions that come with Errand into a folder, to be changed; files that are there stay."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        new = [file for file in sorted(FOLDER.glob("*.[yj]*")) if not (folder / file.name).exists()]
        for file in new:
            shutil.copyfile(file, folder / file.name)
    except OSError as error:
        raise InputError(f"cannot write it ({error.strerror})", hint="name another folder", file=folder) from error
    first = folder / next(iter(shipped_missions().values())).name
    console_for(as_json=False).print(f"{len(new)} files in {folder}; try: errand run {first}", markup=False)


def _first_words(file: Path) -> str:
    """The first line of comment that is meant for people."""
    lines = file.read_text(encoding="utf-8").splitlines()
    return next((line[1:].strip() for line in lines if line[:1] == "#" and not line.startswith(_FOR_EDITORS)), "")


def new_skill(
    name: Annotated[str, typer.Argument(help="The skill's name: lower-case words joined by _.")],
    folder: Annotated[Path, typer.Argument(help="The new folder for the package.")],
) -> None:
    """Write an installable package with one skill, its tests and its registration."""
    from executive.cli.new_skill.render import render_skill
    from executive.tree.registry import installed_skills

    written = render_skill(name, folder, taken=frozenset(installed_skills().names))
    for path in written:
        typer.echo(str(path))
    typer.echo(f"\nNext:\n  pip install --no-build-isolation --editable {folder}\n  pytest {folder}")
