"""URDFs as their makers give them: xacro files are expanded, and the text is edited without moving its lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any, Final
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from errand_make.robots.checks import check_mimics, first_xacro
from plant.robots.urdf_robot.urdf_file import UrdfFile, is_xacro, read_urdf_text
from skills.inputs.errors import InputError

_LINE: Final = "line"


def read_source(path: Path, packages: Mapping[str, Path]) -> UrdfFile:
    """Reads a URDF, or a xacro file that the package `xacro` expands; lines of the latter are those of its expansion.

    Raises InputError.
    """
    text = read_urdf_text(path)
    urdf = UrdfFile(path, _expanded(path, text, packages) if is_xacro(text) else text)
    check_mimics(urdf)
    return urdf


def _expanded(path: Path, text: str, packages: Mapping[str, Path]) -> str:
    """Expansion of a xacro file. Raises InputError."""
    line, found = first_xacro(text)
    try:
        xacro, arguments = import_module("xacro"), import_module("xacro.substitution_args")
    except ImportError as error:
        hint = f"install it by `pip install xacro`, or expand the file where ROS is: `xacro {path.name} > robot.urdf`"
        what = f"it is a xacro file ({found}), and the package xacro is not installed"
        raise InputError(what, hint=hint, file=path, line=line) from error
    missing = list[str]()
    with _finding(arguments, packages, path, missing):
        try:
            return str(xacro.process_file(str(path)).toprettyxml(indent=" "))
        except Exception as error:  # xacro evaluates the file's own expressions
            what = f"xacro does not expand it, from {found} on: {str(error)[:200]}"
            hint = "correct it, or expand it where ROS is"
            if missing:
                what = f"there is no folder of package '{missing[0]}'"
                hint = f"give its folder: --package {missing[0]}=DIR"
            raise InputError(what, hint=hint, file=path, line=line) from error


@contextmanager
def _finding(arguments: Any, packages: Mapping[str, Path], path: Path, missing: list[str]) -> Iterator[None]:
    """Lets `$(find NAME)` give the folder of a package without an installation of ROS; collects those `missing`."""

    def find(name: str) -> str:
        found = packages.get(name) or package_folder(name, path)
        if found is None:
            missing.append(name)
            raise LookupError(name)
        return str(found)

    before = arguments._eval_find
    arguments._eval_find = find
    try:
        yield
    finally:
        arguments._eval_find = before


def package_folder(name: str, path: Path) -> Path | None:
    """Folder of a package around a file: one with its name, or beside one."""
    near = (each for folder in path.resolve().parents for each in (folder, folder / name))
    return next((folder for folder in near if folder.name == name and folder.is_dir()), None)


def edited_text(urdf: UrdfFile, links: str = "") -> str:
    """Text of a URDF with the attributes that its elements have now, and with `links` before its end.

    Lines and comments stay, so that errors name the lines of the file that was read.
    """
    text, found = urdf.text.encode(), list[str]()
    before = list(_start_tags(urdf.text))
    at = 0
    for element, (start, attributes) in zip(urdf.robot.iter(), before, strict=True):
        now = {key: value for key, value in element.attrib.items() if key != _LINE}
        if now == attributes:
            continue
        end = text.index(b">", start)
        tag = text[start : end + 1]
        lines = "\n" * tag.count(b"\n")
        words = " ".join(f"{key}={quoteattr(value)}" for key, value in now.items())
        found += [text[at:start].decode(), f"<{element.tag} {words}{lines}{'/' if tag.endswith(b'/>') else ''}>"]
        at = end + 1
    whole = "".join(found) + text[at:].decode()
    head, end_tag, tail = whole.rpartition("</robot>")
    return f"{head}{links}{end_tag}{tail}"


def _start_tags(text: str) -> Iterator[tuple[int, dict[str, str]]]:
    """Offset in bytes and attributes of each start tag."""
    parser, found = expat.ParserCreate(), list[tuple[int, dict[str, str]]]()

    def begin(_: str, attributes: dict[str, str]) -> None:
        found.append((parser.CurrentByteIndex, attributes))

    parser.StartElementHandler = begin
    parser.Parse(text.encode(), True)
    yield from found
