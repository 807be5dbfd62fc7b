"""Checks the files of a world's geometry before Drake reads them: directives, models, meshes and textures.

Drake opens every file to which another file refers, even a pipe, an address or the same file again. So all files of a
user's world are checked first. Files of the plant itself are trusted.
"""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final
from xml.parsers import expat

from skills.inputs.errors import InputError
from skills.inputs.outside import file_beside, is_there, plain_file, read_text
from skills.inputs.yaml_source import read_yaml

OURS: Final = Path(__file__).resolve().parent.parent
OWN_PACKAGE: Final = "world"
"""Package of a world's own folder, wherever that is."""
TAGS: Final = frozenset(
    f"!{name}"
    for name in ("Rpy", "AngleAxis", "Identity", "Uniform", "Deterministic", "Gaussian", "UniformDiscrete")
    + ("DeterministicVector", "GaussianVector", "UniformVector")
)
"""Tags of Drake's directives."""
MOST_MESH_BYTES: Final = 200_000_000
MOST_MODEL_BYTES: Final = 20_000_000
MOST_FILES: Final = 2_000
MOST_XML_DEPTH: Final = 60
MOST_CHAIN: Final = 20
_BESIDE: Final = "put it beside the file that names it"
_PACKAGES: Final = (OWN_PACKAGE, "errand", "drake")
_IN_PACKAGE: Final = re.compile(r"(?:package|model)://([^/]*)/?(.*)", re.DOTALL)
_NAMING: Final = frozenset({"uri", "filename", "albedo_map", "normal_map", "diffuse_map"})
"""Elements whose text names a file."""
_NAMING_IN_IMAGE: Final = frozenset({"init_from", "ref"})
"""Elements of COLLADA whose text names a file if they stand in an image."""
_ATTRIBUTES: Final = frozenset({"filename", "file"})
_PICTURES: Final = frozenset({".png", ".jpg", ".jpeg", ".bmp"})
_MAP: Final = re.compile(
    r"^\s*(?:map_\w+|bump|norm|disp|decal|refl)\s+(?:-\S+(?:\s+[-\d.]+)*\s+)*(\S.*?)\s*$", re.MULTILINE
)
_LIBRARY: Final = re.compile(rb"^\s*mtllib\s+(\S[^\r\n]*)", re.MULTILINE)


def check_directives(file: Path, home: Path) -> None:
    """Checks Drake model directives and all files that they name, in the folder `home`.

    Raises:
        InputError: a file is missing, no plain file, too large, outside, broken, or names itself; with file and line.
    """
    _Walk(home.resolve()).directives(file, ())


def check_model(file: Path, home: Path, lacking: list[str] | None = None) -> None:
    """Checks a model file and all files to which it refers, in the folder `home`; raises like `check_directives`.

    With a list `lacking`, adds the names of missing files to the list instead.
    """
    _Walk(home.resolve(), lacking).model(file, ())


@dataclass
class _Walk:
    """Recursive check of files: each file once, directives each time that a file refers to them."""

    home: Path
    lacking: list[str] | None = None
    done: set[Path] = field(default_factory=set)
    files: int = 0

    def directives(self, file: Path, chain: tuple[Path, ...]) -> None:
        """Checks directives; `chain` are the files that led to them, each referring to the next."""
        source = read_yaml(file, TAGS)
        listed = source.data.get("directives") if isinstance(source.data, dict) else None
        if not isinstance(listed, list):
            raise InputError("it has no list 'directives'", hint="see docs/how-to/own-world.md", file=file, line=1)
        for index, each in enumerate(listed):
            for kind, given in each.items() if isinstance(each, dict) else ():
                name = given.get("file") if isinstance(given, dict) else None
                if kind not in ("add_model", "add_directives") or name is None:
                    continue
                place = ("directives", index, kind, "file")
                self._follow(file, source.line(place), name, (*chain, file.resolve()), kind == "add_directives")

    def model(self, file: Path, chain: tuple[Path, ...]) -> None:
        """Checks a model, mesh or picture; `chain` are the files that led to it, each referring to the next."""
        kind = file.suffix.lower()
        if kind in _PICTURES:
            from skills.inputs.picture_files import check_picture  # brings OpenCV, which most commands do not need

            check_picture(file)
            return
        named = _NAMED.get(kind)
        if named is None:
            plain_file(file, most_bytes=MOST_MESH_BYTES, hint=_BESIDE)
            return
        for line, name in named(file):
            self._follow(file, line, name, (*chain, file.resolve()), False)

    def _follow(self, file: Path, line: int | None, name: object, chain: tuple[Path, ...], directives: bool) -> None:
        """Checks the file to which a line of `file` refers."""

        def error(what: str, hint: str) -> InputError:
            return InputError(what, hint=hint, file=file, line=line)

        if self.lacking is not None and not is_there(file.parent / str(name)):
            self.lacking.append(str(name)[:100])
            return
        try:
            found = self._found(file, str(name))
        except InputError as wrong:
            raise error(wrong.message, wrong.hint) from wrong
        if found is None:
            return
        real = found.resolve()
        if real in chain:
            raise error(f"{found.name} includes itself", "break the circle")
        self.files += 1
        if self.files > MOST_FILES or len(chain) > MOST_CHAIN:
            raise error("its files name too many other files", "merge them into fewer files")
        if not directives and real in self.done:
            return
        self.done.add(real)
        try:
            self.directives(found, chain) if directives else self.model(found, chain)
        except InputError as wrong:
            if wrong.file == found and wrong.line is None:
                raise error(f"{name}: {wrong.message}", wrong.hint) from wrong
            raise

    def _found(self, file: Path, name: str) -> Path | None:
        """Resolves a name in `file`; None for a file of the plant or of Drake. Raises InputError for a missing file."""
        in_package = _IN_PACKAGE.match(name)
        if in_package is None:
            beside = name.removeprefix("file://") if name.startswith("file:///") else name
            return None if _is_ours(file.parent / beside) else file_beside(file, beside, home=self.home)
        package, path = in_package[1], in_package[2]
        if package not in _PACKAGES:
            hint = f"put the file into the world's folder and write package://{OWN_PACKAGE}/..."
            raise InputError(f"there is no package {package[:60]!r}", hint=hint)
        if package == OWN_PACKAGE:
            return file_beside(self.home / file.name, path, home=self.home)
        if package == "errand" and not (OURS / path).is_file():
            raise InputError(f"there is no file {name[:100]!r}", hint="correct the name")
        return None


