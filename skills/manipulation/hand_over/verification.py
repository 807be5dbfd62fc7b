"""How the hand-over skill knows that the person has the object: by the gripper, the arm's load and the camera."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from skills.api import Cause, InputsT
from skills.back_off.ports import BackOffInputs
from skills.back_off.skill import BackOff
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.looking_skill import LookingSkill
from skills.manipulation.arm.poses import UP_B, carry_configuration, overview_viewpoints, towards_shoulder
from skills.manipulation.hand_over.given import Release, Seen, Sight, names_in, seen_given
from skills.perception.detection_3d import detections_3d
from skills.perception.detector.camera_images import DETECTION_LATENCY_S, detect_in_image
from skills.robot import ArmCapabilities, FloatArray, Image
from skills.routine import Routine, SkillFailure

LOOKS = 3
SETTLES_WITHIN_S = 8.0
"""What still moves so long after it was let go of does not come to rest."""
_MOVES_ABOUT_M, _BACK_OFF_M, _FLOOR_AHEAD_M = 0.25, 0.3, 1.2
_BORNE_M, _DEEP_M, _OVER_M = 0.42, 0.12, 0.005
"""How far hands or a tray that bear what was let go of may reach: wide, below its lowest point and over that (m)."""
_FLOOR_FROM_M, _FLOOR_M = 0.07, (1.2, 2.4, 0.1)
"""The floor, for an arm that goes round: from how far before the body on, and how large (m)."""
_OWN_M, _OVER_TOP_M = 0.14, 0.03
"""The object's own space, as it may have turned: wide, and over its highest point (m)."""
_FROM_M, _BELOW_RAD, _ASIDE_RAD = (0.45, 0.4, 0.5), np.radians([35.0, 45.0, 25.0, 55.0]), (0.0, 0.5, -0.5)
_HIGHEST_CAMERA_M = 1.4
"""A hand camera that looks at what a person bears stays lower than their face."""
_STILL_HELD, _LEAST_KG = 0.5, 0.06


