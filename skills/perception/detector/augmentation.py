"""Test-time augmentation: detections in mirrored and smaller views of one picture, fused.

Boxes of one object in several views are fused after Solovyev et al., "Weighted boxes fusion" (2021). Only the views in
which an object is neither small nor very large contribute.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.detection import Detection, Detections, DetectorWrapper, box_overlap
from skills.perception.detector.boxes import PADDING, Candidates, Letterbox, check_picture, detections_from
from skills.perception.detector.onnx_detector import OnnxDetector
from skills.robot import Picture

Box = tuple[float, float, float, float]
_SAME_OBJECT = 0.55
_LEAST_SCORE = 0.05
_LEAST_SIDE_PX, _MOST_SIDE_PX = 64.0, 240.0
_LARGE_CLASSES: Final = frozenset({"person"})
_LEAST_LARGE_SIDE_PX: Final = 140.0


@dataclass(frozen=True)
class View:
    """View of a picture: unchanged, mirrored from left to right, or smaller by `scale` (up to 1) in the same frame."""

    mirrored: bool = False
    scale: float = 1.0

    def apply(self, picture: Picture) -> Picture:
        """Computes the view of a picture (H, W) or (H, W, 3), of the same size."""
        flipped = picture[:, ::-1] if self.mirrored else picture
        if self.scale == 1.0:
            return np.ascontiguousarray(flipped)
        small = cv2.resize(flipped, None, fx=self.scale, fy=self.scale, interpolation=cv2.INTER_AREA)
        framed = np.full_like(picture, PADDING)
        framed[: small.shape[0], : small.shape[1]] = small
        return framed

    def box_in_picture(self, box: Box, width_px: int) -> Box:
        """Converts a box in the view to the picture, which is width_px wide."""
        u0, v0, u1, v1 = (value / self.scale for value in box)
        return (width_px - u1, v0, width_px - u0, v1) if self.mirrored else (u0, v0, u1, v1)

    def suits(self, box: Box, shape: Sequence[int], *, large: bool) -> bool:
        """Returns whether the view shows a box in a picture (H, W, ...) at a size for which the networks are reliable.

        The size is measured in the letterbox. Objects of a `large` class have limits of their own.
        """
        letterbox = Letterbox(width_px=shape[1], height_px=shape[0])
        side_px = max(box[2] - box[0], box[3] - box[1]) * self.scale * letterbox.scale_xy[0]
        least_px, most_px = (_LEAST_LARGE_SIDE_PX, np.inf) if large else (_LEAST_SIDE_PX, _MOST_SIDE_PX)
        return (self.scale == 1.0 or side_px >= least_px) and side_px <= most_px


VIEWS: Final = (View(), View(mirrored=True), View(scale=0.7), View(True, 0.5), View(scale=0.35))
"""The detector always uses the first view, and the others where the first leaves doubts."""


@dataclass(frozen=True)
class AugmentationOptions:
    """The views; the first suffices when no score, alternatives included, lies between `low` and `high`."""

    views: tuple[View, ...] = VIEWS
    low: float = 0.3
    high: float = 0.7


class AugmentedDetector(DetectorWrapper):
    """Detector that uses one view, or several in `detect_in_views`."""

    def __init__(self, networks: OnnxDetector, options: AugmentationOptions | None = None) -> None:
        super().__init__(networks)
        self._networks, self._options = networks, options or AugmentationOptions()

    def detect_in_views(self, picture: Picture, least_score: float | None = None) -> Detections:
        """Fuses the detections in all views, from the threshold or from `least_score` on.

        Raises ValueError when the array is no picture.
        """
        check_picture(picture)
        options, views = self._networks.options, self._options.views
        threshold = options.threshold if least_score is None else least_score
        found = self._networks.detect([views[0].apply(picture)], _LEAST_SCORE)
        if not self._in_doubt(found[0]):
            views = views[:1]
        else:
            found += self._networks.detect([view.apply(picture) for view in views[1:]], _LEAST_SCORE)
        fused = _fused(views, found, picture.shape, self.class_names)
        likely = fused.from_score(min(threshold, options.alternative_threshold))
        return detections_from(likely, self.class_names, threshold, options.suppression)

    def _in_doubt(self, found: Sequence[Detection]) -> bool:
        """Returns whether the first view has a score between `low` and `high`."""
        scores = [score for one in found for score in (one.score, *(score for _, score in one.alternatives))]
        return any(self._options.low < score < self._options.high for score in scores)


def _fused(
    views: Sequence[View], found: Sequence[Sequence[Detection]], shape: Sequence[int], class_names: Sequence[str]
) -> Candidates:
    """Fuses the detections in all views to one candidate for each object and class."""
    groups: list[_Group] = []
    for one, number in sorted(_numbered(found), key=lambda pair: -pair[0].score):
        box = views[number].box_in_picture(one.box, shape[1])
        alike = (group for group in groups if group.class_name == one.class_name)
        same = [group for group in alike if box_overlap(group.box, box) > _SAME_OBJECT]
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
    """One object in several views: score and box by the number of the view; `box` has the highest score."""

    class_name: str
    box: Box
    seen: dict[int, tuple[float, Box]] = field(default_factory=dict)

    def row(self, views: Sequence[View], shape: Sequence[int]) -> tuple[NDArray[np.float64], float, str]:
        """Mean box, weighted by the scores, mean score, and class, over the views that suit the object, or else all."""
        large = self.class_name in _LARGE_CLASSES
        suiting = [k for k, view in enumerate(views) if view.suits(self.box, shape, large=large)] or range(len(views))
        own = [self.seen[number] for number in suiting if number in self.seen]
        judges = own or list(self.seen.values())
        box = np.average([box for _, box in judges], axis=0, weights=[score for score, _ in judges])
        return box, sum(score for score, _ in own) / len(suiting), self.class_name


def _numbered(found: Iterable[Sequence[Detection]]) -> Iterable[tuple[Detection, int]]:
    """Yields detections and their alternatives with the number of their view."""
    for number, ones in enumerate(found):
        for one in ones:
            yield one, number
            for name, score in one.alternatives:
                yield Detection(name, score, one.box), number
