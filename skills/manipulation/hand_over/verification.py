"""Check that a person has the released object, by the gripper and the camera."""

import enum
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from skills.api import Cause, InputsT, Surface
from skills.manipulation.arm.collision import Box
from skills.manipulation.arm.poses import close_viewpoints, overview_viewpoints, towards_shoulder
from skills.manipulation.arm.releasing_skill import ReleasingSkill
from skills.perception.detection_3d import Detection3D, detections_3d
from skills.perception.detector.camera_images import DETECTION_LATENCY_S, detect_in_image
from skills.perception.point_cloud import cloud_from_image
from skills.perception.surface_segmentation import segment_surface
from skills.robot import FloatArray, Image
from skills.routine import Routine, SkillFailure
from skills.small.back_off import BackOff, BackOffInputs
from skills.world_model import PERSON

LOOKS = 3
"""Number of views of an empty place by a head camera."""
SETTLES_WITHIN_S = 20.0
"""Time after the release within which a borne object must come to rest."""
_TALL_M = 0.05
"""Least height of an object for recognition by its height."""
_UPPER_PART = 0.5
"""Part of a tall object's height above which its points count."""
_ABOVE_TOP_M = 0.06
"""Height over a tall object's top up to which its points count."""
_BESIDE_M = 0.12
"""Level distance from the release point within which points belong to the object."""
_LEAST_POINTS = 12
_TAKEN_WITHIN_M = 0.35
"""Level distance from the release point within which a detected object is the released one."""
_LOWER_M = 0.35
"""Distance below the release point within which somebody bears the object."""
_FALLEN_M = 0.3
"""Height over the floor below which an object has fallen."""
_FELL_WITHIN_M = 1.0
"""Level distance from the release point within which a fallen object is looked for."""
_PLATE_M = 0.2
"""Half side of the square around the object for the search of a plate below it."""
_PLATE_OFF_M, _LEVEL_M = 0.04, 0.01
"""Uncertainty of the height of such a plate, and the precision of the search."""
_MOVES_ABOUT_M = 0.25
"""Radius around the object in which motion is looked for."""
_SAME_PLACE_M = 0.015
"""Distance between detections of an object at rest, while somebody moves beside it."""
_SAME_PLACES = 4
"""Number of detections in a row at the same place of an object at rest."""
_LATER_S = 0.17
"""Growth of the interval between them, because a rolling object may be back after equal intervals."""
_BACK_OFF_M = 0.3
_FLOOR_AHEAD_M = 1.2
"""Least distance ahead of the shoulder at which the hand camera views the floor."""
_BORNE_M = 0.42
"""Width of the hands or the tray that bear the object."""
_DEEP_M = 0.12
"""Height of the hands or the tray below the object's lowest point."""
_OVER_M = 0.005
"""Height of the hands or the tray over the object's lowest point."""
_OWN_M = 0.14
"""Width of the object's own space; it includes turns of the object."""
_OVER_TOP_M = 0.03
"""Height of the object's own space over its highest point."""
_FLOOR_FROM_M = 0.07
"""Distance ahead of the body from which on the floor is an obstacle for the arm."""
_FLOOR_SIZE_M = (1.2, 2.4, 0.1)
_FROM_M = (0.45, 0.4, 0.5)
"""Distances of the hand camera's viewpoints from the object, the best first."""
_BELOW_RAD = tuple(np.radians([35.0, 45.0, 25.0, 55.0]))
"""Angles below level at which the hand camera views the object, the best first."""
_ASIDE_RAD = (0.0, 0.5, -0.5)
"""Angles about the object at which the hand camera views it, the best first."""
_HIGHEST_CAMERA_M = 1.4
"""Height of the hand camera below a person's face."""


class Seen(enum.Enum):
    """Result of checking a released object."""

    GIVEN = "given"  # the object is at the release point or a little lower: a person holds it
    FELL = "fell"  # it lies near the floor
    NOT_SEEN = "not seen"  # neither
    MOVES = "moves"  # somebody bears it, and it does not come to rest
    IN_GRIPPER = "in the gripper"  # the closing gripper feels it


