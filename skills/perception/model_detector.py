"""Detector that knows own objects by their models, besides the classes of its networks."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, Protocol, runtime_checkable

from skills.detection import Detector, DetectorWrapper
from skills.files.object_model import ObjectModel


class ModelDetector(DetectorWrapper):
    """Networks that judge pictures, and `models`, with which the skills compare segments (`model_matching.py`)."""

    def __init__(self, networks: Detector, models: Iterable[ObjectModel]) -> None:
        super().__init__(networks)
        self.models: Mapping[str, ObjectModel] = MappingProxyType({model.name: model for model in models})


@runtime_checkable
class _HasModels(Protocol):
    models: Mapping[str, ObjectModel]


def models_of(detector: Any) -> Mapping[str, ObjectModel]:
    """Models of own objects that a detector has, by name."""
    return detector.models if isinstance(detector, _HasModels) else MappingProxyType({})
