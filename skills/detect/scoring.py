"""How good a detector is: pure figures of labels and detections.

Average precision as COCO reckons it, precision and recall at a score, false detections in pictures that hold nothing,
and recall by size, distance and visibility.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from skills.detect.scoring_labels import Label, LabelledPicture, large_enough, long_side_px
from skills.detect.scoring_matching import Matches, match
from skills.detect.scoring_precision import Counts, average_precision, counts_at
from skills.detection import Detection

__all__ = ["SURE_SCORE", "Bin", "ClassScore", "Judged", "Score", "judged", "picture_errors", "score"]

OVERLAPS: Final = tuple(float(value) for value in np.linspace(0.5, 0.95, 10))
SURE_SCORE: Final = 0.5
MOST_DETECTIONS: Final = 100
SIZE_EDGES_PX: Final = (0.0, 12.0, 24.0, 48.0, 96.0, 192.0, np.inf)
DISTANCE_EDGES_M: Final = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0, np.inf)
VISIBILITY_EDGES: Final = (0.0, 0.25, 0.4, 0.6, 0.8, 0.95, np.inf)

Found = tuple[Detection, ...]


@dataclass(frozen=True)
class ClassScore:
    """Figures of one class; None where nothing counts, or precision where nothing was found."""

    name: str
    labels: int
    ap50: float | None
    ap50_95: float | None
    precision: float | None
    recall: float | None


@dataclass(frozen=True)
class Bin:
    """How many labels lie between two limits (low <= value < high), and the share of them that is found."""

    low: float
    high: float
    labels: int
    recall: float | None


@dataclass(frozen=True)
class Score:
    """All figures. Precision and recall are of all classes' detections together, at SURE_SCORE and overlap 0.5.

    Only labels of at least 24 x 8 pixels of which 40 % are seen count; the rest is passed over, as are detections
    below that size that are on nothing. Bins are of all labels that the file does not mark to be ignored: by size and
    by distance those of which 40 % are seen, by visibility those that are large enough.
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
    """Judge what was found in each picture. Raises ValueError when there are not as many of one as of the other."""
    if len(pictures) != len(found):
        raise ValueError(f"there are {len(pictures)} pictures, and detections for {len(found)}")
    ranked = [_limited(one) for one in found]
    matches = {name: _class_matches(pictures, ranked, name) for name in class_names}
    counts = {name: counts_at(ones, SURE_SCORE) for name, ones in matches.items()}
    classes = tuple(_class_score(name, matches[name], counts[name]) for name in class_names)
    together = sum(counts.values(), start=Counts(0, 0, 0))
    empty = [one for picture, one in zip(pictures, found, strict=True) if picture.only_distractors]
    false = sum(detection.score >= SURE_SCORE for one in empty for detection in one)
    labels = _labels_found(pictures, ranked, class_names)
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


@dataclass(frozen=True)
class Judged:
    """What is right and wrong in a picture of the detections from SURE_SCORE on, and which labels are missed.

    What is passed over is in neither.
    """

    right: tuple[Detection, ...]
    wrong: tuple[Detection, ...]
    missed: tuple[Label, ...]


def judged(picture: LabelledPicture, found: Found, class_names: Sequence[str]) -> Judged:
    """Sort a picture's detections and labels."""
    sure = tuple(one for one in _limited(found) if one.score >= SURE_SCORE)
    right, wrong, missed = list[Detection](), list[Detection](), list[Label]()
    for name in class_names:
        own = [one for one in sure if one.class_name == name]
        labels = [label for label in picture.labels if label.class_name == name]
        result = _matches(picture, sure, name, counts=lambda label: label.counts, at=OVERLAPS[:1])
        told = zip(own, result.found[0], result.passed[0], strict=True)
        for one, hit, passed in told:
            if not passed:
                (right if hit else wrong).append(one)
        found_by = zip(labels, result.label_found[0], strict=True)
        missed += [label for label, finder in found_by if label.counts and finder < 0]
    return Judged(tuple(right), tuple(wrong), tuple(missed))


