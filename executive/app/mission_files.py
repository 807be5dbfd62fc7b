"""The files of missions: those that come with Errand, by name, from any folder."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from skills.files.errors import InputError, did_you_mean
from skills.files.outside import is_there

__all__ = ["FOLDER", "mission_file", "shipped_missions"]

FOLDER: Final = Path(__file__).resolve().parents[2] / "missions"


def shipped_missions() -> dict[str, Path]:
    """The files of the missions that come with Errand, by name."""
    return {file.stem: file for file in sorted(FOLDER.glob("*.yaml"))}


def mission_file(named: Path) -> Path:
    """The file itself where it is there, else the shipped mission of that name.

    Raises:
        InputError: a bare name that is neither.
    """
    if is_there(named) or named.parent not in (Path(), Path(FOLDER.name)):
        return named
    known = shipped_missions()
    if named.stem in known and named.suffix in ("", ".yaml"):
        return known[named.stem]
    if named.suffix:
        return named
    near = did_you_mean(named.name, known)
    hint = f"did you mean '{near}'?" if near else "`errand missions` lists those that come with Errand"
    raise InputError("there is no such mission", hint=hint, file=named)
