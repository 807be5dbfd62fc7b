"""The keys `imports` and `objects` of a mission file: models of your own, and further objects."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import BaseModel, ConfigDict, Field

from skills.files.schema import Name

if TYPE_CHECKING:
    from executive.mission.file.schema import MissionFile

__all__ = ["ObjectFile", "import_folders"]


class ObjectFile(BaseModel):
    """An object that lies there at the beginning."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    model: Name = Field(description="A class of objects, or the name of an imported model.")
    surfaces: Annotated[tuple[Name, ...], Field(min_length=1)] = Field(
        description="Surfaces on which it may lie; the seed chooses one."
    )


def import_folders(file: MissionFile) -> tuple[Path, ...]:
    """The folders of a file's imports."""
    folder = Path() if file.source is None else file.source.path.parent
    return tuple(folder / each for each in file.imports or ())
