"""The catalogue of object classes in `plant/models`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType

from pydantic import BaseModel, ConfigDict, Field

from skills.files.yaml_source import read_yaml

MODELS_FOLDER = Path(__file__).resolve().parent


class ModelForm(BaseModel):
    """One form of a class: its SDF file, its outline seen from above, and its resting height (m)."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    file: str
    half_extents_m: tuple[float, float]
    rest_height_m: float
    round: bool = False

    def path(self) -> Path:
        """The SDF file."""
        return MODELS_FOLDER / self.file


class ModelClass(BaseModel):
    """One class: its id (0 is Nothing), and its forms by name."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    id: int
    forms: dict[str, ModelForm] = Field(min_length=1)


@cache
def load_catalogue() -> Mapping[str, ModelClass]:
    """All classes by name, read once."""
    entries = read_yaml(MODELS_FOLDER / "catalogue.yaml").data
    return MappingProxyType({name: ModelClass.model_validate(entry) for name, entry in entries.items()})