@dataclass(frozen=True)
class Sight:
    """Result of checking one picture, and the point (3,) in the world (m) where the object was looked for or found.

    `detected` is True when the detector found the object there.
    """

    seen: Seen
    p_W: FloatArray
    detected: bool = False


@dataclass(frozen=True)
class Release:
    """Release of an object: its horizontal centre in the world, and the heights of its lowest and highest point (m)."""

    x_m: float
    y_m: float
    low_m: float
    top_m: float

    @property
    def p_W(self) -> FloatArray:
        """Centre (3,) of the object."""
        return np.array([self.x_m, self.y_m, 0.5 * (self.low_m + self.top_m)])


def release_of(X_WH: RigidTransform, p_HT: FloatArray, corners_H: FloatArray | None) -> Release:
    """Returns the release of an object at p_HT (3,) in a hand; corners_H (8, 3) are the corners of its box."""
    points_W = X_WH.rotation().matrix() @ (p_HT[None, :] if corners_H is None else corners_H).T
    heights_m = points_W[2] + X_WH.translation()[2]
    x_m, y_m, _ = X_WH @ p_HT
    return Release(float(x_m), float(y_m), float(heights_m.min()), float(heights_m.max()))


def judge_release(
    image: Image, X_WO: RigidTransform, found: Iterable[Detection3D], names: Sequence[str], release: Release
) -> Sight:
    """Judges the release from a picture without the robot's arm, and from the objects detected in it.

    The object counts as given in three cases: a detection of its class lies near the release point, points there are as
    high as its upper half was, or an object lies there on a level plate. Without `names`, every class except people
    matches, and the plate may be lower.
    """
    own = [each for each in found if (each.class_name in names if names else each.class_name != PERSON)]
    own.sort(key=lambda each: _off_m(each, release))
    lowest_m = max(release.low_m - _LOWER_M, _FALLEN_M)
    for each in own:
        if _off_m(each, release) < _TAKEN_WITHIN_M and each.position_W[2] > lowest_m:
            return Sight(Seen.GIVEN, each.position_W, detected=True)
    if stands_at(image, X_WO, release) or lies_at(image, X_WO, release, release.low_m if names else lowest_m):
        return Sight(Seen.GIVEN, release.p_W)
    for each in own:
        if _off_m(each, release) < _FELL_WITHIN_M and each.position_W[2] <= _FALLEN_M:
            return Sight(Seen.FELL, each.position_W)
    return Sight(Seen.NOT_SEEN, release.p_W)


def stays_in_place(places_W: Sequence[FloatArray]) -> bool:
    """Returns whether the last detections (3,) of an object lie at the same place."""
    last_W = places_W[-_SAME_PLACES:]
    return len(last_W) == _SAME_PLACES and bool(np.all(np.ptp(last_W, axis=0) < _SAME_PLACE_M))


def _off_m(found: Detection3D, release: Release) -> float:
    return float(np.hypot(found.position_W[0] - release.x_m, found.position_W[1] - release.y_m))


def lies_at(image: Image, X_WO: RigidTransform, release: Release, lowest_m: float) -> bool:
    """Returns whether a picture shows an object on a level plate, at a height from lowest_m to that of the release."""
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    square = tuple((release.x_m + _PLATE_M * x, release.y_m + _PLATE_M * y) for x, y in corners)
    levels_m = np.arange(lowest_m - _PLATE_OFF_M, release.low_m + _PLATE_OFF_M, _LEVEL_M)
    p_W = cloud_from_image(image, X_WO, heights_m=(levels_m[0], levels_m[-1])).p_W
    over = np.abs(p_W[:, :2] - [release.x_m, release.y_m]).max(axis=1) < _PLATE_M
    counts, _ = np.histogram(p_W[over, 2], bins=levels_m)
    view = segment_surface(image, X_WO, Surface("plate", square, float(levels_m[np.argmax(counts)])))
    if view is None:
        return False
    middles = [np.median(cluster.points.p_W[:, :2], axis=0) for cluster in view.clusters]
    return any(np.hypot(x - release.x_m, y - release.y_m) < _BESIDE_M for x, y in middles)


