"""Selection among tracks and clusters: which objects a search counts, and which need a closer view."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from skills.api import FLOOR, ObjectObservation, Surface
from skills.class_forms import ANY_OBJECT, MEANS_BIG, class_form
from skills.descriptions import count_of, surface_names
from skills.inputs.errors import listing
from skills.perception.detection_3d import Detection3D, has_attribute
from skills.perception.tracker import CONFIRMED_CLASS, Track
from skills.quantities import Angle, Coordinate, Duration, Height, Length, Tries
from skills.relations import Landmark, Relation, Scene, Standing, choose
from skills.robot import FloatArray, Pose2D

_AVOIDED_M = 0.08
_DOUBTED = 0.1
"""Probability of the wanted classes up to which the robot says that an object is none of them."""
_EVEN = 0.5
_LEAST_LENGTH = 0.4
"""Fraction of the shortest object of a class: an object may be hidden in part."""
_MOST_LENGTH = 1.3
"""Fraction of the longest object of a class: two may be merged."""
_PART = 0.6
"""Length of a part of a larger object, at most, as a fraction of the object's."""
_ABOVE_M = 0.02
"""Height by which a part may seem to be taller than the object."""
_FREE_M = 0.15
"""Distance to the next object beyond which more does not count."""
_SEEN_AGAIN_M = 0.06
"""Distance from where an object was seen within which a segment without a label may be it."""
_SEEN_AGAIN_SCORE = 0.9
"""Least probability that it is."""
_SAME_SIZE_M = 0.015
"""Difference within which two sizes are alike; for larger objects, this fraction of the size."""
_SAME_SIZE_SHARE = 0.3


@dataclass(frozen=True)
class DetectInputs:
    """Wanted objects (any of `classes`, with all `attributes`) and the surfaces to search.

    The class "thing" matches any object, whether or not the detector knows its class. `avoid`: objects at these
    positions are the last choice. `count`: the search ends with so many objects; 0 searches all surfaces and counts all
    objects. `expected_W`: the search views only this position, and only objects within 0.35 m of it count. `floor`:
    visible objects on the floor beside the surfaces count too. With `relations`, only the objects that they mean count:
    the search views the whole surface and also looks for the landmarks. With a count of 1, exactly one must be meant.
    `likely`: where nothing is recognised, an object counts that is more likely of a wanted class than of any other.
    """

    classes: tuple[str, ...]
    surfaces: tuple[Surface, ...]
    attributes: tuple[str, ...] = ()
    expected_W: tuple[Coordinate, Coordinate, Height] | None = None
    count: Tries = 1
    floor: bool = False
    avoid: tuple[ObjectObservation, ...] = ()
    seen_before: ObjectObservation | None = None
    relations: tuple[Relation, ...] = ()
    likely: bool = False

    @property
    def landmarks(self) -> tuple[Landmark, ...]:
        """Landmarks of the relations that are objects."""
        return tuple(one for each in self.relations for one in each.landmarks if one.classes)

    @property
    def sought(self) -> tuple[str, ...]:
        """Classes of the wanted objects and of the landmarks."""
        return tuple(dict.fromkeys((*self.classes, *(name for each in self.landmarks for name in each.classes))))


@dataclass(frozen=True)
class DetectOptions:
    """Extent of the search.

    `confirm_shifts_rad` and `candidates`: candidates are viewed again from the side, at these angles about the
    shoulder; so many more of them than are wanted. `closer_looks`: how many views from near doubtful objects get.
    `around_rad`: angles from which hidden areas are viewed. `fresh_s`: largest age of the picture on which a result
    rests. `expected_within_m` and `floor_within_m`: largest distance of an object from the expected position, and on
    the floor from the robot.
    """

    confirm_shifts_rad: tuple[Angle, ...] = (0.25, -0.3)
    candidates: Tries = 3
    expected_within_m: Length = 0.35
    floor_within_m: Length = 2.2
    closer_looks: Tries = 3
    fresh_s: Duration = 1.5
    around_rad: tuple[Angle, ...] = (0.7, -0.7)


