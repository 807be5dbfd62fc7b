"""The catalogue of object classes in `plant/models`."""

from __future__ import annotations

from pathlib import Path

import yaml
from pydantic import BaseModel, ConfigDict

MODELS_FOLDER = Path(__file__).resolve().parent


class ModelClass(BaseModel):
    """One class: its id (0 is Nothing) and, where a model exists, its file, outline and resting height (m)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: int
    file: str | None = None
    half_extents_m: tuple[float, float] = (0.0, 0.0)
    rest_height_m: float = 0.0
    round: bool = False

    def path(self) -> Path:
        """The SDF file. Raises FileNotFoundError for a class without a model."""
        if self.file is None:
            raise FileNotFoundError(f"class {self.id} of {MODELS_FOLDER / 'catalogue.yaml'} has no model file")
        return MODELS_FOLDER / self.file


def load_catalogue() -> dict[str, ModelClass]:
    """All classes by name."""
    text = (MODELS_FOLDER / "catalogue.yaml").read_text(encoding="utf-8")
    return {name: ModelClass.model_validate(entry) for name, entry in yaml.load(text, Loader=yaml.CSafeLoader).items()}
