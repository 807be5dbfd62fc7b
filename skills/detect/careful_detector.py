"""Several looks at one picture, also mirrored and smaller: what they agree on is surer than what one of them tells.

Boxes of one thing in several looks are fused after Solovyev et al., "Weighted boxes fusion" (2021). A thing is judged
by the looks in which it is neither small nor very large. It takes as many times longer as there are looks.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Protocol, runtime_checkable

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.detect.letterbox import PADDING, check_picture
from skills.detect.onnx_detector import OnnxDetector
from skills.detect.suppression import Candidates, told
from skills.detection import Detection, box_overlap

__all__ = ["AS_IT_IS_AND_OTHERWISE", "CarefulDetector", "LooksCarefully", "Variant"]

Picture = NDArray[np.uint8]
Box = tuple[float, float, float, float]
_SAME_THING = 0.55
_LEAST_SCORE = 0.1
_LEAST_SIDE_PX, _MOST_SIDE_PX = 64.0, 240.0


@dataclass(frozen=True)
class Variant:
    """A picture as it is, or mirrored from left to right, or smaller by `scale` (up to 1) in the same frame."""

    mirrored: bool = False
    scale: float = 1.0

    def of(self, picture: Picture) -> Picture:
        """The variant of a picture (H, W) or (H, W, 3), of the same size."""
        turned = picture[:, ::-1] if self.mirrored else picture
        if self.scale == 1.0:
            return np.ascontiguousarray(turned)
        small = cv2.resize(turned, None, fx=self.scale, fy=self.scale, interpolation=cv2.INTER_AREA)
        framed = np.full_like(picture, PADDING)
        framed[: small.shape[0], : small.shape[1]] = small
        return framed

    def back(self, box: Box, width_px: int) -> Box:
        """A box of the variant in the picture of some width."""
        u0, v0, u1, v1 = (value / self.scale for value in box)
        return (width_px - u1, v0, width_px - u0, v1) if self.mirrored else (u0, v0, u1, v1)

    def suits(self, box: Box) -> bool:
        """Whether a thing with a box in the picture is of a size in the variant at which it is judged best."""
        side_px = max(box[2] - box[0], box[3] - box[1]) * self.scale
        return side_px <= _MOST_SIDE_PX and (self.scale == 1.0 or side_px >= _LEAST_SIDE_PX)


AS_IT_IS_AND_OTHERWISE: Final = (
    Variant(),
    Variant(mirrored=True),
    Variant(scale=0.7),
    Variant(True, 0.5),
    Variant(scale=0.35),
)


@runtime_checkable
class LooksCarefully(Protocol):
    """A detector that can take more time for one picture."""

    def detect_carefully(self, picture: Picture) -> tuple[Detection, ...]:
        """What is in a picture, the surest first. Raises ValueError for what is no picture."""


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

    def detect_carefully(self, picture: Picture) -> tuple[Detection, ...]:
        """What the looks at a picture agree on. Raises ValueError for what is no picture."""
        check_picture(picture)
        options = self.detector.options
        sensitive = OnnxDetector(self.detector.model, replace(options, threshold=_LEAST_SCORE))
        looks = sensitive.detect([variant.of(picture) for variant in self.variants])
        fused = self._fused(looks, picture.shape[1]).from_score(min(options.threshold, options.rival_threshold))
        return told(fused, self.class_names, options.threshold, options.suppression)

    def _fused(self, looks: Sequence[Sequence[Detection]], width_px: int) -> Candidates:
        """One candidate for each thing and class."""
        groups: list[_Group] = []
        for one, number in sorted(_numbered(looks), key=lambda pair: -pair[0].score):
            box = self.variants[number].back(one.box, width_px)
            same = [group for group in groups if group.is_of(one.class_name, box)]
            if not same:
                groups.append(_Group(one.class_name, box, {number: (one.score, box)}))
            elif number not in same[0].seen:
                same[0].seen[number] = (one.score, box)
        rows = sorted((self._row(group) for group in groups), key=lambda row: -row[1])
        return Candidates(
            np.array([box for box, _, _ in rows], dtype=np.float32).reshape(-1, 4),
            np.array([score for _, score, _ in rows], dtype=np.float32),
            np.array([which for _, _, which in rows], dtype=np.int64),
        )

    def _row(self, group: _Group) -> tuple[NDArray[np.float64], float, int]:
        """Mean box, weighted by the scores; mean score of the looks that suit it; number of the class."""
        suiting = [number for number, variant in enumerate(self.variants) if variant.suits(group.box)]
        scores = [group.seen[number][0] for number in suiting if number in group.seen]
        seen = group.seen.values()
        box = np.average([box for _, box in seen], axis=0, weights=[score for score, _ in seen])
        mean = sum(scores) / len(suiting) if suiting else sum(score for score, _ in seen) / len(self.variants)
        return box, float(mean), self.class_names.index(group.class_name)


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
