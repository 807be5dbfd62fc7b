"""Tracks objects over several views: position, class and belief in the existence of each.

A detection is associated with the track that it fits by position (Mahalanobis distance) and class; positions are fused
in information form (inverse covariances add). A track loses belief when a picture should show it and does not. A
detection with a low score begins no track, but supports one. A segment without a label (`ANY_OBJECT`) gives a position,
and no evidence of a class, unless `ANY_OBJECT` is among the tracker's names: then it means that the segment is none of
the others.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from skills.perception.class_forms import ANY_OBJECT
from skills.perception.detection_3d import Detection3D
from skills.robot import FloatArray

GATE = 16.3
"""Squared Mahalanobis distance that holds 99.9 % of the detections of an object."""
DIFFERENT_PLACES_M = 0.03
CONFIRMED_BELIEF = 0.6
SURE_SCORE = 0.5
FAINT_SCORE = 0.3
"""Least scores of a detection that begins a track, and of one that supports it."""
_JITTER_M = 0.012
_NEAR_M = 0.03
_CONFUSED = 0.02
_MISSED_IF_THERE = 0.15
_MISSED_IF_NOT = 0.88
_SEEN_BY_CHANCE = 0.25
"""Fraction of objects among all detections, faint ones included."""
_NEW_IN_A_VIEW = 0.5
"""Fraction of a view's evidence that is new; 1 would be views with independent errors."""
_MOST_SURE = 0.97
_MOST_BELIEF = 0.999
_LEAST_BELIEF = 0.05


@dataclass(frozen=True)
class Track:
    """Track of one object. `position_W` with `covariance` (3, 3) from the views, without the localisation's error.

    `classes` are the probabilities of the classes, `belief` the probability that the object exists. `eyes_W` are the
    camera positions that saw it; `latest` is its last detection, `best` the one with the highest score.
    """

    number: int
    classes: Mapping[str, float]
    belief: float
    position_W: FloatArray
    covariance: FloatArray
    eyes_W: tuple[tuple[float, float, float], ...]
    latest: Detection3D
    best: Detection3D
    missed: int = 0

    @property
    def class_name(self) -> str:
        """Most likely class; `ANY_OBJECT` when no view had a label."""
        return ANY_OBJECT if self.best.class_name == ANY_OBJECT else max(self.classes, key=self.classes.__getitem__)

    @property
    def class_belief(self) -> float:
        """Probability of `class_name`; 1 for `ANY_OBJECT`, which every object is."""
        return self.classes.get(self.class_name, 1.0)

    @property
    def views(self) -> int:
        """Number of different camera positions that saw the object."""
        return len(self.eyes_W)

    @property
    def last_seen_s(self) -> float:
        """Time of the last detection."""
        return self.latest.stamp_s

    def is_confirmed(self, views: int = 2) -> bool:
        """Returns whether the object exists and is likely of its class, also according to its last detection."""
        return (
            self.exists(views) and self.class_belief >= CONFIRMED_BELIEF and self.latest.class_name == self.class_name
        )

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
                self._tracks[pairs[k]] = _fused(self._tracks[pairs[k]], detected, self._names)
            elif detected.detection.score >= SURE_SCORE:
                self._begin(detected)
        return self.snapshot()

    def _begin(self, detected: Detection3D) -> None:
        self._count += 1
        even = MappingProxyType(dict.fromkeys(self._names, 1.0 / max(len(self._names), 1)))
        eye = _point(detected.eye_W)
        self._tracks[self._count] = Track(
            number=self._count,
            classes=_classes(even, detected),
            belief=min(detected.detection.score, _MOST_SURE),
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

    A detection within 3 cm shows the same object, whatever its class.
    """
    apart_m = float(np.linalg.norm(track.position_W - detected.position_W))
    possible = track.classes.get(detected.class_name, 1.0) > _CONFUSED or apart_m < _NEAR_M
    return possible and squared_distance(track, detected) < GATE


def squared_distance(track: Track, detected: Detection3D) -> float:
    """Squared Mahalanobis distance between a detection and a track."""
    off = track.position_W - detected.position_W
    return float(off @ np.linalg.solve(track.covariance + _spread(detected), off))


def _spread(detected: Detection3D) -> FloatArray:
    """Covariance of a detection, plus the localisation's jitter between two views."""
    return np.asarray(detected.covariance + _JITTER_M**2 * np.eye(3))


def _fused(track: Track, detected: Detection3D, names: Sequence[str]) -> Track:
    """Fuses a track with one more detection."""
    track_information, information = np.linalg.inv(track.covariance), np.linalg.inv(_spread(detected))
    covariance = np.linalg.inv(track_information + information)
    position = covariance @ (track_information @ track.position_W + information @ detected.position_W)
    eye = _point(detected.eye_W)
    known = any(math.dist(one, eye) < DIFFERENT_PLACES_M for one in track.eyes_W)
    return replace(
        track,
        classes=_classes(track.classes, detected),
        belief=_updated(track.belief, _evidence(detected)),
        position_W=position,
        covariance=covariance,
        eyes_W=track.eyes_W if known else (*track.eyes_W, eye),
        latest=_latest(track, detected),
        best=max(track.best, detected, key=lambda one: (one.class_name != ANY_OBJECT, one.detection.score)),
    )


def _latest(track: Track, detected: Detection3D) -> Detection3D:
    """Last detection for a track.

    A detection with a low score of the same class, or a segment, only renews the time of the previous one.
    """
    unlabelled = detected.class_name == ANY_OBJECT != track.latest.class_name and ANY_OBJECT not in track.classes
    if detected.detection.score >= SURE_SCORE and not unlabelled:
        return detected
    same = unlabelled or detected.class_name == track.latest.class_name
    return replace(track.latest, stamp_s=detected.stamp_s) if same else track.latest


def _classes(before: Mapping[str, float], detected: Detection3D) -> Mapping[str, float]:
    """Class probabilities after a detection; the rest of its scores is spread over the other classes."""
    if detected.class_name == ANY_OBJECT and ANY_OBJECT not in before:
        return before
    score = float(np.clip(detected.detection.score, 0.3, 0.97))
    others = (1.0 - score) / max(len(before) - 1, 1)
    scores = {name: max(alternative, others) for name, alternative in detected.detection.alternatives} | {
        detected.class_name: score
    }
    raw = {name: p * scores.get(name, others) for name, p in before.items()}
    total = sum(raw.values())
    return MappingProxyType({name: max(value / total, 1e-3) for name, value in raw.items()})


def _evidence(detected: Detection3D) -> float:
    """Likelihood ratio of a detection with and without an object.

    Assumes that a score is the fraction of correct detections, as it nearly is (docs/finding-things.md).
    """
    ratio = _odds(min(detected.detection.score, _MOST_SURE)) / _odds(_SEEN_BY_CHANCE)
    return math.pow(ratio, _NEW_IN_A_VIEW)


def _updated(belief: float, ratio: float) -> float:
    """Updates a belief by Bayes' rule with a likelihood ratio."""
    odds = _odds(belief) * ratio
    return min(odds / (1.0 + odds), _MOST_BELIEF)


def _odds(probability: float) -> float:
    return probability / (1.0 - probability)


def _point(p: FloatArray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in p)
    return x, y, z
