"""`errand new robot` writes an installable package with a robot from a URDF."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Annotated

import typer

from executive.cli.new_command import show_package
from executive.cli.output import new_folder
from skills.inputs.errors import InputError


def robot(
    name: Annotated[str, typer.Argument(help="Name of the kind of robot: lower-case words joined by _.")],
    urdf: Annotated[Path, typer.Option("--urdf", metavar="FILE", help="URDF of the robot, or a xacro file.")],
    out: Annotated[Path | None, typer.Option("--out", help="New folder for the package; by default the name.")] = None,
    package: Annotated[
        list[str] | None,
        typer.Option("--package", metavar="NAME=DIR", help="Folder of package://NAME; may be given several times."),
    ] = None,
) -> None:
    """Writes an installable package with a robot from a URDF: its parts, meshes, tests and registration."""
    from errand_make.robots.package import check_robot_name, render_robot

    logging.getLogger("drake").setLevel(logging.WARNING)  # Drake sets its own level when it is imported
    folder = Path(name) if out is None else out
    check_robot_name(name)
    with new_folder(folder) as made:
        notes = render_robot(name, urdf, made, packages=dict(map(_package, package or ())))
        written = [folder / path.relative_to(made) for path in sorted(made.rglob("*")) if path.is_file()]
    show_package([path for path in written if "meshes" not in path.parts], folder)
    for note in notes:
        typer.echo(f"Check in robot.yaml: {note}")


def _package(text: str) -> tuple[str, Path]:
    """Parses NAME=DIR. Raises InputError."""
    name, _, folder = text.partition("=")
    if not name or not Path(folder).is_dir():
        raise InputError(f"--package {text[:60]}: there is no such folder", hint="write NAME=DIR")
    return name, Path(folder)
