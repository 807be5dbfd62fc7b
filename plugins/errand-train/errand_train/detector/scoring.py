"""Evaluation of a detector: figures of labels and detections.

Average precision as COCO computes it, precision and recall at a score, false detections in pictures without objects,
and recall by size, distance and visibility.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from errand_train.detector.matching import Evaluation, evaluate
from errand_train.detector.scoring_labels import Label, LabelledPicture, long_side_px
from skills.api import Detection

SURE_SCORE: Final = 0.5
HAND: Final = "hand"
BODY: Final = "body"
BODY_CLASSES: Final = ("person",)
"""Classes that the body cameras detect."""
SIZE_EDGES_PX: Final = (0.0, 12.0, 24.0, 48.0, 96.0, 192.0, np.inf)
DISTANCE_EDGES_M: Final = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0, np.inf)
VISIBILITY_EDGES: Final = (0.0, 0.25, 0.4, 0.6, 0.8, 0.95, np.inf)

Found = tuple[Detection, ...]


@dataclass(frozen=True)
class ClassScore:
    """Figures of one class; None where no label counts, and for precision without detections."""

    name: str
    labels: int
    ap50: float | None
    ap50_95: float | None
    precision: float | None
    recall: float | None


@dataclass(frozen=True)
class Bin:
    """Number of labels between two limits (low <= value < high), and their recall."""

    low: float
    high: float
    labels: int
    recall: float | None


@dataclass(frozen=True)
class Score:
    """All figures. Precision and recall are over the detections of all classes, at SURE_SCORE and overlap 0.5.

    Only labels of at least 24 x 8 pixels with 40 % visible count; other labels, and unmatched detections below that
    size, are ignored. Bins hold all labels that the file does not mark to be ignored: by size and by distance those
    with 40 % visible, by visibility those that are large enough.
    """

    pictures: int
    map50: float | None
    map50_95: float | None
    precision: float | None
    recall: float | None
    classes: tuple[ClassScore, ...]
    distractor_pictures: int
    false_per_100_distractor_pictures: float | None
    by_size_px: tuple[Bin, ...]
    by_distance_m: tuple[Bin, ...]
    by_visibility: tuple[Bin, ...]


def score(pictures: Sequence[LabelledPicture], found: Sequence[Found], class_names: Sequence[str]) -> Score:
    """Evaluates the detections of each picture. Raises ValueError unless both sequences have the same length."""
    if len(pictures) != len(found):
        raise ValueError(f"there are {len(pictures)} pictures, and detections for {len(found)}")
    evaluation = evaluate(pictures, found, class_names)
    counts = {name: _counts(evaluation, name) for name in class_names}
    classes = tuple(_class_score(evaluation, name, counts[name]) for name in class_names)
    together = sum(counts.values(), start=_Counts(0, 0, 0))
    empty = [one for picture, one in zip(pictures, found, strict=True) if picture.only_distractors]
    false = sum(detection.score >= SURE_SCORE for one in empty for detection in one)
    labels = _labels_found(pictures, found, class_names)
    return Score(
        pictures=len(pictures),
        map50=_mean([one.ap50 for one in classes]),
        map50_95=_mean([one.ap50_95 for one in classes]),
        precision=together.precision,
        recall=together.recall,
        classes=classes,
        distractor_pictures=len(empty),
        false_per_100_distractor_pictures=100.0 * false / len(empty) if empty else None,
        by_size_px=_bins(labels, SIZE_EDGES_PX, lambda one: long_side_px(one.box) if one.seen_enough else None),
        by_distance_m=_bins(labels, DISTANCE_EDGES_M, lambda one: one.distance_m if one.seen_enough else None),
        by_visibility=_bins(labels, VISIBILITY_EDGES, lambda one: one.visibility if one.large_enough else None),
    )


def by_camera(
    pictures: Sequence[LabelledPicture], found: Sequence[Found]
) -> dict[str, tuple[list[LabelledPicture], list[Found]]]:
    """Splits pictures and detections as the robot uses them: all classes by the hand camera, people by the others.

    A camera without pictures has no entry.
    """
    of: dict[str, tuple[list[LabelledPicture], list[Found]]] = {}
    for picture, ones in zip(pictures, found, strict=True):
        if picture.camera is None:
            continue
        kind = HAND if picture.camera == HAND else BODY
        if kind == BODY:
            picture = replace(picture, labels=tuple(one for one in picture.labels if one.class_name in BODY_CLASSES))
            ones = tuple(one for one in ones if one.class_name in BODY_CLASSES)
        kept = of.setdefault(kind, ([], []))
        kept[0].append(picture)
        kept[1].append(ones)
    return of


@dataclass(frozen=True)
class Judged:
    """Right and wrong detections of a picture from SURE_SCORE on, and missed labels.

    Ignored detections are in neither list.
    """

    right: tuple[Detection, ...]
    wrong: tuple[Detection, ...]
    missed: tuple[Label, ...]


def judge_picture(picture: LabelledPicture, found: Found, class_names: Sequence[str]) -> Judged:
    """Sorts the detections and labels of a picture into right, wrong and missed."""
    sure = tuple(one for one in found if one.score >= SURE_SCORE)
    evaluation = evaluate([picture], [sure], class_names)
    matches = [one for name in class_names for one in evaluation.matches(name)]
    on = {one.label for one in matches}
    missed = [label for k, label in enumerate(evaluation.labels) if label.counts and k not in on]
    return Judged(
        right=tuple(one.detection for one in matches if one.label is not None and not one.passed),
        wrong=tuple(one.detection for one in matches if one.label is None and not one.passed),
        missed=tuple(missed),
    )


def picture_errors(picture: LabelledPicture, found: Found, class_names: Sequence[str]) -> float:
    """Error in one picture: scores of wrong detections, and 1 - score of each label.

    A label without a detection adds 1.
    """
    evaluation = evaluate([picture], [found], class_names)
    matches = [one for name in class_names for one in evaluation.matches(name) if not one.passed]
    right = sum(one.detection.score for one in matches if one.label is not None)
    wrong = sum(one.detection.score for one in matches if one.label is None)
    return wrong + sum(label.counts for label in evaluation.labels) - right


@dataclass(frozen=True)
class _Counts:
    """Numbers of right and wrong detections from SURE_SCORE on, and of labels that count."""

    right: int
    wrong: int
    labels: int

    @property
    def precision(self) -> float | None:
        return self.right / (self.right + self.wrong) if self.right + self.wrong else None

    @property
    def recall(self) -> float | None:
        return self.right / self.labels if self.labels else None

    def __add__(self, other: _Counts) -> _Counts:
        return _Counts(self.right + other.right, self.wrong + other.wrong, self.labels + other.labels)


def _counts(evaluation: Evaluation, name: str) -> _Counts:
    sure = [one for one in evaluation.matches(name) if one.detection.score >= SURE_SCORE and not one.passed]
    right = sum(one.label is not None for one in sure)
    labels = sum(label.counts for label in evaluation.labels if label.class_name == name)
    return _Counts(right, len(sure) - right, labels)


def _class_score(evaluation: Evaluation, name: str, counts: _Counts) -> ClassScore:
    precisions = evaluation.average_precision(name)
    return ClassScore(
        name=name,
        labels=counts.labels,
        ap50=None if precisions is None else float(precisions[0]),
        ap50_95=None if precisions is None else float(np.mean(precisions)),
        precision=counts.precision,
        recall=counts.recall,
    )


def _labels_found(
    pictures: Sequence[LabelledPicture], found: Sequence[Found], class_names: Sequence[str]
) -> list[tuple[Label, bool]]:
    """Yields every label to find, of any size and visibility, and whether it is found at SURE_SCORE."""
    sure = [tuple(one for one in ones if one.score >= SURE_SCORE) for ones in found]
    evaluation = evaluate(pictures, sure, class_names, lambda label: label.judged)
    on = {one.label for name in class_names for one in evaluation.matches(name)}
    return [(label, k in on) for k, label in enumerate(evaluation.labels) if label.judged]


def _bins(
    labels: Sequence[tuple[Label, bool]], edges: Sequence[float], value_of: Callable[[Label], float | None]
) -> tuple[Bin, ...]:
    """Recalls between each two limits; labels without a value are left out, and so are bins when none has one."""
    known = [(value, hit) for label, hit in labels if (value := value_of(label)) is not None]
    if not known:
        return ()
    values, hits = (np.array(column, dtype=np.float64) for column in zip(*known, strict=True))
    return tuple(
        Bin(low, high, int(np.sum(inside)), float(np.mean(hits[inside])) if inside.any() else None)
        for low, high in pairwise(edges)
        for inside in [(values >= low) & (values < high)]
    )


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None