def stands_at(image: Image, X_WO: RigidTransform, release: Release) -> bool:
    """Returns whether a picture's depth has points at the release as high as a tall object's upper half."""
    tall_m = release.top_m - release.low_m
    if tall_m < _TALL_M:
        return False
    heights_m = (release.low_m + _UPPER_PART * tall_m, release.top_m + _ABOVE_TOP_M)
    p_W = cloud_from_image(image, X_WO, heights_m=heights_m).p_W
    beside_m = np.hypot(p_W[:, 0] - release.x_m, p_W[:, 1] - release.y_m)
    return int(np.count_nonzero(beside_m < _BESIDE_M)) >= _LEAST_POINTS


def names_in(name: str, class_names: Iterable[str]) -> tuple[str, ...]:
    """Returns the classes that a text such as "red wrench" names."""
    words = name.split()
    return tuple(each for each in class_names if each in words)


class HandOverVerification(ReleasingSkill[InputsT]):
    """Routine that checks whether a person has the released object at rest, and stows the arm around hands or tray."""

    def verify(self, name: str, person: str, release: Release) -> Routine[Seen]:
        """Checks the release by the camera and by the closing gripper, and stows the arm.

        A hand camera looks before the arm is stowed; for a head camera the arm leaves the view first.
        """
        message = f"looking whether {person} has the {name}"
        seen = (yield from self._watched(name, release, message)) if self.object_camera.on_hand else None
        yield from self._stow_beside(release, message)
        if self.context.robot.gripper().holding:
            return Seen.IN_GRIPPER
        return seen or (yield from self._watched(name, release, message))

    def _watched(self, name: str, release: Release, message: str) -> Routine[Seen]:
        """Looks until the object is seen, and then until it is at rest."""
        for p_WT, viewpoints_B in self._looks(release):
            yield from self._turn_to(p_WT, viewpoints_B, name, message)
            end_s, seen, places_W = self.context.clock.now() + SETTLES_WITHIN_S, Seen.MOVES, list[FloatArray]()
            while seen is Seen.MOVES and self.context.clock.now() < end_s:
                seen = yield from self._seen(name, release, message, places_W)
            if seen is not Seen.NOT_SEEN:
                return seen
        return Seen.NOT_SEEN

    def _seen(self, name: str, release: Release, message: str, places_W: list[FloatArray]) -> Routine[Seen]:
        """Judges a picture from the present pose; two more pictures show whether a carried object is at rest.

        So do equal detections in a row, whose positions `places_W` has, while somebody moves beside the object.
        """
        try:
            yield from self.pause(_LATER_S * len(places_W), message)
            image = yield from self.picture(message)
            sight = yield from self._sight(image, name, release, message)
            if sight.seen is not Seen.GIVEN:
                return sight.seen
            at_rest = yield from self.stays_at_rest(image, sight.p_W, _MOVES_ABOUT_M, message)
        except SkillFailure as failure:
            raise _unseen(name, failure) from failure
        places_W[:] = [*places_W, sight.p_W] if sight.detected else []
        return Seen.GIVEN if at_rest or stays_in_place(places_W) else Seen.MOVES

    def _looks(self, release: Release) -> Sequence[tuple[FloatArray, Sequence[FloatArray]]]:
        """World points to look at, with viewpoints (B): the release, then the floor.

        The hand camera cannot look steeply enough to see the floor right in front of the body.
        """
        p_WT, p_WF = (np.array([release.x_m, release.y_m, level_m]) for level_m in (release.low_m, 0.0))
        if not self.object_camera.on_hand:
            return [*[(p_WT, ())] * LOOKS, (p_WF, ())]
        p_BT, p_BF = (self.X_WB().inverse() @ each for each in (p_WT, p_WF))
        ahead_B = -towards_shoulder(self.model.p_BS, p_BF)
        p_BF = p_BF + max(0.0, _FLOOR_AHEAD_M - float(np.linalg.norm((p_BF - self.model.p_BS)[:2]))) * ahead_B
        highest_m = _HIGHEST_CAMERA_M - self._height_m()
        around = [close_viewpoints(self.model.p_BS, p_BT, aside_rad, _BELOW_RAD, _FROM_M) for aside_rad in _ASIDE_RAD]
        near = [[p_BC for p_BC in viewpoints if p_BC[2] < highest_m] for viewpoints in around]
        first = [*near[0], *near[1], *near[2]]
        second = [*near[1], *near[2], *near[0]]
        return [(p_WT, first), (p_WT, second), (self.X_WB() @ p_BF, overview_viewpoints(self.model.p_BS, p_BF))]

    def _turn_to(self, p_WT: FloatArray, viewpoints_B: Sequence[FloatArray], name: str, message: str) -> Routine[None]:
        """Points the camera at a point in the world; a hand without a path looks from where it is."""
        try:
            yield from self.look_at(self.X_WB().inverse() @ p_WT, viewpoints_B, message)
        except SkillFailure as failure:
            if not self.object_camera.on_hand or failure.cause is not Cause.PLANNING:
                raise _unseen(name, failure) from failure

    def _sight(self, image: Image, name: str, release: Release, message: str) -> Routine[Sight]:
        """Judges one picture."""
        context = self.context
        place, names = context.localiser.estimate(), names_in(name, context.detector.class_names)

        def look() -> Sight:
            found = detections_3d(image, place, detect_in_image(context.detector, image), ())
            return judge_release(image, place.X_WO, found, names, release)

        return (yield from self.compute(look, latency_s=DETECTION_LATENCY_S, name="look who has it", message=message))

    def _stow_beside(self, release: Release, message: str) -> Routine[None]:
        """Stows the arm around the hands or the tray under the object.

        For a head camera the hand first comes near the body, because a long detour would swing it through unseen space.
        When there is no path the robot backs off a little and tries again.
        """
        around_person = self.boxes
        for backs_off in (False, True):
            try:
                if backs_off:
                    yield from self.perform(BackOff(self.context), BackOffInputs(_BACK_OFF_M))
                self.boxes = [*(() if backs_off else around_person), *self._borne(release)]
                if not self.object_camera.on_hand:
                    yield from self.carry(self.model.X_BH(self.q_rad()).rotation(), message, None)
                yield from self.stow(message)
                break
            except SkillFailure:
                continue
        else:
            self.boxes = around_person
            yield from self.try_stow()
        self.boxes = around_person

    def _borne(self, release: Release) -> list[Box]:
        """Boxes (B) that stand for the hands or the tray, the object in any rotation, and the floor."""
        X_BW, boxes = self.X_WB().inverse(), list[Box]()
        borne = (_BORNE_M, release.low_m - _DEEP_M, release.low_m + _OVER_M)
        for side_m, low_m, high_m in (borne, (_OWN_M, release.low_m, release.top_m + _OVER_TOP_M)):
            X_WG = RigidTransform([release.x_m, release.y_m, 0.5 * (low_m + high_m)])
            boxes.append(Box(X_BW @ X_WG, (side_m, side_m, high_m - low_m)))
        front_m = max(x for x, _ in self.context.robot.capabilities().footprint_m) + _FLOOR_FROM_M
        X_BG = RigidTransform([front_m + 0.5 * _FLOOR_SIZE_M[0], 0.0, -self._height_m() - 0.5 * _FLOOR_SIZE_M[2]])
        return [*boxes, Box(X_BG, _FLOOR_SIZE_M)]

    def _height_m(self) -> float:
        return float(self.context.robot.odometry().X_OB.translation()[2])


def _unseen(name: str, failure: SkillFailure) -> SkillFailure:
    return SkillFailure(Cause.POSTCONDITION, f"the {name} was released, but is not seen: {failure.message}")
