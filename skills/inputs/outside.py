"""Guarded reading and writing: plain files below a size, texts that a user types or says, and JSON."""

import json
import os
import re
import stat
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, Final

from skills.inputs.errors import InputError

TEXT_BYTES: Final = 1_000_000
"""Most bytes of a text, unless a reader sets another limit."""
_LARGE_FILE: Final = b"version https://git-lfs.github.com/spec/"
_COMPRESSED: Final = {b"\x1f\x8b": "gunzip", b"BZh": "bunzip2", b"\xfd7zXZ": "unxz", b"\x28\xb5\x2f\xfd": "unzstd"}
_ADDRESS: Final = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")
_UTF16: Final = (b"\xff\xfe", b"\xfe\xff")
_UTF8_MARK: Final = b"\xef\xbb\xbf"
_HIDDEN: Final = 100
"""Letters of a name that an error shows."""


def is_file(path: Path) -> bool:
    """Returns whether a plain file exists at a path; False when the system refuses the name or the folder."""
    return os.path.isfile(path)  # noqa: PTH113 (Path.is_file raises for a name that is too long)


def is_folder(path: Path) -> bool:
    """Returns whether a folder exists at a path; False as for `is_file`."""
    return os.path.isdir(path)  # noqa: PTH112 (Path.is_dir raises for a name that is too long)


def is_there(path: Path) -> bool:
    """Returns whether a path exists; False as for `is_file`."""
    return os.path.exists(path)  # noqa: PTH110 (Path.exists raises for a name that is too long)


@contextmanager
def writing(file: Path, hint: str = "name another file") -> Iterator[None]:
    """Raises InputError when the block cannot write a file or folder that the user names."""
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot write it ({error.strerror})", hint=hint, file=file) from error


def read_bytes(file: Path, *, most_bytes: int, hint: str = "name a file that exists", line: int | None = None) -> bytes:
    """Reads a plain file of at most `most_bytes`. Never waits for a pipe or a device.

    Raises:
        InputError: the file is missing, no plain file, too large, or a pointer of Git LFS. `hint` is for a missing
            file, `line` for files that have lines.
    """
    with _opened(file, hint, line) as stream:
        content = stream.read(most_bytes + 1)
    _refuse_content(content, file, most_bytes, line)
    return content


def plain_file(file: Path, *, most_bytes: int, hint: str = "name a file that exists") -> None:
    """Checks a file that a library will read. Raises InputError as `read_bytes` does."""
    with _opened(file, hint) as stream:
        head, size = stream.read(len(_LARGE_FILE)), os.fstat(stream.fileno()).st_size
    if size > most_bytes:
        raise _too_large(file, most_bytes)
    _refuse_content(head, file, most_bytes)


def read_text(file: Path, *, most_bytes: int = TEXT_BYTES, hint: str = "name a file that exists") -> str:
    """Reads a UTF-8 file, with or without a byte order mark; its lines end with line feeds.

    Raises:
        InputError: as `read_bytes`, and for other encodings.
    """
    content = read_bytes(file, most_bytes=most_bytes, hint=hint, line=1)
    if content.startswith(_UTF16):
        raise InputError("it is UTF-16 text", hint="save it as UTF-8", file=file, line=1)
    try:
        text = content.removeprefix(_UTF8_MARK).decode("utf-8")
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise InputError("it is no UTF-8 text", hint="save it as UTF-8", file=file, line=line) from error
    return text.replace("\r\n", "\n")


def file_beside(naming: Path, name: str, *, home: Path | None = None) -> Path:
    """Path of the file `name` that the file `naming` names.

    It must lie in the folder `home`, or below; the default is the folder of `naming`.

    Raises:
        InputError: the name is an address or no name of a file, or leads out of that folder.
    """
    folder = (home or naming.parent).resolve()
    shown = f"'{name[:_HIDDEN]}'"
    if _ADDRESS.match(name) or "\0" in name or not name.strip():
        hint = f"put the file into {folder.name or folder} and write its name"
        raise InputError(f"{shown} is no name of a file", hint=hint, file=naming)
    try:
        found = (naming.parent / name).resolve()
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"{shown} is no name of a file", hint="shorten or correct it", file=naming) from error
    if not found.is_relative_to(folder):
        hint = f"put the file into {folder.name or folder} or a folder in it"
        raise InputError(f"{shown} leads out of the folder {folder.name or folder}", hint=hint, file=naming)
    return naming.parent / name


