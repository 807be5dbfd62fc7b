"""Folders that `errand object import` has written: what they hold, as a form of a class like those of the catalogue."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from plant.models.catalogue import ModelForm

FACTS_FILE: Final = "object.yaml"
MAX_BYTES: Final = 100_000
NAME: Final = r"^[A-Za-z][A-Za-z0-9_]{0,39}$"
Size = Annotated[float, Field(gt=0.0, le=100.0, allow_inf_nan=False)]


class ImportedFolderError(ValueError):
    """A folder is none that `errand object import` has written; the message names it and says what to do."""


class ImportedObject(BaseModel):
    """One imported object: `class` is what a detector takes it for, its own name where no class was given.

    Its frame has the origin in the centre of the bounding box `size_m`, z up as it rests; `inertia_kg_m2` is xx, yy,
    zz, xy, xz, yz about its centre of mass.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True, allow_inf_nan=False)

    name: Annotated[str, Field(pattern=NAME)]
    class_name: Annotated[str, Field(alias="class", pattern=NAME)]
    mass_kg: Annotated[float, Field(gt=0.0)]
    size_m: tuple[Size, Size, Size]
    com_m: tuple[float, float, float]
    inertia_kg_m2: tuple[float, float, float, float, float, float]
    collision_parts: Annotated[int, Field(ge=1)]
    triangles: Annotated[int, Field(ge=1)]
    round: bool = False

    def form(self, folder: Path) -> ModelForm:
        """Its form, with its files in a folder."""
        x, y, z = self.size_m
        file = str((folder / f"{self.name}.sdf").resolve())
        return ModelForm(file=file, half_extents_m=(x / 2, y / 2), rest_height_m=z / 2, round=self.round)


def read_imported(folder: Path) -> ImportedObject:
    """The object in a folder. Raises ImportedFolderError."""
    path, again = folder / FACTS_FILE, "make it by `errand object import`"
    try:
        if not path.is_file():
            raise ImportedFolderError(f"{folder}: there is no imported object ({FACTS_FILE} is missing); {again}")
        with path.open("rb") as opened:
            text = opened.read(MAX_BYTES + 1)
        if len(text) > MAX_BYTES:
            raise ImportedFolderError(f"{path}: it is larger than {MAX_BYTES} bytes; {again}")
        found = ImportedObject.model_validate(yaml.safe_load(text.decode("utf-8")))
        if not (folder / f"{found.name}.sdf").is_file():
            raise ImportedFolderError(f"{folder}: {found.name}.sdf is missing; {again}")
    except OSError as error:
        raise ImportedFolderError(f"{path}: it cannot be read ({error.strerror}); {again}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "it"
        raise ImportedFolderError(f"{path}: {where}: {first['msg']}; {again}") from error
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise ImportedFolderError(f"{path}: it cannot be read as YAML; {again}") from error
    return found


def write_imported(folder: Path, made: ImportedObject) -> None:
    """Write what `read_imported` reads."""
    text = yaml.safe_dump(made.model_dump(mode="json", by_alias=True), sort_keys=False, default_flow_style=None)
    (folder / FACTS_FILE).write_text(f"# Made by `errand object import`, don't edit.\n{text}", encoding="utf-8")
