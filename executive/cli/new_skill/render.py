"""Renders the template of a skill package."""

from __future__ import annotations

import keyword
import re
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from string import Template

from skills.files.errors import InputError

_SUFFIX = ".template"
_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


def render_skill(name: str, folder: Path, *, taken: frozenset[str] = frozenset()) -> tuple[Path, ...]:
    """Write a package with the skill `name` into the new folder `folder`; the files written.

    Raises:
        InputError: the name is no lower-case word, or is taken; the folder exists and is not empty, or cannot be made.
    """
    if not _NAME.fullmatch(name) or keyword.iskeyword(name):
        raise InputError(
            f"'{name}' cannot be the name of a skill", hint="use lower-case words joined by _, as in wave_arm"
        )
    if name in taken:
        raise InputError(f"there is a skill '{name}' already", hint="choose another name")
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
    try:
        for template, path in _templates(files(__package__) / "template", Path(), places):
            target = folder / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(Template(template.read_text(encoding="utf-8")).substitute(words), encoding="utf-8")
            written.append(target)
    except OSError as error:
        raise InputError(f"cannot write into {folder} ({error.strerror})", hint="name another folder") from error
    return tuple(written)


def _templates(folder: Traversable, path: Path, places: dict[str, str]) -> list[tuple[Traversable, Path]]:
    """The template files below a folder, with the path that each is written to."""
    found: list[tuple[Traversable, Path]] = []
    for item in sorted(folder.iterdir(), key=lambda item: item.name):
        name = item.name.removesuffix(_SUFFIX)
        target = path / places.get(name, name)
        if item.is_dir() and not name.startswith("__"):
            found += _templates(item, target, places)
        elif item.name.endswith(_SUFFIX):
            found.append((item, target))
    return found
