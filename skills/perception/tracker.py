"""Tracks objects over several views: position, class and belief in the existence of each.

A detection is associated with the track that it fits by position (Mahalanobis distance) and class; positions are fused
in information form (inverse covariances add). A track loses belief when a picture should show it and does not. A
detection with a low score begins no track unless depth shows its object as a cluster of its own. A segment without a
label (`ANY_OBJECT`) shows that something is there, and is evidence against all classes.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from skills.class_forms import ANY_OBJECT
from skills.perception.class_evidence import MOST_SURE, NEW_IN_A_VIEW, SURE_SCORE, ClassEvidence
from skills.perception.detection_3d import Detection3D
from skills.robot import FloatArray

GATE = 16.3
"""Squared Mahalanobis distance that holds 99.9 % of the detections of an object."""
DIFFERENT_PLACES_M = 0.03
CONFIRMED_BELIEF = 0.6
CONFIRMED_CLASS = 0.95
"""Least probability of a class that counts as recognised."""
_SEGMENT_BELIEF = 0.7
"""Probability that a segment is an object: one picture may show noise, or a part of one."""
_JITTER_M = 0.012
_NEAR_M = 0.03
_CONFUSED = 0.02
_SEGMENT_WITHIN_M = 0.06
"""Distance within which a segment without a label shows a track's object."""
_MISSED_IF_THERE = 0.15
_MISSED_IF_NOT = 0.88
_SEEN_BY_CHANCE = 0.25
"""Fraction of objects among all detections, faint ones included."""
_MOST_BELIEF = 0.999
_LEAST_BELIEF = 0.05


@dataclass(frozen=True)
class Track:
    """Track of one object. `position_W` with `covariance` (3, 3) from the views, without the localisation's error.

    `evidence` gives the probabilities of the classes, `belief` is the probability that the object exists. `eyes_W` are
    the camera positions that saw it; `latest` is its last detection, `best` the one with the highest score.
    """

    number: int
    evidence: ClassEvidence
    belief: float
    position_W: FloatArray
    covariance: FloatArray
    eyes_W: tuple[tuple[float, float, float], ...]
    latest: Detection3D
    best: Detection3D
    missed: int = 0

    @property
    def classes(self) -> Mapping[str, float]:
        """Probabilities of the classes."""
        return self.evidence.probabilities

    @property
    def class_name(self) -> str:
        """Most likely class; `ANY_OBJECT` when no view had a label, or none is likely."""
        return max(self.classes, key=self.classes.__getitem__)

    @property
    def class_belief(self) -> float:
        """Probability of `class_name`."""
        return self.classes[self.class_name]

    @property
    def views(self) -> int:
        """Number of different camera positions that saw the object."""
        return len(self.eyes_W)

    @property
    def last_seen_s(self) -> float:
        """Time of the last detection."""
        return self.latest.stamp_s

    def is_confirmed(self, views: int = 2) -> bool:
        """Returns whether the object exists and is likely of its class; less so where one view must do."""
        least = CONFIRMED_CLASS if views > 1 else CONFIRMED_BELIEF
        return self.exists(views) and self.evidence.is_sure(self.class_name) and self.class_belief >= least

    def exists(self, views: int = 2) -> bool:
        """Returns whether enough views saw an object of any class, with enough belief."""
        return self.views >= views and self.belief >= CONFIRMED_BELIEF


class Tracker:
    """Tracks objects, updated with the detections in each picture."""

    def __init__(self, class_names: Sequence[str]) -> None:
        self._names = tuple(class_names)
        self._tracks: dict[int, Track] = {}
        self._count = 0

    def snapshot(self) -> tuple[Track, ...]:
        """All tracks, highest belief first."""
        return tuple(sorted(self._tracks.values(), key=lambda track: (-track.belief, track.number)))

    def update(self, seen: Sequence[Detection3D], in_plain_view: Callable[[Track], bool]) -> tuple[Track, ...]:
        """Updates the tracks with a picture's detections; `in_plain_view` says whether it should show a track."""
        before, seen = tuple(self._tracks.values()), without_duplicates(seen)
        pairs = _matched_surest_first(before, seen)
        for track in before:
            if track.number not in pairs.values() and in_plain_view(track):
                self._miss(track)
        for k, detected in enumerate(seen):
            if k in pairs:
                self._tracks[pairs[k]] = _fused(self._tracks[pairs[k]], detected)
            elif detected.detection.score >= SURE_SCORE or detected.is_segmented:
                self._begin(detected)
        return self.snapshot()

    def _begin(self, detected: Detection3D) -> None:
        self._count += 1
        eye = _point(detected.eye_W)
        self._tracks[self._count] = Track(
            number=self._count,
            evidence=ClassEvidence.none(self._names).add(detected.detection, detected.shape),
            belief=_existence(detected),
            position_W=detected.position_W,
            covariance=_spread(detected),
            eyes_W=(eye,),
            latest=detected,
            best=detected,
        )

    def _miss(self, track: Track) -> None:
        belief = _updated(track.belief, _MISSED_IF_THERE / _MISSED_IF_NOT)
        if belief < _LEAST_BELIEF:
            del self._tracks[track.number]
        else:
            self._tracks[track.number] = replace(track, belief=belief, missed=track.missed + 1)


