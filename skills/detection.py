"""Interface of a detector, without types of the simulator; skills import these names from `skills.api`."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Protocol, TypeVar

from skills.robot import Image, Picture

if TYPE_CHECKING:
    from skills.perception.object_model import ObjectModel


@dataclass(frozen=True)
class Detection:
    """Detected object in a picture: class, score (0 to 1), and box (u0, v0, u1, v1) in pixels of that picture.

    `alternatives` are the other classes that it may be, with their scores, the likeliest first.
    """

    class_name: str
    score: float
    box: tuple[float, float, float, float]
    alternatives: tuple[tuple[str, float], ...] = ()


Detections = tuple[Detection, ...]
AnswerT = TypeVar("AnswerT")


class Detector(Protocol):
    """Detects objects of known classes in pictures.

    A detector of your own inherits from this class, has `class_names` and `detect`, and overrides what it does better.
    """

    models: Mapping[str, ObjectModel] = MappingProxyType({})
    """Models of own objects by name, with which the skills compare segments."""

    @property
    @abstractmethod
    def class_names(self) -> tuple[str, ...]:
        """Names of the known classes."""

    @abstractmethod
    def detect(self, pictures: Sequence[Picture]) -> list[Detections]:
        """Returns the detections in each picture, the highest score first.

        Pictures are (H, W, 3) RGB or (H, W) grey, of any sizes. May take long: call it inside a Worker job. Raises
        ValueError for an array of another shape.
        """

    def detect_class(self, pictures: Sequence[Picture], class_name: str) -> list[Detections]:
        """Returns the detections of one known class in each picture; a detector may have a quick search for it."""
        return [tuple(one for one in found if one.class_name == class_name) for found in self.detect(pictures)]

    def detect_in_views(self, picture: Picture, least_score: float | None = None) -> Detections:
        """Returns the detections in one picture; in several views, and from `least_score` on, if the detector can."""
        return self.detect([picture])[0]

    def detect_with_depth(self, image: Image, found: Detections) -> Detections:
        """Returns the detections in an image, of which `found` are those in its picture."""
        return found


class NoDetectorError(RuntimeError):
    """Error of a detection without a detector."""


@dataclass(frozen=True)
class NoDetector(Detector):
    """Stand-in where there is no detector: knows no classes, and raises an error when it is used."""

    class_names: tuple[str, ...] = ()

    def detect(self, pictures: Sequence[Picture]) -> list[Detections]:
        """Raises NoDetectorError."""
        raise NoDetectorError("there is no detector here: put one into the context's field 'detector'")


NO_DETECTOR: Final = NoDetector()


class DetectorWrapper(Detector):
    """Detector around another one: what judges pictures goes through `_call`; a subclass overrides it, or methods."""

    def __init__(self, detector: Detector) -> None:
        self._detector = with_defaults(detector)
        self.models = self._detector.models

    def _call(self, method: str, pictures: int, call: Callable[..., AnswerT], *arguments: Any) -> AnswerT:
        """Makes a call of a method for a number of pictures: `call` is the wrapped detector's."""
        return call(*arguments)

    @property
    def class_names(self) -> tuple[str, ...]:
        """Classes that the other detector knows."""
        return self._detector.class_names

    def detect(self, pictures: Sequence[Picture]) -> list[Detections]:
        """Returns the detections of the other detector."""
        return self._call("detect", len(pictures), self._detector.detect, pictures)

    def detect_class(self, pictures: Sequence[Picture], class_name: str) -> list[Detections]:
        """Returns the detections of one class by the other detector."""
        return self._call("detect_class", len(pictures), self._detector.detect_class, pictures, class_name)

    def detect_in_views(self, picture: Picture, least_score: float | None = None) -> Detections:
        """Returns the detections of the other detector in one picture."""
        return self._call("detect_in_views", 1, self._detector.detect_in_views, picture, least_score)

    def detect_with_depth(self, image: Image, found: Detections) -> Detections:
        """Returns the detections of the other detector in an image."""
        return self._detector.detect_with_depth(image, found)


@dataclass(frozen=True)
class _PlainDetector(Detector):
    """Detector that has only `class_names` and `detect` of its own."""

    detector: Detector

    @property
    def class_names(self) -> tuple[str, ...]:
        return self.detector.class_names

    def detect(self, pictures: Sequence[Picture]) -> list[Detections]:
        return self.detector.detect(pictures)


def with_defaults(detector: Detector) -> Detector:
    """Returns the detector itself, or one around it that adds the methods which a detector need not have."""
    return detector if hasattr(detector, "detect_in_views") else _PlainDetector(detector)


def box_overlap(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> float:
    """Intersection over union of two boxes."""
    width, height = (min(a[k + 2], b[k + 2]) - max(a[k], b[k]) for k in (0, 1))
    if width <= 0 or height <= 0:
        return 0.0
    areas = [(box[2] - box[0]) * (box[3] - box[1]) for box in (a, b)]
    return float(width * height / max(sum(areas) - width * height, 1e-6))
