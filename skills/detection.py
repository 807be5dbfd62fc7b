"""Interface of a detector, without types of the simulator; skills import these names from `skills.api`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Detection:
    """Detected object in a picture: class, score (0 to 1), and box (u0, v0, u1, v1) in pixels of that picture.

    `alternatives` are the other classes that it may be, with their scores, the likeliest first.
    """

    class_name: str
    score: float
    box: tuple[float, float, float, float]
    alternatives: tuple[tuple[str, float], ...] = ()


class Detector(Protocol):
    """Detects objects of known classes in pictures."""

    @property
    def class_names(self) -> tuple[str, ...]:
        """Names of the known classes."""

    def detect(self, pictures: Sequence[NDArray[np.uint8]]) -> list[tuple[Detection, ...]]:
        """Returns the detections in each picture, the highest score first.

        Pictures are (H, W, 3) RGB or (H, W) grey, of any sizes. May take long: call it inside a Worker job. Raises
        ValueError for an array of another shape.
        """


class NoDetectorError(RuntimeError):
    """Error of a detection without a detector."""


@dataclass(frozen=True)
class NoDetector:
    """Stand-in where there is no detector: knows no classes, and raises an error when it is used."""

    class_names: tuple[str, ...] = ()

    def detect(self, pictures: Sequence[NDArray[np.uint8]]) -> list[tuple[Detection, ...]]:
        """Raises NoDetectorError."""
        raise NoDetectorError("there is no detector here: put one into the context's field 'detector'")


NO_DETECTOR: Final = NoDetector()


class DetectorWrapper:
    """Detector around another `detector`, whose methods and attributes it has, except for its own."""

    def __init__(self, detector: Detector) -> None:
        self._detector = detector

    @property
    def class_names(self) -> tuple[str, ...]:
        """Classes that the other detector knows."""
        return self._detector.class_names

    def detect(self, pictures: Sequence[NDArray[np.uint8]]) -> list[tuple[Detection, ...]]:
        """Returns the detections of the other detector."""
        return self._detector.detect(pictures)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._detector, name)

    def __dir__(self) -> Iterable[str]:
        return {*super().__dir__(), *dir(self._detector)}


def box_overlap(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> float:
    """Intersection over union of two boxes."""
    width, height = (min(a[k + 2], b[k + 2]) - max(a[k], b[k]) for k in (0, 1))
    if width <= 0 or height <= 0:
        return 0.0
    areas = [(box[2] - box[0]) * (box[3] - box[1]) for box in (a, b)]
    return float(width * height / max(sum(areas) - width * height, 1e-6))