def without_duplicates(seen: Sequence[Detection3D]) -> tuple[Detection3D, ...]:
    """Removes the worse detection when one picture shows an object as two classes."""
    unique: list[Detection3D] = []
    for one in sorted(seen, key=lambda detected: -detected.detection.score):
        if not any(_is_same_object(one, other) for other in unique):
            unique.append(one)
    return tuple(unique)


def _is_same_object(one: Detection3D, other: Detection3D) -> bool:
    apart_m = float(np.linalg.norm(one.position_W - other.position_W))
    return one.class_name != other.class_name and apart_m < _NEAR_M


def _matched_surest_first(tracks: Sequence[Track], seen: Sequence[Detection3D]) -> dict[int, int]:
    """Matches high scores first, then low ones with the remaining tracks: track number by detection index."""
    sure, faint = (
        [k for k, s in enumerate(seen) if (s.detection.score >= SURE_SCORE) is wanted] for wanted in (True, False)
    )
    pairs: dict[int, int] = {}
    for rows in (sure, faint):
        free = [track for track in tracks if track.number not in pairs.values()]
        pairs |= {rows[k]: number for k, number in _matched(free, [seen[k] for k in rows]).items()}
    return pairs


def _matched(tracks: Sequence[Track], seen: Sequence[Detection3D]) -> dict[int, int]:
    """Matches detections and tracks one to one, nearest pairs first: track number by detection index."""
    options = [
        (squared_distance(track, s), k, track.number) for track in tracks for k, s in enumerate(seen) if fits(track, s)
    ]
    pairs: dict[int, int] = {}
    for _, k, number in sorted(options):
        if k not in pairs and number not in pairs.values():
            pairs[k] = number
    return pairs


def fits(track: Track, detected: Detection3D) -> bool:
    """Returns whether a detection may show a track's object: near enough, and of a possible class.

    A detection within 3 cm shows the same object, whatever its class. A segment within 6 cm does so too, however high
    its middle is: a picture's edge may have cut off the other view.
    """
    off = track.position_W - detected.position_W
    if ANY_OBJECT in (detected.class_name, track.class_name) and np.linalg.norm(off[:2]) < _SEGMENT_WITHIN_M:
        return True
    possible = track.classes.get(detected.class_name, 1.0) > _CONFUSED or float(np.linalg.norm(off)) < _NEAR_M
    return possible and squared_distance(track, detected) < GATE


def squared_distance(track: Track, detected: Detection3D) -> float:
    """Squared Mahalanobis distance between a detection and a track."""
    off = track.position_W - detected.position_W
    return float(off @ np.linalg.solve(track.covariance + _spread(detected), off))


def _spread(detected: Detection3D) -> FloatArray:
    """Covariance of a detection, plus the localisation's jitter between two views."""
    return np.asarray(detected.covariance + _JITTER_M**2 * np.eye(3))


def _fused(track: Track, detected: Detection3D) -> Track:
    """Fuses a track with one more detection."""
    track_information, information = np.linalg.inv(track.covariance), np.linalg.inv(_spread(detected))
    covariance = np.linalg.inv(track_information + information)
    position = covariance @ (track_information @ track.position_W + information @ detected.position_W)
    eye = _point(detected.eye_W)
    known = any(math.dist(one, eye) < DIFFERENT_PLACES_M for one in track.eyes_W)
    return replace(
        track,
        evidence=track.evidence if known else track.evidence.add(detected.detection, detected.shape),
        belief=_updated(track.belief, _evidence(detected)),
        position_W=position,
        covariance=covariance,
        eyes_W=track.eyes_W if known else (*track.eyes_W, eye),
        latest=_latest(track, detected),
        best=max(track.best, detected, key=lambda one: (one.class_name != ANY_OBJECT, one.detection.score)),
    )


def _latest(track: Track, detected: Detection3D) -> Detection3D:
    """Last detection for a track; one with a low score, or a segment, only renews the time of a labelled one."""
    is_label = detected.class_name != ANY_OBJECT and detected.detection.score >= SURE_SCORE
    if is_label or track.latest.class_name == ANY_OBJECT:
        return detected
    return replace(track.latest, stamp_s=detected.stamp_s)


def _existence(detected: Detection3D) -> float:
    """Probability that a detection shows an object of any class."""
    score = min(detected.detection.score, MOST_SURE)
    return max(score, _SEGMENT_BELIEF) if detected.is_segmented else score


def _evidence(detected: Detection3D) -> float:
    """Likelihood ratio of a detection with and without an object.

    Assumes that a score is the fraction of correct detections, as it nearly is (docs/detecting.md).
    """
    ratio = _odds(_existence(detected)) / _odds(_SEEN_BY_CHANCE)
    return math.pow(ratio, NEW_IN_A_VIEW)


def _updated(belief: float, ratio: float) -> float:
    """Updates a belief by Bayes' rule with a likelihood ratio."""
    odds = _odds(belief) * ratio
    return min(odds / (1.0 + odds), _MOST_BELIEF)


def _odds(probability: float) -> float:
    return probability / (1.0 - probability)


def _point(p: FloatArray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in p)
    return x, y, z
