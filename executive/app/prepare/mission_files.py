"""Finds mission files, the shipped ones by name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from skills.inputs.errors import InputError, nearest_name
from skills.inputs.outside import is_there

if TYPE_CHECKING:
    from typing import Unpack

    from executive.mission.request import Request, RequestFields


FOLDER: Final = Path(__file__).resolve().parents[3] / "missions"


def shipped_missions() -> dict[str, Path]:
    """Returns the files of the shipped missions by name."""
    return {file.stem: file for file in sorted(FOLDER.glob("*.yaml"))}


def request_of(mission: Request | str | Path, **fields: Unpack[RequestFields]) -> Request:
    """Returns the request for a sentence, a file or a shipped mission's name. Raises InputError for a wrong field."""
    from executive.mission.request import Request, with_fields

    if isinstance(mission, Request):
        return with_fields(mission, fields)
    is_file = isinstance(mission, Path) or mission.endswith((".yaml", ".yml")) or mission in shipped_missions()
    return with_fields(Request(file=Path(mission)) if is_file else Request(str(mission)), fields)


def mission_file(named: Path) -> Path:
    """Returns the file itself if it exists, else the shipped mission of that name.

    Raises:
        InputError: neither exists, and the name has no folder.
    """
    if is_there(named) or named.parent not in (Path(), Path(FOLDER.name)):
        return named
    known = shipped_missions()
    if named.stem in known and named.suffix in ("", ".yaml"):
        return known[named.stem]
    if named.suffix:
        return named
    near = nearest_name(named.name, known)
    hint = f"did you mean '{near}'?" if near else "`errand missions` lists the missions that come with Errand"
    raise InputError("there is no such mission", hint=hint, file=named)