class HandOverVerification(LookingSkill[InputsT]):
    """Looks whether a person has what was let go of, at rest, and stows the arm around what bears it."""

    def hangs_on_hand(self, held_kg: float | None, message: str) -> Routine[bool]:
        """Whether the arm still bears most of the weight that it bore; False where that was too little to tell."""
        if held_kg is None or held_kg < _LEAST_KG:
            return False
        return (yield from self.weigh(self.p_HT, message)) > _STILL_HELD * held_kg

    def verify(self, thing: str, person: str, release: Release) -> Routine[Seen]:
        """What became of the object, by the camera and by the gripper, which closes meanwhile; the arm is stowed then.

        A camera on the hand looks before the arm is stowed; for one on the head the arm goes out of its view first.
        """
        message = f"looking whether {person} has the {thing}"
        if self.object_camera.on_hand:
            seen = yield from self._watched(thing, release, message)
            yield from self._stow_beside(release, message)
            return Seen.IN_GRIPPER if self.context.robot.gripper().holding else seen
        yield from self._stow_beside(release, message)
        if self.context.robot.gripper().holding:
            return Seen.IN_GRIPPER
        return (yield from self._watched(thing, release, message))

    def _watched(self, thing: str, release: Release, message: str) -> Routine[Seen]:
        """What is seen of the object: the first look that shows it counts, and it is watched until it is at rest."""
        for p_WT, viewpoints_B in self._looks(release):
            yield from self._turn_to(p_WT, viewpoints_B, thing, message)
            end_s, seen = self.context.clock.now() + SETTLES_WITHIN_S, Seen.MOVES
            while seen is Seen.MOVES and self.context.clock.now() < end_s:
                seen = yield from self._seen(thing, release, message)
            if seen is not Seen.NOT_SEEN:
                return seen
        return Seen.NOT_SEEN

    def _seen(self, thing: str, release: Release, message: str) -> Routine[Seen]:
        """What pictures taken from here show; of an object that somebody bears, two more tell whether it is at rest."""
        try:
            image = yield from self.picture(message)
            sight = yield from self._sight(image, thing, release, message)
            if sight.seen is not Seen.GIVEN:
                return sight.seen
            at_rest = yield from self.at_rest_since(image, sight.p_W, _MOVES_ABOUT_M, message)
        except SkillFailure as failure:
            raise _unseen(thing, failure) from failure
        return Seen.GIVEN if at_rest else Seen.MOVES

    def _looks(self, release: Release) -> Sequence[tuple[FloatArray, Sequence[FloatArray]]]:
        """Which point of the world to look at, and from where (B): where it was let go of, then the floor.

        A hand camera does not look as steeply down as to the floor right before the body.
        """
        p_WT, p_WF = (np.array([release.x_m, release.y_m, level_m]) for level_m in (release.low_m, 0.0))
        if not self.object_camera.on_hand:
            return [*[(p_WT, ())] * LOOKS, (p_WF, ())]
        p_BT, p_BF = (self.X_WB().inverse() @ each for each in (p_WT, p_WF))
        ahead_B = -towards_shoulder(self.model.p_BS, p_BF)
        p_BF = p_BF + max(0.0, _FLOOR_AHEAD_M - float(np.linalg.norm((p_BF - self.model.p_BS)[:2]))) * ahead_B
        highest_m = _HIGHEST_CAMERA_M - self._height_m()
        near = [self._viewpoints(p_BT, aside_rad, highest_m) for aside_rad in _ASIDE_RAD]
        first = [*near[0], *near[1], *near[2]]
        second = [*near[1], *near[2], *near[0]]
        return [(p_WT, first), (p_WT, second), (self.X_WB() @ p_BF, overview_viewpoints(self.model, p_BF))]

    def _viewpoints(self, p_BT: FloatArray, aside_rad: float, highest_m: float) -> list[FloatArray]:
        """Camera places (B) on the shoulder's side of a point, looking down at it; none above a height in B (m)."""
        home_B = towards_shoulder(self.model.p_BS, p_BT)
        heading_rad = math.atan2(home_B[1], home_B[0]) + aside_rad
        level_B = np.array([math.cos(heading_rad), math.sin(heading_rad), 0.0])
        places = (
            p_BT + distance_m * (math.cos(below_rad) * level_B + math.sin(below_rad) * UP_B)
            for below_rad, distance_m in itertools.product(_BELOW_RAD, _FROM_M)
        )
        return [place for place in places if place[2] < highest_m]

    def _turn_to(self, p_WT: FloatArray, viewpoints_B: Sequence[FloatArray], thing: str, message: str) -> Routine[None]:
        """Points the camera at a point of the world; a hand that finds no way there looks from where it is."""
        try:
            yield from self.look_at(self.X_WB().inverse() @ p_WT, viewpoints_B, message)
        except SkillFailure as failure:
            if not self.object_camera.on_hand or failure.cause is not Cause.PLANNING:
                raise _unseen(thing, failure) from failure

    def _sight(self, image: Image, thing: str, release: Release, message: str) -> Routine[Sight]:
        """What a picture shows of the object."""
        context = self.context
        place, names = context.localiser.estimate(), names_in(thing, context.detector.class_names)

        def look() -> Sight:
            found = detections_3d(image, place, detect_in_image(context.detector, image), ())
            return seen_given(image, place.X_WO, found, names, release)

        return (yield from self.compute(look, latency_s=DETECTION_LATENCY_S, name="look who has it", message=message))

    def _stow_beside(self, release: Release, message: str) -> Routine[None]:
        """Stows the arm around the hands, or the tray, that bear the object now.

        A hand that comes straight from there first comes near the body: a long way round would swing it through what
        no camera has seen. Where there is no way, the robot backs off a little first; then any way will do.
        """
        around_person, arm = self.boxes, self.arm
        for backs_off in (False, True):
            try:
                if backs_off:
                    yield from self.perform(BackOff(self.context), BackOffInputs(_BACK_OFF_M))
                self.boxes = [*(() if backs_off else around_person), *self._borne(release)]
                R_BH = self.model.X_BH(self.q_rad()).rotation()
                if not self.object_camera.on_hand:
                    yield from self.move_to(partial(_carried, arm, R_BH), message)
                yield from self.stow(message)
                break
            except SkillFailure:
                continue
        else:
            self.boxes = around_person
            yield from self.try_stow()
        self.boxes = around_person

    def _borne(self, release: Release) -> list[Box]:
        """What bears the object, the object as it may have turned, and the floor, as boxes in the body frame."""
        X_BW, boxes = self.X_WB().inverse(), list[Box]()
        borne = (_BORNE_M, release.low_m - _DEEP_M, release.low_m + _OVER_M)
        for side_m, low_m, high_m in (borne, (_OWN_M, release.low_m, release.top_m + _OVER_TOP_M)):
            X_WG = RigidTransform([release.x_m, release.y_m, 0.5 * (low_m + high_m)])
            boxes.append(Box(X_BW @ X_WG, (side_m, side_m, high_m - low_m)))
        front_m = max(x for x, _ in self.context.robot.capabilities().footprint_m) + _FLOOR_FROM_M
        X_BG = RigidTransform([front_m + 0.5 * _FLOOR_M[0], 0.0, -self._height_m() - 0.5 * _FLOOR_M[2]])
        return [*boxes, Box(X_BG, _FLOOR_M)]

    def _height_m(self) -> float:
        return float(self.context.robot.odometry().X_OB.translation()[2])


def _carried(arm: ArmCapabilities, R_BH: RotationMatrix, scene: ArmScene, q_rad: FloatArray) -> FloatArray:
    return carry_configuration(scene, arm, R_BH, q_rad)


def _unseen(thing: str, failure: SkillFailure) -> SkillFailure:
    return SkillFailure(Cause.POSTCONDITION, f"the {thing} is let go of, but not seen: {failure.message}")
