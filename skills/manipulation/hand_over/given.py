"""Whether somebody has what was held out to them: what a camera shows where it was let go of, and below."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from skills.api import Surface
from skills.perception.class_forms import PERSON
from skills.perception.detection_3d import Detection3D
from skills.perception.point_cloud import cloud_from_image
from skills.perception.surface_segmentation import segment_surface
from skills.robot import FloatArray, Image

_TALL_M, _UPPER_PART, _ABOVE_TOP_M = 0.05, 0.5, 0.06
_BESIDE_M, _LEAST_POINTS = 0.12, 12
_TAKEN_WITHIN_M, _LOWER_M, _FLOOR_M, _FELL_WITHIN_M = 0.35, 0.35, 0.3, 1.0
_PLATE_M = 0.2
"""Half the side of the square about the object in which what bears it is looked for."""


class Seen(enum.Enum):
    """What became of an object that was let go of."""

    GIVEN = "given"  # it is where it was let go of, or a little lower: somebody bears it
    FELL = "fell"  # it lies near the floor
    NOT_SEEN = "not seen"  # neither
    MOVES = "moves"  # somebody bears it, and it does not come to rest
    IN_GRIPPER = "in the gripper"  # the closing gripper feels it


@dataclass(frozen=True)
class Sight:
    """What a picture shows, and about which point (3,) of the world (m)."""

    seen: Seen
    p_W: FloatArray


@dataclass(frozen=True)
class Release:
    """Where an object is let go of, in the world (m): its middle, its lowest and its highest point."""

    x_m: float
    y_m: float
    low_m: float
    top_m: float

    @property
    def p_W(self) -> FloatArray:
        """The middle (3,)."""
        return np.array([self.x_m, self.y_m, 0.5 * (self.low_m + self.top_m)])

    def state(self) -> Mapping[str, float]:
        """The same as JSON values."""
        return asdict(self)


def release_of(X_WH: RigidTransform, p_HT: FloatArray, corners_H: FloatArray | None) -> Release:
    """Where a hand lets go of what it holds about p_HT (3,); corners_H (8, 3) are those of a box about it, if known."""
    points_W = X_WH.rotation().matrix() @ (p_HT[None, :] if corners_H is None else corners_H).T
    heights_m = points_W[2] + X_WH.translation()[2]
    x_m, y_m, _ = X_WH @ p_HT
    return Release(float(x_m), float(y_m), float(heights_m.min()), float(heights_m.max()))


def seen_given(
    image: Image, X_WO: RigidTransform, found: Iterable[Detection3D], names: Sequence[str], release: Release
) -> Sight:
    """What a picture without the robot's arm and the objects detected in it show of what was let go of.

    An object counts as given when one of its class is near where it was let go of, when something reaches as high
    there as the upper half of it did, or when something lies there on a level plate. Where `names` is empty, any class
    but that of people is its own.
    """
    own = [each for each in found if (each.class_name in names if names else each.class_name != PERSON)]
    own.sort(key=lambda each: _off_m(each, release))
    lowest_m = max(release.low_m - _LOWER_M, _FLOOR_M)
    for each in own:
        if _off_m(each, release) < _TAKEN_WITHIN_M and each.position_W[2] > lowest_m:
            return Sight(Seen.GIVEN, each.position_W)
    if stands_at(image, X_WO, release) or lies_at(image, X_WO, release):
        return Sight(Seen.GIVEN, release.p_W)
    for each in own:
        if _off_m(each, release) < _FELL_WITHIN_M and each.position_W[2] <= _FLOOR_M:
            return Sight(Seen.FELL, each.position_W)
    return Sight(Seen.NOT_SEEN, release.p_W)


def _off_m(found: Detection3D, release: Release) -> float:
    return float(np.hypot(found.position_W[0] - release.x_m, found.position_W[1] - release.y_m))


def lies_at(image: Image, X_WO: RigidTransform, release: Release) -> bool:
    """Whether a picture shows something on a level plate at about the height at which an object was let go of."""
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    square = tuple((release.x_m + _PLATE_M * x, release.y_m + _PLATE_M * y) for x, y in corners)
    view = segment_surface(image, X_WO, Surface("plate", square, release.low_m))
    if view is None:
        return False
    middles = [np.median(cluster.points.p_W[:, :2], axis=0) for cluster in view.clusters]
    return any(np.hypot(x - release.x_m, y - release.y_m) < _BESIDE_M for x, y in middles)


def stands_at(image: Image, X_WO: RigidTransform, release: Release) -> bool:
    """Whether a picture's depth shows something as high as the upper half of a tall object where it was let go of."""
    tall_m = release.top_m - release.low_m
    if tall_m < _TALL_M:
        return False
    heights_m = (release.low_m + _UPPER_PART * tall_m, release.top_m + _ABOVE_TOP_M)
    p_W = cloud_from_image(image, X_WO, heights_m=heights_m).p_W
    beside_m = np.hypot(p_W[:, 0] - release.x_m, p_W[:, 1] - release.y_m)
    return int(np.count_nonzero(beside_m < _BESIDE_M)) >= _LEAST_POINTS


def names_in(thing: str, class_names: Iterable[str]) -> tuple[str, ...]:
    """The classes that a text such as "red wrench" names."""
    words = thing.split()
    return tuple(name for name in class_names if name in words)


def release_from(state: Mapping[str, Any]) -> Release:
    """What `Release.state` gave."""
    return Release(**{name: float(value) for name, value in state.items()})