def matching_tracks(
    tracks: Sequence[Track], inputs: DetectInputs, options: DetectOptions, p_WB: FloatArray
) -> list[Track]:
    """Tracks with a wanted class, all attributes and a valid position, most likely first; p_WB is the robot.

    Where any object is wanted, the nearest and most accessible ones come first, and those to avoid last.
    """
    every = ANY_OBJECT in inputs.classes
    tracks = [t for t in tracks if (every or t.class_name in inputs.sought) and _in_place(t, inputs, options, p_WB)]
    fitting = [t for t in tracks if is_of_kind(t, inputs) or any(is_of_kind(t, one) for one in inputs.landmarks)]
    if inputs.expected_W is not None:
        off = {t.number: level_distance(t.position_W, inputs.expected_W) for t in fitting}
        near = (t for t in fitting if off[t.number] < options.expected_within_m)
        return sorted(near, key=lambda t: off[t.number])
    if ANY_OBJECT not in inputs.classes:
        return sorted(fitting, key=lambda t: -t.belief * t.best.detection.score)
    avoid = [each.position_W for each in inputs.avoid]
    return sorted(
        _most_free_first(fitting, p_WB), key=lambda t: any(level_distance(t.position_W, p) < _AVOIDED_M for p in avoid)
    )


def sure_tracks(matching: Sequence[Track], inputs: DetectInputs, views: int) -> list[Track]:
    """Tracks that need no further view, last seen first; in the given order when any object or a place is wanted."""
    sure = [track for track in matching if is_sure(track, inputs, views)]
    if inputs.expected_W is not None or ANY_OBJECT in inputs.classes:
        return sure
    return sorted(sure, key=lambda track: -track.last_seen_s)


def is_of_kind(track: Track, kind: DetectInputs | Landmark) -> bool:
    """Returns whether a track has one of the classes, and all attributes, of wanted objects or of a landmark."""
    is_class = ANY_OBJECT in kind.classes or track.class_name in kind.classes
    return is_class and all(has_attribute(track.best, word) for word in kind.attributes)


def meant_tracks(tracks: Sequence[Track], inputs: DetectInputs, robot: Pose2D) -> list[Track]:
    """Tracks that the relations mean among the reliable `tracks`, on each surface by itself."""
    meant = list[Track]()
    for surface in inputs.surfaces:
        here = [
            (track, Standing((float(track.position_W[0]), float(track.position_W[1])), track.latest.size_m))
            for track in tracks
            if track.latest.surface == surface.name
        ]
        wanted = [each for each in here if is_of_kind(each[0], inputs)]
        objects = {one: [at for track, at in here if is_of_kind(track, one)] for one in inputs.landmarks}
        scene, candidates = Scene(surface.polygon_W, surface.viewer or robot, objects), [at for _, at in wanted]
        meant += [wanted[k][0] for k in choose(inputs.relations, candidates, scene, every=inputs.count != 1)]
    return meant


def why_not_meant(tracks: Sequence[Track], inputs: DetectInputs) -> str | None:
    """Reason why the relations mean none of the reliable `tracks`; None when no object of the kind is among them."""
    wanted = [str(track.class_name) for track in tracks if is_of_kind(track, inputs)]
    if not wanted:
        return None
    relations = " and ".join(map(str, inputs.relations))
    missing = [str(each) for each in inputs.landmarks if not any(is_of_kind(track, each) for track in tracks)]
    seen = f"{listing(count_of(wanted.count(name), name) for name in dict.fromkeys(wanted))} seen"
    on = surface_names(inputs.surfaces)
    if missing:
        return f"{seen} on {on}, but not {listing(missing, last='or')}, so it cannot be told which is {relations}"
    return f"{seen} on {on}, but none {relations}"


def is_sure(track: Track, inputs: DetectInputs, views: int) -> bool:
    """Returns whether a track has enough views; its class does not matter when any object is wanted."""
    return track.exists(views) if ANY_OBJECT in inputs.classes else track.is_confirmed(views)


def _in_place(track: Track, inputs: DetectInputs, options: DetectOptions, p_WB: FloatArray) -> bool:
    if track.latest.surface in {surface.name for surface in inputs.surfaces}:
        return True
    near = level_distance(track.position_W, p_WB) < options.floor_within_m
    return inputs.floor and track.latest.surface == FLOOR and near


def _most_free_first(tracks: Sequence[Track], p_WB: FloatArray) -> list[Track]:
    """Sorts tracks in the order in which to grasp the objects: near ones with much space around them first."""

    def cost(track: Track) -> float:
        others = (level_distance(track.position_W, other.position_W) for other in tracks if other is not track)
        return level_distance(track.position_W, p_WB) - 2.0 * min(_FREE_M, min(others, default=_FREE_M))

    return sorted(tracks, key=cost)


