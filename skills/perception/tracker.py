"""Objects seen over several views: one track for each, with its place, its class and how sure it is that it is there.

A detection belongs to the track that it fits by place (Mahalanobis distance) and class; places are fused as information
(inverse covariances add). A track that a picture should show and that is not detected there loses belief. What is seen
faintly begins no track, but supports a little one that a surer one began. A segment without a label (`THING`) says
where an object is, and nothing about its class.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from skills.perception.class_forms import THING
from skills.perception.detection_3d import Detection3D
from skills.robot import FloatArray

GATE = 16.3
"""Squared Mahalanobis distance within which 99.9 % of the detections of an object lie."""
DIFFERENT_PLACES_M = 0.03
CONFIRMED_BELIEF = 0.6
SURE_SCORE = 0.5
FAINT_SCORE = 0.3
"""Scores from which on a detection begins a track, or supports one."""
_JITTER_M = 0.012
_NEAR_M = 0.03
_CONFUSED = 0.02
_MISSED_IF_THERE, _MISSED_IF_NOT = 0.15, 0.88
_SEEN_BY_CHANCE = 0.25
"""The share of objects among all that is seen at least faintly."""
_NEW_IN_A_VIEW = 0.5
"""How much of what a view tells the others have not told yet; 1 were views that err independently."""
_MOST_SURE = 0.97
_MOST_BELIEF, _LEAST_BELIEF = 0.999, 0.05


@dataclass(frozen=True)
class Track:
    """One object. `position_W` with `covariance` (3, 3) from the views, without the localisation's error.

    `classes` says how likely each class is, `belief` how likely it is that something is there at all. `views` counts
    the places that it was seen from; `latest` is its last detection, `best` its surest one.
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
        """The likeliest class; `THING` where no view had a label for it."""
        return THING if self.best.class_name == THING else max(self.classes, key=lambda name: self.classes[name])

    @property
    def class_belief(self) -> float:
        """How likely it is of `class_name`; 1 for a `THING`, which everything is."""
        return self.classes.get(self.class_name, 1.0)

    @property
    def views(self) -> int:
        """From how many different places it was seen."""
        return len(self.eyes_W)

    @property
    def last_seen_s(self) -> float:
        """When it was seen last."""
        return self.latest.stamp_s

    def confirmed(self, views: int = 2) -> bool:
        """An object for sure, believed to be of its class, and taken for the same when it was seen last."""
        return (
            self.stands(views) and self.class_belief >= CONFIRMED_BELIEF and self.latest.class_name == self.class_name
        )

    def stands(self, views: int = 2) -> bool:
        """Seen from so many places and believed, whatever it is."""
        return self.views >= views and self.belief >= CONFIRMED_BELIEF


class Tracker:
    """Keeps tracks up to date with the detections of each picture."""

    def __init__(self, class_names: Sequence[str]) -> None:
        self._names = tuple(class_names)
        self._tracks: dict[int, Track] = {}
        self._count = 0

    def snapshot(self) -> tuple[Track, ...]:
        """All tracks, the surest first."""
        return tuple(sorted(self._tracks.values(), key=lambda track: (-track.belief, track.number)))

    def update(self, seen: Sequence[Detection3D], in_plain_view: Callable[[Track], bool]) -> tuple[Track, ...]:
        """Takes in the detections of one picture; `in_plain_view` says whether it should show a track."""
        before, seen = tuple(self._tracks.values()), distinct(seen)
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


def distinct(seen: Sequence[Detection3D]) -> tuple[Detection3D, ...]:
    """The detections of one picture, each object once where it was detected as two classes."""
    kept: list[Detection3D] = []
    for one in sorted(seen, key=lambda detected: -detected.detection.score):
        if not any(_is_same_thing(one, other) for other in kept):
            kept.append(one)
    return tuple(kept)


def _is_same_thing(one: Detection3D, other: Detection3D) -> bool:
    apart_m = float(np.linalg.norm(one.position_W - other.position_W))
    return one.class_name != other.class_name and apart_m < _NEAR_M


