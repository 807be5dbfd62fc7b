"""`errand missions` and `errand init`: the shipped missions. `errand new-skill`: a package for a new skill."""

from __future__ import annotations

import keyword
import re
import shutil
from pathlib import Path
from string import Template
from typing import Annotated, Final

import typer

from executive.app.mission_files import FOLDER, shipped_missions
from executive.cli.output import console_for, show_table, writing
from skills.files.errors import InputError

_FOR_EDITORS: Final = "# yaml-language-server"
_TEMPLATES: Final = Path(__file__).parent / "skill_template"
_SUFFIX: Final = ".template"
_NAME: Final = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


def missions() -> None:
    """Lists the missions that come with Errand."""
    rows = [(name, _first_words(file)) for name, file in shipped_missions().items()]
    show_table(console_for(as_json=False), ("mission", "what it shows"), rows)


def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder for the missions.", show_default=False)],
) -> None:
    """Copies the missions that come with Errand into a folder; existing files stay."""
    with writing(folder, "name another folder"):
        folder.mkdir(parents=True, exist_ok=True)
        new = [file for file in sorted(FOLDER.glob("*.[yj]*")) if not (folder / file.name).exists()]
        for file in new:
            shutil.copyfile(file, folder / file.name)
    first = folder / next(iter(shipped_missions().values())).name
    console_for(as_json=False).print(f"{len(new)} files in {folder}; try: errand run {first}", markup=False)


def _first_words(file: Path) -> str:
    """Returns the first comment line of a mission file."""
    lines = file.read_text(encoding="utf-8").splitlines()
    return next((line[1:].strip() for line in lines if line[:1] == "#" and not line.startswith(_FOR_EDITORS)), "")


def new_skill(
    name: Annotated[str, typer.Argument(help="Name of the skill: lower-case words joined by _.")],
    folder: Annotated[Path, typer.Argument(help="New folder for the package.")],
) -> None:
    """Writes an installable package with one skill, its tests and its registration."""
    from executive.tree.registry import installed_skills

    written = render_skill(name, folder, taken=frozenset(installed_skills().names))
    for path in written:
        typer.echo(str(path))
    typer.echo(f"\nNext:\n  pip install --no-build-isolation --editable {folder}\n  pytest {folder}")


def render_skill(name: str, folder: Path, *, taken: frozenset[str] = frozenset()) -> tuple[Path, ...]:
    """Writes a package with the skill `name` into a new folder; returns the files.

    Raises:
        InputError: the name is not allowed or is taken, or the folder is not empty or cannot be written.
    """
    if not _NAME.fullmatch(name) or keyword.iskeyword(name):
        raise InputError(
            f"'{name}' cannot be the name of a skill", hint="use lower-case words joined by _, as in wave_arm"
        )
    if name in taken:
        raise InputError(f"a skill '{name}' exists already", hint="choose another name")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder} exists and is not empty", hint="name a new folder")
    package = f"errand_skill_{name}"
    words = {
        "name": name,
        "dashed": name.replace("_", "-"),
        "package": package,
        "class_name": "".join(word.capitalize() for word in name.split("_")),
    }
    places = {"package": package, "skill.skilltest.yaml": f"{name}.skilltest.yaml", "test_skill.py": f"test_{name}.py"}
    written = []
    with writing(folder, "name another folder"):
        for template in sorted(_TEMPLATES.rglob(f"*{_SUFFIX}")):
            parts = template.relative_to(_TEMPLATES).with_name(template.name.removesuffix(_SUFFIX)).parts
            target = folder.joinpath(*(places.get(part, part) for part in parts))
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(Template(template.read_text(encoding="utf-8")).substitute(words), encoding="utf-8")
            written.append(target)
    return tuple(written)
