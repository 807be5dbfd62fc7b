"""The part of a mission file that is being read: its steps, and where each of them stands in the file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from executive.mission.file.schema import MissionFile
from executive.words.steps import KeyPath
from skills.files.errors import InputError, SourceLine
from skills.files.yaml_source import YamlSource

__all__ = ["Scope"]


@dataclass(frozen=True)
class Scope:
    """A file, or one round of a `for_each` in it, whose `source` has the round's value put in.

    `chain` are the files that led here, this one the last.
    """

    file: MissionFile
    source: YamlSource | None
    chain: tuple[Path, ...] = ()

    @property
    def folder(self) -> Path:
        """The folder of the file."""
        return Path() if self.source is None else self.source.path.parent

    def error(self, path: KeyPath, message: str, hint: str) -> InputError:
        """An error in what stands at `path`."""
        return InputError(message, hint=hint) if self.source is None else self.source.error(path, message, hint)

    def line(self, path: KeyPath) -> SourceLine | None:
        """Where `path` stands."""
        return None if self.source is None else SourceLine(self.source.path, self.source.line(path))
