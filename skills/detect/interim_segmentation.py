"""INTERIM: a detector that takes the things on a surface for what they resemble in size and colour (`appearance.yaml`).

It stands in for the learned detector and looks at surfaces, not at pictures, so it finds nothing elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from skills.api import Detection, Detector
from skills.detect.appearance import load_appearance, score_class
from skills.detect.surface_view import SurfaceView


@runtime_checkable
class SurfaceDetector(Protocol):
    """A detector that needs to be told what stands on the surfaces of a picture."""

    def detect_on(self, views: Sequence[SurfaceView]) -> tuple[Detection, ...]:
        """What is on the surfaces, the surest first."""


@dataclass(frozen=True)
class SurfaceSegmentationDetector:
    """Compares each cluster with each class; a cluster is what it resembles most, or nothing.

    `learned` looks through pictures without surfaces.
    """

    learned: Detector

    @property
    def class_names(self) -> tuple[str, ...]:
        """The classes that it knows."""
        return tuple(load_appearance().classes)

    def detect(self, pictures: Sequence[NDArray[np.uint8]]) -> list[tuple[Detection, ...]]:
        """What the learned detector finds."""
        return self.learned.detect(pictures)

    def detect_on(self, views: Sequence[SurfaceView]) -> tuple[Detection, ...]:
        """What is on the surfaces, the surest first."""
        appearance, found = load_appearance(), []
        for cluster in (cluster for view in views for cluster in view.clusters):
            scores = {
                name: score_class(appearance, name, cluster.shape, cluster.points.colours) for name in self.class_names
            }
            best = max(scores, key=lambda name: scores[name])
            u0, v0, u1, v1 = cluster.box
            if scores[best] >= appearance.accept_score:
                found.append(Detection(best, scores[best], (float(u0), float(v0), float(u1 + 1), float(v1 + 1))))
        return tuple(sorted(found, key=lambda detection: -detection.score))
