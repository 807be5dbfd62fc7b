"""Classes of objects in `plant/models`, imported objects, and cached folders of models."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Final

from pydantic import BaseModel, ConfigDict, Field

from skills.inputs.errors import InputError
from skills.inputs.plugins import class_entries
from skills.inputs.schema import Strict, matching, validate
from skills.inputs.yaml_source import read_yaml, yaml_of
from skills.robot import quantities

CATALOGUE: Final = "catalogue.yaml"
MODELS_FOLDER = Path(__file__).resolve().parent


class ModelForm(Strict):
    """One form of a class: its SDF file, its outline from above, and its resting height (m)."""

    file: str
    half_extents_m: tuple[float, float]
    rest_height_m: float
    round: bool = False

    @property
    def sides_m(self) -> tuple[float, float, float]:
        """Length, width and height of the object at rest."""
        return 2.0 * self.half_extents_m[0], 2.0 * self.half_extents_m[1], 2.0 * self.rest_height_m

    def path(self) -> Path:
        """Path of the SDF file."""
        return MODELS_FOLDER / self.file


class ModelClass(Strict):
    """One class: its id (0 is Nothing), and its forms by name."""

    id: int
    forms: dict[str, ModelForm] = Field(min_length=1)

    def placed_in(self, folder: Path) -> ModelClass:
        """Returns the class with its files in another folder than the project's."""
        forms = {name: form.model_copy(update={"file": str(folder / form.file)}) for name, form in self.forms.items()}
        return self.model_copy(update={"forms": forms})


@cache
def load_catalogue() -> Mapping[str, ModelClass]:
    """Reads all classes by name, with those from other distributions; cached. Raises InputError when one is broken."""
    entries = read_yaml(MODELS_FOLDER / CATALOGUE).data
    found = {name: ModelClass.model_validate(entry) for name, entry in entries.items()}
    for file, classes in class_entries(CATALOGUE, ModelClass):
        found = {**{name: each.placed_in(file.parent) for name, each in classes.items()}, **found}
    return MappingProxyType(found)


FACTS_FILE: Final = "object.yaml"
_AGAIN: Final = "make it by `errand object import`"
OBJECT_NAME: Final = r"^[A-Za-z][A-Za-z0-9_]{0,39}$"
"""Pattern of the names of imported objects."""
_ObjectName = Annotated[
    str, matching(OBJECT_NAME, "should be a name", "write letters, digits and _, a letter first, at most 40")
]
Inertia = Annotated[float, quantities.Quantity(ge=-1e6, le=1e6)]
Photographs = Annotated[int, quantities.Quantity(ge=0, le=1000)]
Parts = Annotated[int, quantities.Quantity(ge=1, le=10_000_000)]


class ImportedObject(BaseModel):
    """One imported object: `class` is its detector class, by default the object's own name.

    The origin of its frame is the centre of the bounding box `size_m`, with z up as the object rests. `inertia_kg_m2`
    is xx, yy, zz, xy, xz, yz about its centre of mass. With `photographs`, a box represents the object, which has no
    mesh.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True, allow_inf_nan=False)

    name: _ObjectName
    class_name: Annotated[_ObjectName, Field(alias="class")]
    mass_kg: quantities.Mass
    size_m: tuple[quantities.Length, quantities.Length, quantities.Length]
    com_m: tuple[quantities.Coordinate, quantities.Coordinate, quantities.Coordinate]
    inertia_kg_m2: tuple[Inertia, Inertia, Inertia, Inertia, Inertia, Inertia]
    collision_parts: Parts
    triangles: Parts
    round: bool = False
    photographs: Photographs = 0

    def form(self, folder: Path) -> ModelForm:
        """Form of the object, with its files in a folder."""
        x, y, z = self.size_m
        file = str((folder / f"{self.name}.sdf").resolve())
        return ModelForm(file=file, half_extents_m=(x / 2, y / 2), rest_height_m=z / 2, round=self.round)

    def write(self, folder: Path) -> None:
        """Writes the object's facts into a folder, from which `read_imported` reads them."""
        text = yaml_of(self.model_dump(mode="json", by_alias=True))
        (folder / FACTS_FILE).write_text(f"# Made by `errand object import`, don't edit.\n{text}", encoding="utf-8")


def read_imported(folder: Path) -> ImportedObject:
    """Reads the object in a folder. Raises InputError when the file is missing or damaged."""
    path = folder / FACTS_FILE
    if not path.exists():
        raise InputError(f"{folder}: there is no imported object ({FACTS_FILE} is missing)", hint=_AGAIN)
    try:
        found = validate(ImportedObject, read_yaml(path))
    except InputError as error:
        raise InputError(error.message, hint=f"{error.hint}, or {_AGAIN}", file=path, line=error.line) from error
    if not (folder / f"{found.name}.sdf").is_file():
        raise InputError(f"{found.name}.sdf is missing", hint=_AGAIN, file=folder)
    return found


def user_cache() -> Path:
    """Folder of the project in the user's cache."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "errand"


def cached_folder(folder: Path, fill: Callable[[Path], None]) -> Path:
    """Returns a folder that `fill` fills once; it becomes visible only when complete, also with several processes."""
    if folder.is_dir():
        return folder
    folder.parent.mkdir(parents=True, exist_ok=True)
    fresh = Path(tempfile.mkdtemp(prefix=".making-", dir=folder.parent))
    try:
        fill(fresh)
        fresh.chmod(0o755)
        fresh.rename(folder)
    except OSError:
        if not folder.is_dir():
            raise
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    return folder