@contextmanager
def native_stderr_dropped() -> Iterator[None]:
    """Drops what a native library writes to the process's stderr about a file whose errors it also returns."""
    with os.fdopen(os.dup(2), "wb") as stderr, Path(os.devnull).open("wb") as nowhere:
        try:
            os.dup2(nowhere.fileno(), 2)
            yield
        finally:
            os.dup2(stderr.fileno(), 2)


@contextmanager
def _opened(file: Path, hint: str, line: int | None = None) -> Iterator[BinaryIO]:
    """Opens a plain file. Raises InputError for a missing file, a folder, a pipe or a device."""
    try:
        mode = file.stat().st_mode
        if stat.S_ISDIR(mode):
            raise InputError("it is a folder", hint="name a file in it", file=file)
        if not stat.S_ISREG(mode):
            raise InputError("it is a pipe or a device", hint="name a plain file", file=file, line=line)
        with os.fdopen(os.open(file, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as stream:
            yield stream
    except FileNotFoundError as error:
        raise InputError("there is no such file", hint=hint, file=file) from error
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else "its name is no name of a file"
        raise InputError(f"cannot read it ({why})", hint=hint, file=file) from error


def _refuse_content(content: bytes, file: Path, most_bytes: int, line: int | None = None) -> None:
    if len(content) > most_bytes:
        raise _too_large(file, most_bytes, line)
    for head, command in _COMPRESSED.items():
        if content.startswith(head):
            raise InputError("it is compressed", hint=f"unpack it: {command} {file.name}", file=file, line=line)
    if content.startswith(_LARGE_FILE):
        what = "it is a pointer of Git LFS, and the file itself is not there"
        raise InputError(what, hint="fetch it by `git lfs pull`", file=file, line=line)


def _too_large(file: Path, most_bytes: int, line: int | None = None) -> InputError:
    what = f"it is too large (at most {most_bytes} bytes are read)"
    return InputError(what, hint="make it smaller", file=file, line=line)


LONGEST_TEXT: Final = 2000
LONGEST_ANSWER: Final = 300
"""Most letters of an answer, so that a robot can still say a sentence with it."""
_BLANKS: Final = frozenset("\t\n\r")
_SHOWN: Final = 40


def plain_text(text: str, *, what: str, longest: int = LONGEST_TEXT) -> str:
    """Checks a text and strips its blanks; `what` names it in the error, as in "the answer".

    Raises:
        InputError: it is too long, or holds control characters or halves of characters.
    """
    if len(text) > longest:
        hint = f"{longest} letters at most"
        raise InputError(f"{what} has {len(text)} letters", hint=hint)
    wrong = next((c for c in text if c not in _BLANKS and unicodedata.category(c) in ("Cc", "Cs")), None)
    if wrong is not None:
        kind = "half of a character" if unicodedata.category(wrong) == "Cs" else "a control character"
        shown = "".join(letter if letter.isprintable() else "?" for letter in text[:_SHOWN])
        raise InputError(f"{what} '{shown}' holds {kind} (U+{ord(wrong):04X})", hint="leave it out")
    return text.strip()


def json_object(content: bytes, *, what: str, hint: str) -> dict[str, Any]:
    """Parses a JSON object; an empty text is an empty object. `what` names it in the error, as in "the values".

    Raises:
        InputError: it is no object, is nested too deep, has a key twice, or holds a number or a text of no use.
    """

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        """Object of keys and values."""
        keys = [key for key, _ in pairs]
        if twice := next((key for key in keys if keys.count(key) > 1), ""):
            raise InputError(f"{what} have '{twice[:60]}' twice", hint="give it once")
        return dict(pairs)

    try:
        values = json.loads(content, object_pairs_hook=once) if content.strip() else {}
        json.dumps(values, ensure_ascii=False).encode()  # halves of characters cannot be sent back
    except (ValueError, RecursionError):
        values = None
    if not isinstance(values, dict):
        raise InputError(f"{what} are no JSON object", hint=hint)
    return values