def level_distance(p_W: Sequence[float] | FloatArray, q_W: Sequence[float] | FloatArray) -> float:
    """Horizontal distance between two points (m)."""
    return float(np.linalg.norm(np.asarray(p_W)[:2] - np.asarray(q_W)[:2]))


def doubtful_tracks(tracks: Sequence[Track], inputs: DetectInputs) -> list[Track]:
    """Tracks on the surfaces that may be what is sought although nothing recognises them, likeliest first.

    An object of another class, of another size than the wanted classes have, or without the attributes is in no doubt,
    nor is a part of a larger object that a picture shows by itself. One that may be a landmark is in doubt only where a
    wanted object may be, too.
    """
    names = {surface.name for surface in inputs.surfaces}
    here = [track for track in tracks if track.latest.surface in names and track.exists(1)]
    whole = [t for t in here if not any(_is_part(t, other) for other in here)]
    left = [t for t in whole if not (t.class_name not in inputs.sought and _is_recognised(t))]
    likely = {t.number: _likely(t, inputs) for t in left}
    if max(likely.values(), default=0.0) > _DOUBTED or any(is_of_kind(t, inputs) for t in here):
        landmarks = {t.number: max((_likely(t, one) for one in inputs.landmarks), default=0.0) for t in left}
        likely = {number: max(value, landmarks[number]) for number, value in likely.items()}
    return sorted((t for t in left if likely[t.number] > _DOUBTED), key=lambda t: -likely[t.number])


def _is_part(track: Track, other: Track) -> bool:
    """Returns whether a track without a class stands within a larger object that is as tall and was seen as late."""
    if track.class_name != ANY_OBJECT or max(track.latest.size_m) >= _PART * max(other.latest.size_m):
        return False
    x, y = (float(value) for value in track.position_W[:2] - other.position_W[:2])
    c, s = math.cos(other.latest.yaw_rad), math.sin(other.latest.yaw_rad)
    length_m, width_m, height_m = other.latest.size_m
    inside = abs(c * x + s * y) < 0.5 * length_m and abs(c * y - s * x) < 0.5 * width_m
    return inside and track.latest.size_m[2] < height_m + _ABOVE_M and other.last_seen_s >= track.last_seen_s


def _is_recognised(track: Track) -> bool:
    """Returns whether a track is likely of its class, and one view was sure of it."""
    return track.evidence.is_sure(track.class_name) and track.class_belief >= CONFIRMED_CLASS


def _likely(track: Track, kind: DetectInputs | Landmark) -> float:
    """Probability that a track is of the wanted kind if no class is left out; 0 for another size or attribute.

    An object without a label whose shape no model knows may be of any class of its size.
    """
    fits = [name for name in kind.classes if _has_size_of(track, name)]
    if not fits or not all(has_attribute(track.best, word) for word in kind.attributes if word not in MEANS_BIG):
        return 0.0
    if track.class_name == ANY_OBJECT and not track.evidence.shape_views:
        return _EVEN
    return sum(track.evidence.possible.get(name, 0.0) for name in fits)


def _has_size_of(track: Track, name: str) -> bool:
    """Returns whether a track, which may be hidden in part or merged with another, has the size of a class."""
    low_m, high_m = class_form(name).length_m
    return _LEAST_LENGTH * low_m < max(track.latest.size_m) < _MOST_LENGTH * high_m


def seen_again(before: ObjectObservation, segments: Sequence[Detection3D]) -> tuple[Detection3D, ...]:
    """Labels the segment with the size and position of a previously observed object with its class.

    The search has found it from several sides; a close picture may lack the features by which the network
    recognises it.
    """
    off = {id(each): level_distance(each.position_W, before.position_W) for each in segments}
    alike = [each for each in segments if off[id(each)] < _SEEN_AGAIN_M and _is_as_large(each.size_m, before.size_m)]
    nearest = min(alike, key=lambda each: off[id(each)], default=None)
    name, score = before.kind.name, max(before.score, _SEEN_AGAIN_SCORE)
    return tuple(
        replace(each, detection=replace(each.detection, class_name=name, score=score)) if each is nearest else each
        for each in segments
    )


def _is_as_large(size_m: Sequence[float], other_m: Sequence[float]) -> bool:
    """Returns whether length and height are similar; width and height seen from one side may be smaller."""
    pairs = ((size_m[0], other_m[0]), (size_m[2], other_m[2]))
    return all(abs(a - b) < max(_SAME_SIZE_M, _SAME_SIZE_SHARE * max(a, b)) for a, b in pairs)
