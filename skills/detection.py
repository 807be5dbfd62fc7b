"""Interface of a detector, without types of the simulator; skills import these names from `skills.api`."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Protocol, TypeVar, runtime_checkable

from skills.robot import Image, Picture

if TYPE_CHECKING:
    from pathlib import Path

    from skills.world_model import Tag


@dataclass(frozen=True)
class Detection:
    """Detected object in a picture: class, score (0 to 1), and box (u0, v0, u1, v1) in pixels of that picture.

    `alternatives` are competing classes with their scores, the most likely first.
    """

    class_name: str
    score: float
    box: tuple[float, float, float, float]
    alternatives: tuple[tuple[str, float], ...] = ()


Detections = tuple[Detection, ...]
AnswerT = TypeVar("AnswerT")


class Detector(Protocol):
    """Detects objects of known classes in pictures.

    A detector inherits from this class, implements `class_names` and `detect`, and may override the other methods.
    """

    models: Mapping[str, Any] = MappingProxyType({})
    """Object models by name, for objects that the user has added; skills match segments against them."""
    about: str = ""
    """Description of the network for the user: how its input and outputs are read."""

    @property
    @abstractmethod
    def class_names(self) -> tuple[str, ...]:
        """Names of the known classes."""

    @property
    def shapes(self) -> Any:
        """Model of the classes' shapes in depth, a second witness beside the scores; None for scores alone."""
        return None

    @abstractmethod
    def detect(self, pictures: Sequence[Picture]) -> list[Detections]:
        """Returns the detections in each picture, the highest score first.

        Pictures are (H, W, 3) RGB or (H, W) grey, of any sizes. May take long: call it inside a Worker job. Raises
        ValueError for an array of another shape.
        """

    def detect_class(self, pictures: Sequence[Picture], class_name: str) -> list[Detections]:
        """Returns the detections of one class in each picture; a detector may override this with a faster search."""
        return [tuple(one for one in found if one.class_name == class_name) for found in self.detect(pictures)]

    def detect_in_views(self, picture: Picture, least_score: float | None = None) -> Detections:
        """Returns the detections in one picture; may use several views and keep scores from `least_score` on."""
        return self.detect([picture])[0]

    def detect_with_depth(self, image: Image, found: Detections) -> Detections:
        """Returns `found`, the detections in the image's picture, which a detector may refine by the depth."""
        return found


class Recogniser(Protocol):
    """Function of the entry-point group `errand.recognisers`, which extends a detector by objects of a world."""

    def __call__(self, detector: Detector, folders: Sequence[Path], tags: Sequence[Tag]) -> Detector:
        """Returns a detector that also recognises imported objects, by their folders, or objects that carry tags.

        Returns the given one when it adds nothing. Raises InputError when a folder cannot be used.
        """


class NoDetectorError(RuntimeError):
    """Error raised when a skill asks a context without a detector for detections."""


@dataclass(frozen=True)
class NoDetector(Detector):
    """Placeholder for a missing detector: has no classes, and raises NoDetectorError when a picture is given to it."""

    class_names: tuple[str, ...] = ()

    def detect(self, pictures: Sequence[Picture]) -> list[Detections]:
        """Raises NoDetectorError."""
        raise NoDetectorError("there is no detector here: put one into the context's field 'detector'")


NO_DETECTOR: Final = NoDetector()


class DetectorWrapper(Detector):
    """Detector that wraps another one; calls that judge pictures go through `_call`, which a subclass may override."""

    def __init__(self, detector: Detector) -> None:
        self._detector = with_defaults(detector)
        self.models, self.about = self._detector.models, self._detector.about

    def _call(self, method: str, pictures: int, call: Callable[..., AnswerT], *arguments: Any) -> AnswerT:
        """Calls `call`, a method of the wrapped detector; `pictures` is the number of pictures."""
        return call(*arguments)

    @property
    def class_names(self) -> tuple[str, ...]:
        """Classes that the wrapped detector knows."""
        return self._detector.class_names

    @property
    def shapes(self) -> Any:
        """Shapes of the wrapped detector's classes."""
        return self._detector.shapes

    def detect(self, pictures: Sequence[Picture]) -> list[Detections]:
        """Returns the detections of the wrapped detector."""
        return self._call("detect", len(pictures), self._detector.detect, pictures)

    def detect_class(self, pictures: Sequence[Picture], class_name: str) -> list[Detections]:
        """Returns the wrapped detector's detections of one class."""
        return self._call("detect_class", len(pictures), self._detector.detect_class, pictures, class_name)

    def detect_in_views(self, picture: Picture, least_score: float | None = None) -> Detections:
        """Returns the wrapped detector's detections in one picture."""
        return self._call("detect_in_views", 1, self._detector.detect_in_views, picture, least_score)

    def detect_with_depth(self, image: Image, found: Detections) -> Detections:
        """Returns the wrapped detector's detections in an image with depth."""
        return self._detector.detect_with_depth(image, found)


@dataclass(frozen=True)
class _PlainDetector(Detector):
    """Adds the default methods to a detector that implements only `class_names` and `detect`."""

    detector: Detector

    @property
    def class_names(self) -> tuple[str, ...]:
        return self.detector.class_names

    def detect(self, pictures: Sequence[Picture]) -> list[Detections]:
        return self.detector.detect(pictures)


def with_defaults(detector: Detector) -> Detector:
    """Returns the detector itself, or a wrapper that adds the optional methods when the detector lacks them."""
    return detector if hasattr(detector, "detect_in_views") else _PlainDetector(detector)


def box_overlap(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> float:
    """Intersection over union of two boxes."""
    width, height = (min(a[k + 2], b[k + 2]) - max(a[k], b[k]) for k in (0, 1))
    if width <= 0 or height <= 0:
        return 0.0
    areas = [(box[2] - box[0]) * (box[3] - box[1]) for box in (a, b)]
    return float(width * height / max(sum(areas) - width * height, 1e-6))


class DetectorComponent(Hashable, Protocol):
    """Loads a detector."""

    def build(self) -> Detector:
        """Loads the detector. Raises InputError when its model cannot be used."""


@runtime_checkable
class PictureDetectorComponent(Protocol):
    """Loads a detector for single pictures: each class that its network knows, in one view, from a threshold on."""

    def build_for_pictures(self, threshold: float) -> Detector:
        """Loads the detector. Raises InputError when its model cannot be used."""
