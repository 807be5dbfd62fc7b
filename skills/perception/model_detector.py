"""Detector that knows own objects by their models, besides the classes of its networks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from skills.detection import Detection, Detector
from skills.files.object_model import ObjectModel


class ModelDetector:
    """Networks that judge pictures, and `models`, with which the skills compare segments (`model_matching.py`)."""

    def __init__(self, networks: Detector, models: Iterable[ObjectModel]) -> None:
        """Takes over all methods of the networks that detect."""
        self._networks = networks
        self.models: Mapping[str, ObjectModel] = MappingProxyType({model.name: model for model in models})
        for name in dir(networks):
            if name.startswith("detect_"):
                setattr(self, name, getattr(networks, name))

    @property
    def class_names(self) -> tuple[str, ...]:
        """Classes of the networks."""
        return self._networks.class_names

    def detect(self, pictures: Sequence[NDArray[np.uint8]]) -> list[tuple[Detection, ...]]:
        """Returns the detections of the networks."""
        return self._networks.detect(pictures)


@runtime_checkable
class _HasModels(Protocol):
    models: Mapping[str, ObjectModel]


def models_of(detector: Any) -> Mapping[str, ObjectModel]:
    """Models of own objects that a detector has, by name."""
    return detector.models if isinstance(detector, _HasModels) else MappingProxyType({})