def picture_errors(picture: LabelledPicture, found: Found, class_names: Sequence[str]) -> float:
    """How wrong a detector is in one picture: scores of what is not there, and 1 - score for what was to be found.

    A label on which there is nothing adds 1.
    """
    return sum(_class_errors(picture, _limited(found), name) for name in class_names)


def _class_errors(picture: LabelledPicture, found: Found, name: str) -> float:
    result = _matches(picture, found, name, counts=lambda label: label.counts, at=OVERLAPS[:1])
    wrong = float(np.sum(result.scores[~result.found[0] & ~result.passed[0]]))
    right = float(np.sum(result.scores[result.found[0] & ~result.passed[0]]))
    return wrong + result.counting - right


def _class_score(name: str, matches: Sequence[Matches], counts: Counts) -> ClassScore:
    precisions = average_precision(matches)
    return ClassScore(
        name=name,
        labels=counts.labels,
        ap50=None if precisions is None else float(precisions[0]),
        ap50_95=None if precisions is None else float(np.mean(precisions)),
        precision=counts.precision,
        recall=counts.recall,
    )


def _class_matches(pictures: Sequence[LabelledPicture], found: Sequence[Found], name: str) -> list[Matches]:
    return [
        _matches(picture, ones, name, counts=lambda label: label.counts, at=OVERLAPS)
        for picture, ones in zip(pictures, found, strict=True)
    ]


def _matches(
    picture: LabelledPicture, found: Found, name: str, *, counts: Callable[[Label], bool], at: Sequence[float]
) -> Matches:
    """Detections and labels of one class in one picture; labels that do not count are passed over."""
    own = [one for one in found if one.class_name == name]
    labels = [label for label in picture.labels if label.class_name == name]
    return match(
        _boxes([one.box for one in own]),
        np.array([one.score for one in own], dtype=np.float64),
        _boxes([label.box for label in labels]),
        crowd=_flags([label.crowd for label in labels]),
        passed=_flags([not counts(label) for label in labels]),
        small=_flags([not large_enough(one.box) for one in own]),
        at=at,
    )


def _labels_found(
    pictures: Sequence[LabelledPicture], found: Sequence[Found], class_names: Sequence[str]
) -> list[tuple[Label, bool]]:
    """Every label that the file asks for, of any size and visibility, and whether it is found at SURE_SCORE."""
    judged = list[tuple[Label, bool]]()
    for picture, ones in zip(pictures, found, strict=True):
        sure = tuple(one for one in ones if one.score >= SURE_SCORE)
        for name in class_names:
            result = _matches(picture, sure, name, counts=lambda label: label.judged, at=OVERLAPS[:1])
            labels = [label for label in picture.labels if label.class_name == name]
            hits = result.label_found[0] >= 0
            judged += [(label, bool(hit)) for label, hit in zip(labels, hits, strict=True) if label.judged]
    return judged


def _bins(
    labels: Sequence[tuple[Label, bool]], edges: Sequence[float], value_of: Callable[[Label], float | None]
) -> tuple[Bin, ...]:
    """Recall between each two limits; labels without a value are left out, and so are bins when none has one."""
    known = [(value, hit) for label, hit in labels if (value := value_of(label)) is not None]
    if not known:
        return ()
    values, hits = (np.array(column, dtype=np.float64) for column in zip(*known, strict=True))
    return tuple(
        Bin(low, high, int(np.sum(inside)), float(np.mean(hits[inside])) if inside.any() else None)
        for low, high in pairwise(edges)
        for inside in [(values >= low) & (values < high)]
    )


def _limited(found: Found) -> Found:
    """The surest detections of each class, MOST_DETECTIONS at most."""
    kept = dict[str, list[Detection]]()
    for one in sorted(found, key=lambda detection: -detection.score):
        kept.setdefault(one.class_name, []).append(one)
    return tuple(one for ones in kept.values() for one in ones[:MOST_DETECTIONS])


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _boxes(boxes: Sequence[tuple[float, float, float, float]]) -> NDArray[np.float64]:
    return np.array(boxes, dtype=np.float64).reshape(-1, 4)


def _flags(values: Sequence[bool]) -> NDArray[np.bool_]:
    return np.array(values, dtype=bool)
