"""Test-time augmentation: several views of one picture, also mirrored and smaller, fused into one answer.

Boxes of one object in several views are fused after Solovyev et al., "Weighted boxes fusion" (2021). An object is
judged by the views that show it neither small nor very large. Where the first view leaves no doubt, the others are not
taken.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Protocol, runtime_checkable

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.detection import Detection, box_overlap
from skills.perception.detector.letterbox import PADDING, Letterbox, check_picture
from skills.perception.detector.onnx_detector import OnnxDetector
from skills.perception.detector.suppression import Candidates, detections_of
from skills.robot import Picture

Box = tuple[float, float, float, float]
_SAME_OBJECT = 0.55
_LEAST_SCORE = 0.05
_LEAST_SIDE_PX, _MOST_SIDE_PX = 64.0, 240.0
_LARGE_CLASSES: Final = frozenset({"person"})
_LEAST_LARGE_SIDE_PX: Final = 140.0


@dataclass(frozen=True)
class View:
    """A picture as it is, or mirrored from left to right, or smaller by `scale` (up to 1) in the same frame."""

    mirrored: bool = False
    scale: float = 1.0

    def of(self, picture: Picture) -> Picture:
        """The view of a picture (H, W) or (H, W, 3), of the same size."""
        turned = picture[:, ::-1] if self.mirrored else picture
        if self.scale == 1.0:
            return np.ascontiguousarray(turned)
        small = cv2.resize(turned, None, fx=self.scale, fy=self.scale, interpolation=cv2.INTER_AREA)
        framed = np.full_like(picture, PADDING)
        framed[: small.shape[0], : small.shape[1]] = small
        return framed

    def back(self, box: Box, width_px: int) -> Box:
        """A box of the view in the picture, which is so wide."""
        u0, v0, u1, v1 = (value / self.scale for value in box)
        return (width_px - u1, v0, width_px - u0, v1) if self.mirrored else (u0, v0, u1, v1)

    def suits(self, box: Box, shape: Sequence[int], *, large: bool) -> bool:
        """Whether an object with a box in a picture (H, W, ...) has a size in the view at which it is judged best.

        Sizes are those in the letterbox, which the network sees. Objects of a `large` class have sizes of their own.
        """
        letterbox = Letterbox(width_px=shape[1], height_px=shape[0])
        side_px = max(box[2] - box[0], box[3] - box[1]) * self.scale * letterbox.scale_xy[0]
        least_px, most_px = (_LEAST_LARGE_SIDE_PX, np.inf) if large else (_LEAST_SIDE_PX, _MOST_SIDE_PX)
        return (self.scale == 1.0 or side_px >= least_px) and side_px <= most_px


VIEWS: Final = (View(), View(mirrored=True), View(scale=0.7), View(True, 0.5), View(scale=0.35))
"""The first one is taken always, the others where it leaves doubts."""


@runtime_checkable
class DetectsInViews(Protocol):
    """A detector that can take more time for one picture."""

    def detect_in_views(self, picture: Picture, least_score: float | None = None) -> tuple[Detection, ...]:
        """What is in a picture, the surest first, from the detector's usual score on, or from `least_score` on.

        Raises ValueError for what is no picture.
        """


@runtime_checkable
class DetectsClass(Protocol):
    """A detector that can look quickly for the objects of one class."""

    def detect_class(self, pictures: Sequence[Picture], class_name: str) -> list[tuple[Detection, ...]]:
        """The objects of a class in each picture, the surest first. Raises ValueError for what is no picture."""


@dataclass(frozen=True)
class AugmentationOptions:
    """The views, and when the first one is enough: no score, also of alternatives, lies between `low` and `high`."""

    views: tuple[View, ...] = VIEWS
    low: float = 0.3
    high: float = 0.7


@dataclass(frozen=True)
class AugmentedDetector:
    """A detector that takes one view, or several when asked to."""

    detector: OnnxDetector
    options: AugmentationOptions = field(default_factory=AugmentationOptions)

    @property
    def class_names(self) -> tuple[str, ...]:
        """The classes that it knows."""
        return self.detector.class_names

    def detect(self, pictures: Sequence[Picture]) -> list[tuple[Detection, ...]]:
        """What is in each picture at one view."""
        return self.detector.detect(pictures)

    def detect_class(self, pictures: Sequence[Picture], class_name: str) -> list[tuple[Detection, ...]]:
        """The objects of one class in each picture at one quick view."""
        return self.detector.detect_class(pictures, class_name)

    def detect_in_views(self, picture: Picture, least_score: float | None = None) -> tuple[Detection, ...]:
        """What the views of a picture agree on, from the threshold or from `least_score` on.

        Raises ValueError for what is no picture.
        """
        check_picture(picture)
        options = self.detector.options
        threshold = options.threshold if least_score is None else least_score
        sensitive = OnnxDetector(
            self.detector.model, replace(options, threshold=_LEAST_SCORE, alternative_threshold=_LEAST_SCORE)
        )
        views = self.options.views
        found = sensitive.detect([views[0].of(picture)])
        if not self._in_doubt(found[0]):
            views = views[:1]
        else:
            found += sensitive.detect([view.of(picture) for view in views[1:]])
        fused = _fused(views, found, picture.shape, self.class_names)
        return detections_of(
            fused.from_score(min(threshold, options.alternative_threshold)),
            self.class_names,
            threshold,
            options.suppression,
        )

    def _in_doubt(self, found: Sequence[Detection]) -> bool:
        """Returns whether one view finds what may or may not be there."""
        scores = [score for one in found for score in (one.score, *(score for _, score in one.alternatives))]
        return any(self.options.low < score < self.options.high for score in scores)


def _fused(
    views: Sequence[View], found: Sequence[Sequence[Detection]], shape: Sequence[int], class_names: Sequence[str]
) -> Candidates:
    """One candidate for each object and class."""
    groups: list[_Group] = []
    for one, number in sorted(_numbered(found), key=lambda pair: -pair[0].score):
        box = views[number].back(one.box, shape[1])
        same = [group for group in groups if group.is_of(one.class_name, box)]
        if not same:
            groups.append(_Group(one.class_name, box, {number: (one.score, box)}))
        elif number not in same[0].seen:
            same[0].seen[number] = (one.score, box)
    rows = sorted((group.row(views, shape) for group in groups), key=lambda row: -row[1])
    return Candidates(
        np.array([box for box, _, _ in rows], dtype=np.float32).reshape(-1, 4),
        np.array([score for _, score, _ in rows], dtype=np.float32),
        np.array([class_names.index(name) for _, _, name in rows], dtype=np.int64),
    )


@dataclass
class _Group:
    """One object in several views: score and box by the view's number; `box` is the surest one's."""

    class_name: str
    box: Box
    seen: dict[int, tuple[float, Box]] = field(default_factory=dict)

    def is_of(self, class_name: str, box: Box) -> bool:
        """Returns whether a box is on the same object, and of the same class."""
        return class_name == self.class_name and box_overlap(self.box, box) > _SAME_OBJECT

    def row(self, views: Sequence[View], shape: Sequence[int]) -> tuple[NDArray[np.float64], float, str]:
        """Mean box, weighted by the scores, mean score, and class; by the views that suit it, or by all."""
        large = self.class_name in _LARGE_CLASSES
        suiting = [k for k, view in enumerate(views) if view.suits(self.box, shape, large=large)] or range(len(views))
        own = [self.seen[number] for number in suiting if number in self.seen]
        judging = own or list(self.seen.values())
        box = np.average([box for _, box in judging], axis=0, weights=[score for score, _ in judging])
        return box, sum(score for score, _ in own) / len(suiting), self.class_name


def _numbered(found: Iterable[Sequence[Detection]]) -> Iterable[tuple[Detection, int]]:
    """Detections and their alternatives, each with its view's number."""
    for number, ones in enumerate(found):
        for one in ones:
            yield one, number
            for name, score in one.alternatives:
                yield Detection(name, score, one.box), number
