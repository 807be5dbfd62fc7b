"""Mission files of a folder: listed, opened, saved without overwriting, and kept as drafts."""

from __future__ import annotations

import hashlib
import os
import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from skills.inputs.errors import InputError
from skills.inputs.outside import is_file, read_text, writing

MOST_BYTES: Final = 1_000_000
NEW: Final = "name: {name}\nsteps:\n  - to: start\n"
_NAME: Final = re.compile(r"(?:[\w -][\w. -]{0,80}/){0,6}[\w -][\w. -]{0,80}\.ya?ml", re.ASCII)
_DRAFT: Final = ".draft.yaml"


class ConflictError(InputError):
    """Raised when a file is not as it was when it was opened."""


@dataclass(frozen=True)
class Opened:
    """Text of a file, its stamp (empty: there is no file), and an unsaved draft, if a crash has left one."""

    name: str
    text: str
    stamp: str
    draft: str | None = None


class MissionFolder:
    """Folder with mission files, which have names relative to it."""

    def __init__(self, path: Path) -> None:
        self.path = path.resolve()

    def names(self) -> list[str]:
        """Returns the names of the mission files; hidden files, and folders of runs, have none."""
        found = [
            file.relative_to(self.path)
            for pattern in ("*.y*ml", "*/*.y*ml")
            for file in self.path.glob(pattern)
            if file.is_file()
        ]
        return sorted(str(name) for name in found if not any(part.startswith(".") for part in name.parts))

    def file(self, name: str) -> Path:
        """Returns the path of a file. Raises InputError for a name that leads out of the folder."""
        found = self.path / name
        if not _NAME.fullmatch(name) or not found.resolve().is_relative_to(self.path):
            raise InputError("this is no name of a mission file", hint="use letters and digits, and end it with .yaml")
        return found

    def draft_file(self, name: str) -> Path:
        """Returns the path of a file's draft, which lies beside it, so that both find the same other files."""
        file = self.file(name)
        return file.with_name(f".{file.stem}{_DRAFT}")

    def open(self, name: str) -> Opened:
        """Reads a file, and its draft if it differs. Raises InputError if the file cannot be read."""
        text, draft_file = self._read(self.file(name)), self.draft_file(name)
        draft = self._read(draft_file) if is_file(draft_file) else None
        return Opened(name, text, stamp_of(text), None if draft == text else draft)

    def stamp(self, name: str) -> str:
        """Returns the stamp of a file as it is now; empty if it is gone."""
        try:
            return stamp_of(self._read(self.file(name)))
        except InputError:
            return ""

    def save(self, name: str, text: str, stamp: str) -> str:
        """Writes a file whose stamp is still `stamp`, and drops its draft; returns the new stamp.

        Raises ConflictError if another program or browser has changed the file, InputError if it cannot be written.
        """
        if self.stamp(name) != stamp:
            raise ConflictError("the file has changed since you opened it", hint="load it, or overwrite it")
        self._write(self.file(name), text)
        self.drop_draft(name)
        return stamp_of(text)

    def create(self, name: str) -> str:
        """Creates a mission file; returns its name. Raises InputError if there is one, or the name cannot be used."""
        name = name if name.endswith((".yaml", ".yml")) else f"{name}.yaml"
        if self.file(name).exists():
            raise InputError(f"there is a file '{name}' already", hint="choose another name")
        self._write(self.file(name), NEW.format(name=Path(name).stem.replace("_", " ")))
        return name

    def keep_draft(self, name: str, text: str) -> Path:
        """Writes the draft of a file; returns its path. Raises InputError if it cannot be written."""
        self._write(self.draft_file(name), text)
        return self.draft_file(name)

    def drop_draft(self, name: str) -> None:
        """Removes the draft of a file."""
        with suppress(OSError):
            self.draft_file(name).unlink(missing_ok=True)

    def _read(self, file: Path) -> str:
        return read_text(file, most_bytes=MOST_BYTES)

    def _write(self, file: Path, text: str) -> None:
        if len(text) > MOST_BYTES:
            raise InputError(f"the text has more than {MOST_BYTES} letters", hint="make it shorter", file=file)
        beside = file.with_name(f".{file.name}.{os.getpid()}.tmp")
        with writing(file):
            beside.write_text(text, encoding="utf-8", newline="")
            beside.replace(file)


def stamp_of(text: str) -> str:
    """Returns a hash of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]