def _is_ours(path: Path) -> bool:
    """Returns whether a file belongs to the plant."""
    try:
        return path.resolve().is_relative_to(OURS) and path.is_file()
    except (OSError, ValueError, RuntimeError):
        return False


def _named_in_xml(file: Path) -> Iterator[tuple[int, str]]:
    """Yields lines and names of the files to which an SDF, URDF, MJCF or COLLADA file refers."""
    most_bytes = MOST_MESH_BYTES if file.suffix.lower() == ".dae" else MOST_MODEL_BYTES
    text = read_text(file, most_bytes=most_bytes, hint=_BESIDE)
    found, open_elements, letters = list[tuple[int, str]](), list[str](), list[str]()
    parser = expat.ParserCreate()

    def error(what: str, hint: str) -> InputError:
        return InputError(what, hint=hint, file=file, line=parser.CurrentLineNumber)

    def begin(name: str, attributes: Mapping[str, str]) -> None:
        if len(open_elements) >= MOST_XML_DEPTH:
            raise error(f"it is nested more than {MOST_XML_DEPTH} deep", "nest it less deeply")
        open_elements.append(name)
        letters.clear()
        found.extend((parser.CurrentLineNumber, attributes[each]) for each in _ATTRIBUTES & attributes.keys())

    def end(name: str) -> None:
        open_elements.pop()
        plain = name.rpartition(":")[2]
        naming = plain in _NAMING or (plain in _NAMING_IN_IMAGE and "image" in open_elements)
        if naming and (text := "".join(letters).strip()):
            found.append((parser.CurrentLineNumber, text))
        letters.clear()

    def refuse_types(*_: object) -> None:
        raise error("it declares document types", "remove <!DOCTYPE ...>")

    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = letters.append, refuse_types
    try:
        parser.Parse(text.encode(), True)
    except expat.ExpatError as wrong:
        what = f"broken XML: {expat.ErrorString(wrong.code)}"
        raise InputError(what, hint="correct it here", file=file, line=wrong.lineno) from wrong
    yield from found


def _named_in_obj(file: Path) -> Iterator[tuple[None, str]]:
    plain_file(file, most_bytes=MOST_MESH_BYTES, hint=_BESIDE)
    for match in _LIBRARY.finditer(file.read_bytes()):
        yield None, match[1].decode("utf-8", "replace").strip()


def _named_in_mtl(file: Path) -> Iterator[tuple[int, str]]:
    text = read_text(file, hint=_BESIDE)
    for match in _MAP.finditer(text):
        yield text.count("\n", 0, match.start(1)) + 1, match[1]


def _named_in_gltf(file: Path) -> Iterator[tuple[None, str]]:
    try:
        document: Any = json.loads(read_text(file, most_bytes=MOST_MESH_BYTES))
        entries = [each for kind in ("buffers", "images") for each in document.get(kind, ())]
        names = [str(each["uri"]) for each in entries if "uri" in each]
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        raise InputError("it is no glTF", hint="export it once more", file=file, line=1) from error
    yield from ((None, name) for name in names if not name.startswith("data:"))


_NAMED: Final[Mapping[str, Callable[[Path], Iterator[tuple[int | None, str]]]]] = MappingProxyType(
    {
        ".sdf": _named_in_xml,
        ".urdf": _named_in_xml,
        ".xml": _named_in_xml,
        ".dae": _named_in_xml,
        ".obj": _named_in_obj,
        ".mtl": _named_in_mtl,
        ".gltf": _named_in_gltf,
    }
)
