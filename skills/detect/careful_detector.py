"""Several looks at one picture, also mirrored, smaller and at parts of it: what they agree on is surer than one look.

Boxes of one thing in several looks are fused after Solovyev et al., "Weighted boxes fusion" (2021); parts that are
shown larger serve small things, after Akyon et al., "Slicing aided hyper inference" (2022). A thing is judged by the
looks that show all of it, neither small nor very large; a person by those at the whole picture. It takes as many times
longer as there are looks.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Protocol, runtime_checkable

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.detect.letterbox import PADDING, Letterbox, check_picture
from skills.detect.onnx_detector import OnnxDetector
from skills.detect.suppression import Candidates, told
from skills.detection import Detection, box_overlap
from skills.robot import Picture

__all__ = ["AS_IT_IS_AND_OTHERWISE", "CarefulDetector", "LooksCarefully", "Variant"]

Box = tuple[float, float, float, float]
_SAME_THING = 0.55
_LEAST_SCORE = 0.05
_LEAST_SIDE_PX, _MOST_SIDE_PX = 64.0, 240.0
_LARGE_CLASSES: Final = frozenset({"person"})
_LEAST_LARGE_SIDE_PX: Final = 140.0
_MARGIN = 0.003
_WHOLE: Final = (0.0, 0.0, 1.0, 1.0)
_CORNERS: Final = (
    (0.0, 0.0, 0.625, 0.625),
    (0.375, 0.0, 1.0, 0.625),
    (0.0, 0.375, 0.625, 1.0),
    (0.375, 0.375, 1.0, 1.0),
)


@dataclass(frozen=True)
class Variant:
    """A picture as it is, or mirrored from left to right, or smaller by `scale` (up to 1) in the same frame, or a part.

    A `part` is (left, top, right, bottom) in shares of the picture's width and height. The detector's letterbox shows
    it as large as it would show the whole.
    """

    mirrored: bool = False
    scale: float = 1.0
    part: tuple[float, float, float, float] = _WHOLE

    def of(self, picture: Picture) -> Picture:
        """The variant of a picture (H, W) or (H, W, 3); of the same size, if it is not a part."""
        u0, v0, u1, v1 = self._edges_px(picture.shape)
        shown = picture[v0:v1, u0:u1]
        turned = shown[:, ::-1] if self.mirrored else shown
        if self.scale == 1.0:
            return np.ascontiguousarray(turned)
        small = cv2.resize(turned, None, fx=self.scale, fy=self.scale, interpolation=cv2.INTER_AREA)
        framed = np.full_like(shown, PADDING)
        framed[: small.shape[0], : small.shape[1]] = small
        return framed

    def back(self, box: Box, shape: Sequence[int]) -> Box:
        """A box of the variant in the picture of some shape (H, W, ...)."""
        left, top, right, _ = self._edges_px(shape)
        u0, v0, u1, v1 = (value / self.scale for value in box)
        if self.mirrored:
            u0, u1 = right - left - u1, right - left - u0
        return (left + u0, top + v0, left + u1, top + v1)

    def suits(self, box: Box, shape: Sequence[int]) -> bool:
        """Whether a thing with a box in the picture is of a size in the variant at which it is judged best, and whole.

        Sizes are those in the letterbox, which the network sees.
        """
        side_px = self._side_px(box, shape)
        large_enough = self.scale == 1.0 or side_px >= _LEAST_SIDE_PX
        return large_enough and side_px <= _MOST_SIDE_PX and self.shows_all(box, shape)

    def suits_large(self, box: Box, shape: Sequence[int]) -> bool:
        """Whether it is of the whole picture, and does not make a thing of a large kind with a box in it small."""
        return self.part == _WHOLE and (self.scale == 1.0 or self._side_px(box, shape) >= _LEAST_LARGE_SIDE_PX)

    def _side_px(self, box: Box, shape: Sequence[int]) -> float:
        """The longer side, in the letterbox, of what has a box in the picture."""
        u0, v0, u1, v1 = self._edges_px(shape)
        larger = Letterbox(width_px=u1 - u0, height_px=v1 - v0).scale_xy[0]
        return max(box[2] - box[0], box[3] - box[1]) * self.scale * larger

    def shows_all(self, box: Box, shape: Sequence[int]) -> bool:
        """Whether the part does not cut off what has a box in the picture."""
        height, width = shape[:2]
        u0, v0, u1, v1 = self._edges_px(shape)
        margin = _MARGIN * width
        beyond_left, beyond_top = u0 > 0 and box[0] < u0 + margin, v0 > 0 and box[1] < v0 + margin
        beyond_right, beyond_bottom = u1 < width and box[2] > u1 - margin, v1 < height and box[3] > v1 - margin
        return not (beyond_left or beyond_top or beyond_right or beyond_bottom)

    def _edges_px(self, shape: Sequence[int]) -> tuple[int, int, int, int]:
        """Left, top, right and bottom edge of the part, which has one pixel at least."""
        height, width = shape[:2]
        left, top = min(width - 1, round(self.part[0] * width)), min(height - 1, round(self.part[1] * height))
        return left, top, max(left + 1, round(self.part[2] * width)), max(top + 1, round(self.part[3] * height))


AS_IT_IS_AND_OTHERWISE: Final = (
    Variant(),
    Variant(mirrored=True),
    Variant(scale=0.7),
    Variant(True, 0.5),
    Variant(scale=0.35),
    *(Variant(part=part) for part in _CORNERS),
    *(Variant(mirrored=True, part=part) for part in _CORNERS),
)


@runtime_checkable
class LooksCarefully(Protocol):
    """A detector that can take more time for one picture."""

    def detect_carefully(self, picture: Picture, least_score: float | None = None) -> tuple[Detection, ...]:
        """What is in a picture, the surest first, from the detector's usual score on, or from `least_score` on.

        Raises ValueError for what is no picture.
        """


@dataclass(frozen=True)
class CarefulDetector:
    """A detector that looks once, or carefully when asked to."""

    detector: OnnxDetector
    variants: tuple[Variant, ...] = AS_IT_IS_AND_OTHERWISE

    @property
    def class_names(self) -> tuple[str, ...]:
        """The classes that it knows."""
        return self.detector.class_names

    def detect(self, pictures: Sequence[Picture]) -> list[tuple[Detection, ...]]:
        """What is in each picture at one look."""
        return self.detector.detect(pictures)

    def detect_carefully(self, picture: Picture, least_score: float | None = None) -> tuple[Detection, ...]:
        """What the looks at a picture agree on, from the threshold or from `least_score` on.

        Raises ValueError for what is no picture.
        """
        check_picture(picture)
        options = self.detector.options
        threshold = options.threshold if least_score is None else least_score
        sensitive = OnnxDetector(
            self.detector.model, replace(options, threshold=_LEAST_SCORE, rival_threshold=_LEAST_SCORE)
        )
        looks = sensitive.detect([variant.of(picture) for variant in self.variants])
        fused = self._fused(looks, picture.shape).from_score(min(threshold, options.rival_threshold))
        return told(fused, self.class_names, threshold, options.suppression)

    def _fused(self, looks: Sequence[Sequence[Detection]], shape: Sequence[int]) -> Candidates:
        """One candidate for each thing and class."""
        groups: list[_Group] = []
        for one, number in sorted(_numbered(looks), key=lambda pair: -pair[0].score):
            box = self.variants[number].back(one.box, shape)
            if not self.variants[number].shows_all(box, shape):
                continue
            same = [group for group in groups if group.is_of(one.class_name, box)]
            if not same:
                groups.append(_Group(one.class_name, box, {number: (one.score, box)}))
            elif number not in same[0].seen:
                same[0].seen[number] = (one.score, box)
        rows = sorted((self._row(group, shape) for group in groups), key=lambda row: -row[1])
        return Candidates(
            np.array([box for box, _, _ in rows], dtype=np.float32).reshape(-1, 4),
            np.array([score for _, score, _ in rows], dtype=np.float32),
            np.array([which for _, _, which in rows], dtype=np.int64),
        )

    def _row(self, group: _Group, shape: Sequence[int]) -> tuple[NDArray[np.float64], float, int]:
        """Mean box, weighted by the scores, and mean score, of the looks that suit it; number of the class.

        Where none suits, all are asked.
        """
        looks = range(len(self.variants))
        suits = Variant.suits_large if group.class_name in _LARGE_CLASSES else Variant.suits
        suiting = [number for number in looks if suits(self.variants[number], group.box, shape)] or looks
        seen = [group.seen[number] for number in suiting if number in group.seen]
        told = seen or list(group.seen.values())
        box = np.average([box for _, box in told], axis=0, weights=[score for score, _ in told])
        return box, sum(score for score, _ in seen) / len(suiting), self.class_names.index(group.class_name)


@dataclass
class _Group:
    """What several looks tell of a thing: score and box by the look's number; `box` is the surest one's."""

    class_name: str
    box: Box
    seen: dict[int, tuple[float, Box]] = field(default_factory=dict)

    def is_of(self, class_name: str, box: Box) -> bool:
        """Whether a box is on the same thing, and of the same class."""
        return class_name == self.class_name and box_overlap(self.box, box) > _SAME_THING


def _numbered(looks: Iterable[Sequence[Detection]]) -> Iterable[tuple[Detection, int]]:
    """Detections and their rivals, each with its look's number."""
    for number, found in enumerate(looks):
        for one in found:
            yield one, number
            for name, score in one.rivals:
                yield Detection(name, score, one.box), number
