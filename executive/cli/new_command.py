"""`errand new` writes installable packages: one with a skill, one with a robot from a URDF."""

from __future__ import annotations

import keyword
import re
from collections.abc import Collection, Mapping
from pathlib import Path
from string import Template
from typing import Annotated, Final

import typer

from executive.cli.output import console_for, new_folder, progress_bar
from skills.inputs.errors import InputError
from skills.inputs.outside import writing

_TEMPLATES: Final = Path(__file__).parent / "new"
_SUFFIX: Final = ".template"
_BAND_M: Final = 0.05
"""Half the band of heights of the returns of a planar LiDAR, which a robot that tilts a little smears."""
_NAME: Final = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")

new = typer.Typer(name="new", help="Packages of your own: a skill, or a robot.", rich_markup_mode=None)


@new.callback()
def _group() -> None:
    """Packages of your own: a skill, or a robot."""


@new.command()
def skill(
    name: Annotated[str, typer.Argument(help="Name of the skill: lower-case words joined by _.")],
    folder: Annotated[Path, typer.Argument(help="New folder for the package.")],
) -> None:
    """Writes an installable package with one skill, its tests and its registration."""
    from executive.tree.registry import installed_skills

    _tell(render_skill(name, folder, taken=frozenset(installed_skills().names)), folder)


@new.command()
def robot(
    name: Annotated[str, typer.Argument(help="Name of the kind of robot: lower-case words joined by _.")],
    urdf: Annotated[Path, typer.Option("--urdf", metavar="FILE", help="URDF of the robot; expand xacro first.")],
    out: Annotated[Path | None, typer.Option("--out", help="New folder for the package; by default the name.")] = None,
    package: Annotated[
        list[str] | None,
        typer.Option("--package", metavar="NAME=DIR", help="Folder of package://NAME; may be given several times."),
    ] = None,
) -> None:
    """Writes an installable package with a robot from a URDF: its parts, meshes, tests and registration."""
    from plant.robots.robot_kind import robot_kinds

    folder = Path(name) if out is None else out
    _check(name, "robot", robot_kinds())
    with new_folder(folder) as made:
        notes = render_robot(name, urdf, made, packages=dict(map(_package, package or ())))
        written = [folder / path.relative_to(made) for path in sorted(made.rglob("*")) if path.is_file()]
    _tell([path for path in written if "meshes" not in path.parts], folder)
    for note in notes:
        typer.echo(f"Check in robot.yaml: {note}")


def _package(text: str) -> tuple[str, Path]:
    """Parses NAME=DIR. Raises InputError."""
    name, _, folder = text.partition("=")
    if not name or not Path(folder).is_dir():
        raise InputError(f"--package {text[:60]}: there is no such folder", hint="write NAME=DIR")
    return name, Path(folder)


def _tell(written: Collection[Path], folder: Path) -> None:
    for path in written:
        typer.echo(str(path))
    typer.echo(f"\nNext:\n  pip install --no-build-isolation --editable {folder}\n  pytest {folder}")


def _check(name: str, what: str, taken: Collection[str]) -> None:
    """Raises InputError if a skill or a robot cannot have a name."""
    if not _NAME.fullmatch(name) or keyword.iskeyword(name):
        hint = "use lower-case words joined by _, as in wave_arm"
        raise InputError(f"'{name}' cannot be the name of a {what}", hint=hint)
    if name in taken:
        raise InputError(f"a {what} '{name}' exists already", hint="choose another name")


def render_skill(name: str, folder: Path, *, taken: frozenset[str] = frozenset()) -> tuple[Path, ...]:
    """Writes a package with the skill `name` into a new folder; returns the files.

    Raises:
        InputError: the name is not allowed or is taken, or the folder is not empty or cannot be written.
    """
    _check(name, "skill", taken)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder} exists and is not empty", hint="name a new folder")
    words = _words(name, "skill") | {"class_name": "".join(word.capitalize() for word in name.split("_"))}
    places = {"skill.skilltest.yaml": f"{name}.skilltest.yaml", "test_skill.py": f"test_{name}.py"}
    return _render("skill", folder, words, places)


def render_robot(name: str, urdf: Path, folder: Path, *, packages: Mapping[str, Path]) -> list[str]:
    """Writes a package with the robot `name` into a folder; returns what a person has to check.

    Raises:
        InputError: the URDF or a mesh cannot be used; with file and line.
    """
    from plant.models.builder.robot_inference import write_robot_file
    from plant.models.builder.robot_meshes import copy_meshes
    from plant.robots.urdf_robot.urdf_file import UrdfFile
    from skills.manipulation.arm.poses import compact_configuration

    words = _words(name, "robot")
    home = folder / words["package"]
    home.mkdir(parents=True)
    source = UrdfFile(urdf)
    count = sum(1 for _ in source.robot.iter("mesh"))
    with progress_bar(console_for(as_json=True), "meshes", count) as advance:
        for _ in copy_meshes(source, packages, home):
            advance()
    try:
        can, notes = write_robot_file(source, name, home, compact_configuration)
    except InputError as error:
        if error.file != home / "robot.urdf":
            raise
        raise InputError(error.message, hint=error.hint, file=urdf, line=error.line) from error
    omni = can.base_kind.value == "omnidirectional"
    words["controller"] = "mppi" if omni else "path_follower"
    height_m = can.lidar_height_m or 0.0
    words |= {"low": f"{height_m - _BAND_M:.2f}", "high": f"{height_m + _BAND_M:.2f}"}
    words["grasp_x"] = f"{1.38 - (0.0 if can.arm is None else can.arm.standing_m[0]):.2f}"
    lacking = [] if can.arm is not None else ["look", "stow"]
    lacking += [] if can.object_camera is not None else ["look"]
    lacking += [] if can.object_camera is not None and can.gripper is not None else ["take", "grasp"]
    _render("robot", folder, words, {}, without={f"{each}.skilltest.yaml" for each in lacking})
    return notes


def _words(name: str, what: str) -> dict[str, str]:
    return {"name": name, "dashed": name.replace("_", "-"), "package": f"errand_{what}_{name}"}


def _render(
    what: str, folder: Path, words: Mapping[str, str], places: Mapping[str, str], without: Collection[str] = ()
) -> tuple[Path, ...]:
    """Writes the templates of a kind into a folder; returns the files."""
    written, places = [], {"package": words["package"], **places}
    with writing(folder, "name another folder"):
        for template in sorted((_TEMPLATES / what).rglob(f"*{_SUFFIX}")):
            parts = template.relative_to(_TEMPLATES / what).with_name(template.name.removesuffix(_SUFFIX)).parts
            if parts[-1] in without:
                continue
            target = folder.joinpath(*(places.get(part, part) for part in parts))
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(Template(template.read_text(encoding="utf-8")).substitute(words), encoding="utf-8")
            written.append(target)
    return tuple(written)
