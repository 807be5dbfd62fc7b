"""`errand new` writes an installable package with a skill or a task; plug-ins add packages of other kinds."""

from __future__ import annotations

import keyword
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Annotated, Final

import typer

from skills.inputs.errors import InputError
from skills.inputs.outside import writing

_SUFFIX: Final = ".template"
_NAME: Final = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")

new = typer.Typer(name="new", help="Packages of your own: a skill, a task, or a robot.", rich_markup_mode=None)


@new.callback()
def _group() -> None:
    """Packages of your own: a skill, a task, or a robot."""


@new.command()
def skill(
    name: Annotated[str, typer.Argument(help="Name of the skill: lower-case words joined by _.")],
    folder: Annotated[Path, typer.Argument(help="New folder for the package.")],
) -> None:
    """Writes an installable package with one skill, its tests and its registration."""
    from executive.tree.registry import installed_skills

    show_package(render_skill(name, folder, taken=frozenset(installed_skills().names)), folder)


@new.command()
def task(
    name: Annotated[str, typer.Argument(help="Word of the task: a verb in lower case.")],
    folder: Annotated[Path, typer.Argument(help="New folder for the package.")],
) -> None:
    """Writes an installable package with one task, its test and its registration."""
    show_package(render_task(name, folder), folder)


@dataclass(frozen=True)
class PackageTemplates:
    """Templates for an installable package that contains one part of a kind, for example a skill.

    In each file `*.template` of `folder`, `$name`, `$dashed`, `$package` and the values given to `render` are replaced;
    the folder `package` gets the package's name.
    """

    kind: str
    folder: Path

    def check(self, name: str, taken: Collection[str]) -> None:
        """Raises InputError if a part cannot have this name, or if a part already has it."""
        if not _NAME.fullmatch(name) or keyword.iskeyword(name):
            hint = "use lower-case words joined by _, as in wave_arm"
            raise InputError(f"'{name}' cannot be the name of a {self.kind}", hint=hint)
        if name in taken:
            raise InputError(f"a {self.kind} '{name}' exists already", hint="choose another name")

    def package(self, name: str) -> str:
        """Returns the name of the Python package that contains a part."""
        return f"errand_{self.kind}_{name}"

    def render(
        self,
        name: str,
        target: Path,
        *,
        words: Mapping[str, str],
        renamed: Mapping[str, str] | None = None,
        without: Collection[str] = (),
    ) -> tuple[Path, ...]:
        """Writes the package of a part into a folder, `renamed` files under other names; returns the files.

        Raises InputError if they cannot be written.
        """
        package = self.package(name)
        values = {"name": name, "dashed": name.replace("_", "-"), "package": package, **words}
        written, names = list[Path](), {"package": package, **(renamed or {})}
        with writing(target, "name another folder"):
            for template in sorted(self.folder.rglob(f"*{_SUFFIX}")):
                parts = template.relative_to(self.folder).with_name(template.name.removesuffix(_SUFFIX)).parts
                if parts[-1] in without:
                    continue
                file = target.joinpath(*(names.get(part, part) for part in parts))
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(Template(template.read_text(encoding="utf-8")).substitute(values), encoding="utf-8")
                written.append(file)
        return tuple(written)


def show_package(written: Collection[Path], folder: Path) -> None:
    """Prints the files of a new package, and how to install and test it."""
    for path in written:
        typer.echo(str(path))
    typer.echo(f"\nNext:\n  pip install --no-build-isolation --editable {folder}\n  pytest {folder}")


_SKILL: Final = PackageTemplates("skill", Path(__file__).parent / "new/skill")
_TASK: Final = PackageTemplates("task", Path(__file__).parent / "new/task")


def render_skill(name: str, folder: Path, *, taken: frozenset[str] = frozenset()) -> tuple[Path, ...]:
    """Writes a package with the skill `name` into a new folder; returns the files.

    Raises:
        InputError: the name is not allowed or is taken, or the folder is not empty or cannot be written.
    """
    renamed = {"skill.skilltest.yaml": f"{name}.skilltest.yaml", "test_skill.py": f"test_{name}.py"}
    return _render(_SKILL, name, folder, taken, renamed)


def render_task(name: str, folder: Path) -> tuple[Path, ...]:
    """Writes a package with the task `name` into a new folder; returns the files. Raises InputError like a skill's."""
    from executive.words.steps import STEP_KEYS
    from executive.words.task import installed_tasks

    renamed = {"page.py": f"{_TASK.package(name)}.py", "test_task.py": f"test_{name}.py"}
    taken = frozenset(installed_tasks())
    step = "missions have a step of this name" if name in STEP_KEYS else None
    if name not in taken and (why := step or _unsayable(name.replace("_", " "))):
        raise InputError(f"'{name}' cannot be the name of a task: {why}", hint="choose a verb, as in 'sweep_up'")
    return _render(_TASK, name, folder, taken, renamed)


def _unsayable(spoken: str) -> str | None:
    """Returns why the words of a new task cannot be said; None if they can."""
    import executive
    from executive.language.clauses import cut, trailing_cue

    said = f"{spoken} the kitchen"
    for sentence in (said, spoken, f"{spoken} every room", f"{spoken} the beer"):
        if executive.parse(sentence).all_steps:
            return f"'{sentence}' is a sentence of Errand already"
    whole = [clause.text for clause in cut(said)] == [said] and trailing_cue(said) is None
    return None if whole else f"'{said}' is no plain request"


def _render(
    templates: PackageTemplates, name: str, folder: Path, taken: Collection[str], renamed: Mapping[str, str]
) -> tuple[Path, ...]:
    templates.check(name, taken)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder} exists and is not empty", hint="name a new folder")
    spoken = name.replace("_", " ")
    words = {"class_name": spoken.title().replace(" ", ""), "spoken": spoken}
    return templates.render(name, folder, words=words, renamed=renamed)
