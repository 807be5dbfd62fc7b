"""Matching of detections and labels by COCO's own evaluation (pycocotools).

COCO's range of areas makes its tools ignore labels that do not count: they get an area outside the range, and so do
unmatched detections that are too small to count.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from errand_train.detector.scoring_labels import Label, LabelledPicture, large_enough
from skills.api import Detection

MOST_DETECTIONS: Final = 100
_COUNTING: Final = (0.5, 1.5)

Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Match:
    """A detection of a picture, the number of its label (or None), and whether it is ignored."""

    picture: int
    detection: Detection
    label: int | None
    passed: bool


@dataclass(frozen=True)
class Evaluation:
    """COCO's evaluation of detections in pictures, with labels by number."""

    labels: tuple[Label, ...]
    class_names: tuple[str, ...]
    _detections: tuple[Detection, ...]
    _coco: Any

    def average_precision(self, name: str) -> NDArray[np.float64] | None:
        """Average precision of a class at COCO's ten overlaps; None where no label counts."""
        precision = self._coco.eval["precision"][:, :, self.class_names.index(name), 0, 0]
        return None if (precision < 0).any() else np.asarray(precision.mean(axis=1))

    def matches(self, name: str) -> Iterator[Match]:
        """Yields the detections of a class matched at an overlap of 0.5, best of each picture first."""
        per_class = len(self._coco.params.imgIds)
        first = self.class_names.index(name) * per_class
        for one in self._coco.evalImgs[first : first + per_class]:
            if one is not None:
                rows = zip(one["dtIds"], one["dtMatches"][0], one["dtIgnore"][0], strict=True)
                for number, label, passed in rows:
                    on = int(label) - 1 if label else None
                    yield Match(one["image_id"], self._detections[number - 1], on, bool(passed))


def evaluate(
    pictures: Sequence[LabelledPicture],
    found: Sequence[Sequence[Detection]],
    class_names: Sequence[str],
    counts: Callable[[Label], bool] = lambda label: label.counts,
) -> Evaluation:
    """Evaluates the detections of each picture. Ignores labels that do not count."""
    from pycocotools.cocoeval import COCOeval  # takes long to import

    labels = [(k, one) for k, picture in enumerate(pictures) for one in picture.labels if one.class_name in class_names]
    detections = [(k, one) for k, ones in enumerate(found) for one in ones if one.class_name in class_names]
    truth = [
        _entry(k, number, one.class_name, one.box, class_names, counts(one), iscrowd=int(one.crowd))
        for number, (k, one) in enumerate(labels, start=1)
    ]
    seen = [
        _entry(k, number, one.class_name, one.box, class_names, large_enough(one.box), score=one.score, iscrowd=0)
        for number, (k, one) in enumerate(detections, start=1)
    ]
    with contextlib.redirect_stdout(io.StringIO()):
        coco = COCOeval(_coco(truth, len(pictures), class_names), _coco(seen, len(pictures), class_names), "bbox")
        coco.params.areaRng, coco.params.areaRngLbl = [list(_COUNTING)], ["counting"]
        coco.params.maxDets = [MOST_DETECTIONS]
        coco.params.imgIds, coco.params.catIds = list(range(len(pictures))), list(range(len(class_names)))
        coco.evaluate()
        coco.accumulate()
    return Evaluation(tuple(one for _, one in labels), tuple(class_names), tuple(one for _, one in detections), coco)


def _entry(
    picture: int, number: int, name: str, box: Box, class_names: Sequence[str], counts: bool, **more: float
) -> dict[str, Any]:
    u0, v0, u1, v1 = box
    entry = {"id": number, "image_id": picture, "category_id": class_names.index(name), "area": float(counts)}
    return {**entry, "bbox": [u0, v0, u1 - u0, v1 - v0], **more}


def _coco(annotations: list[dict[str, Any]], pictures: int, class_names: Sequence[str]) -> Any:
    from pycocotools.coco import COCO

    made = COCO()
    made.dataset = {
        "images": [{"id": k} for k in range(pictures)],
        "categories": [{"id": k} for k in range(len(class_names))],
        "annotations": annotations,
    }
    made.createIndex()
    return made