def _matched_surest_first(tracks: Sequence[Track], seen: Sequence[Detection3D]) -> dict[int, int]:
    """The same as `_matched`, in which faint detections are given what the sure ones leave."""
    sure, faint = (
        [k for k, s in enumerate(seen) if (s.detection.score >= SURE_SCORE) is wanted] for wanted in (True, False)
    )
    pairs: dict[int, int] = {}
    for rows in (sure, faint):
        free = [track for track in tracks if track.number not in pairs.values()]
        pairs |= {rows[k]: number for k, number in _matched(free, [seen[k] for k in rows]).items()}
    return pairs


def _matched(tracks: Sequence[Track], seen: Sequence[Detection3D]) -> dict[int, int]:
    """Which detection (its index) belongs to which track (its number): the nearest pairs first, one to one."""
    options = [(distance2(track, s), k, track.number) for track in tracks for k, s in enumerate(seen) if fits(track, s)]
    pairs: dict[int, int] = {}
    for _, k, number in sorted(options):
        if k not in pairs and number not in pairs.values():
            pairs[k] = number
    return pairs


def fits(track: Track, detected: Detection3D) -> bool:
    """Returns whether a detection can be of a track's object: near enough, and of a class that it may have.

    What is within 3 cm is the same object, whatever its class.
    """
    apart_m = float(np.linalg.norm(track.position_W - detected.position_W))
    possible = track.classes.get(detected.class_name, 1.0) > _CONFUSED or apart_m < _NEAR_M
    return possible and distance2(track, detected) < GATE


def distance2(track: Track, detected: Detection3D) -> float:
    """The squared Mahalanobis distance of a detection from a track."""
    off = track.position_W - detected.position_W
    return float(off @ np.linalg.solve(track.covariance + _spread(detected), off))


def _spread(detected: Detection3D) -> FloatArray:
    """The covariance of a detection with what the localisation jitters between two views."""
    return np.asarray(detected.covariance + _JITTER_M**2 * np.eye(3))


def _fused(track: Track, detected: Detection3D, names: Sequence[str]) -> Track:
    """The track with one more detection."""
    track_information, information = np.linalg.inv(track.covariance), np.linalg.inv(_spread(detected))
    covariance = np.linalg.inv(track_information + information)
    position = covariance @ (track_information @ track.position_W + information @ detected.position_W)
    return replace(
        track,
        classes=_classes(track.classes, detected),
        belief=_updated(track.belief, _evidence(detected)),
        position_W=position,
        covariance=covariance,
        eyes_W=_with_eye(track.eyes_W, _point(detected.eye_W)),
        latest=_latest(track, detected),
        best=max(track.best, detected, key=lambda one: (one.class_name != THING, one.detection.score)),
    )


def _latest(track: Track, detected: Detection3D) -> Detection3D:
    """What was seen last.

    A faint detection tells no more than that it was still there, if it is of the same class; so does a segment.
    """
    unlabelled = detected.class_name == THING != track.latest.class_name
    if detected.detection.score >= SURE_SCORE and not unlabelled:
        return detected
    same = unlabelled or detected.class_name == track.latest.class_name
    return replace(track.latest, stamp_s=detected.stamp_s) if same else track.latest


def _classes(before: Mapping[str, float], detected: Detection3D) -> Mapping[str, float]:
    """Class beliefs after a detection: its scores for its class and the alternatives, the rest spread over others."""
    if detected.class_name == THING:
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
    """How much likelier a detection is of an object than of nothing.

    Scores are taken for the shares of detections that are right, as they are about (docs/finding-things.md).
    """
    likelier = _odds(min(detected.detection.score, _MOST_SURE)) / _odds(_SEEN_BY_CHANCE)
    return math.pow(likelier, _NEW_IN_A_VIEW)


def _updated(belief: float, likelier: float) -> float:
    """Bayes' rule for something that is there or not, by how much likelier what is seen is when it is there."""
    odds = _odds(belief) * likelier
    return min(odds / (1.0 + odds), _MOST_BELIEF)


def _odds(probability: float) -> float:
    return probability / (1.0 - probability)


def _with_eye(
    eyes: tuple[tuple[float, float, float], ...], eye: tuple[float, float, float]
) -> tuple[tuple[float, float, float], ...]:
    """The places seen from, with one more when it is a different one."""
    return eyes if any(math.dist(one, eye) < DIFFERENT_PLACES_M for one in eyes) else (*eyes, eye)


def _point(p: FloatArray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in p)
    return x, y, z
