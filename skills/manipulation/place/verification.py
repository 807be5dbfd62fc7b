"""Release of an object on a surface, and the check by gripper, arm and camera that it rests there."""

from collections.abc import Callable, Sequence

import numpy as np

from skills.api import Cause, InputsT, Surface
from skills.detect.viewpoints import surface_boxes
from skills.manipulation.arm.arm_skill import CARRY_SPEED_RAD_S
from skills.manipulation.arm.collision import Box
from skills.manipulation.arm.poses import close_viewpoints, overview_viewpoints
from skills.manipulation.arm.releasing_skill import ReleasingSkill
from skills.manipulation.place.free_spots import distances_m, objects_W
from skills.perception.detection_3d import Detection3D, at_points, detections_3d
from skills.perception.detector.camera_images import DETECTION_LATENCY_S, detect_in_image
from skills.perception.point_cloud import Mask
from skills.perception.surface_segmentation import SurfaceView, segment_surface
from skills.robot import FloatArray, Image
from skills.routine import PlanningAttempt, Routine, SkillFailure

_AT_HAND_M = 0.4
"""Depth below which a pixel shows the held object, or something too near to measure."""
_HIDDEN = 0.5
"""Least part of these pixels at which the held object hides the surface."""
_SETTLES_WITHIN_S = 5.0
_MOVES_ABOUT_M = 0.2
"""Radius around a spot of the search for a moving object."""
_NEW_M = 0.025
"""Distance from all earlier points on the surface beyond which a point belongs to the object."""
_LEAST_NEW = 10
"""Least number of these points for the object to be there."""
_ON_SURFACE_M = 0.15
"""Largest height over the surface of a detected object at rest on it."""
_NOT_SEEN = np.empty((0, 2))


class PlaceVerification(ReleasingSkill[InputsT]):
    """Routine that releases an object on a surface, and checks whether it rests there."""

    def let_go(self, held_kg: float | None) -> Routine[None]:
        """Opens the gripper and draws back without dragging the object; shakes off an object that sticks to the hand.

        Raises SkillFailure with cause POSTCONDITION when it still sticks, or the hand cannot leave it.
        """
        message = "letting go"
        free = (yield from self.open_hand(message)) or (yield from self.shake_off(message, turns_hand=False))
        p_BH = self.model.X_BH(self.q_rad()).translation()
        left = yield from self.leave_object()
        if free and (yield from self.hangs_on_hand(held_kg, message)):
            yield from self.try_shift_hand(p_BH - self.model.X_BH(self.q_rad()).translation(), message)
            free = yield from self.shake_off("shaking the object off the fingers", turns_hand=False)
            left = yield from self.leave_object()
            free = free and not (yield from self.hangs_on_hand(held_kg, message))
        if not free:
            raise SkillFailure(Cause.POSTCONDITION, "the object is still in the gripper")
        if not left:
            raise SkillFailure(Cause.POSTCONDITION, "the object is put down, but the hand cannot draw back from it")

    def check(
        self,
        surface: Surface,
        spot_W: FloatArray,
        put_down: Sequence[Box] = (),
        before_W: FloatArray = _NOT_SEEN,
        within_m: float = 0.12,
    ) -> Routine[None]:
        """Raises SkillFailure with cause POSTCONDITION unless an object rests within `within_m` of the spot (2,).

        `before_W` (N, 2) are points on the objects that stood there before. The arm avoids `put_down`, the object's box
        (B), on its path.
        """
        if self.context.robot.gripper().holding:
            raise SkillFailure(Cause.POSTCONDITION, "the object is still in the gripper")
        end_s = self.context.clock.now() + _SETTLES_WITHIN_S
        p_WO = np.array([*spot_W, surface.height_m])
        while True:
            image = yield from self._seen_again(surface, spot_W, put_down, before_W, within_m)
            if image is None:
                yield from self.try_stow()
                where = f"on the {surface.name} where it was put down"
                raise SkillFailure(Cause.POSTCONDITION, f"the object is not seen {where}")
            if (yield from self.stays_at_rest(image, p_WO, _MOVES_ABOUT_M, "looking whether it is at rest")):
                return
            if self.context.clock.now() > end_s:
                yield from self.try_stow()
                raise SkillFailure(Cause.POSTCONDITION, f"the object still moves on the {surface.name}")

    def _seen_again(
        self, surface: Surface, spot_W: FloatArray, put_down: Sequence[Box], before_W: FloatArray, within_m: float
    ) -> Routine[Image | None]:
        """Returns a picture that shows the object near its spot, by depth or class, from a near viewpoint if needed."""

        def new(points_W: FloatArray) -> Mask:
            near = np.linalg.norm(points_W - spot_W, axis=1) < within_m
            return np.asarray(near & (distances_m(before_W, points_W) > _NEW_M))

        for near in (False, True):
            with PlanningAttempt() as attempt:
                image, view = yield from self.seen_on(surface, spot_W, put_down, near=near)
            if attempt.failure is not None:
                continue
            if np.count_nonzero(new(objects_W(view))) >= _LEAST_NEW or (
                yield from self._is_detected(image, surface, new)
            ):
                return image
        return None

    def _is_detected(self, image: Image, surface: Surface, new: Callable[[FloatArray], Mask]) -> Routine[bool]:
        """Returns whether the detector finds a `new` object of the class, which depth may miss when it is flat."""
        kind = self.checkpoint.get("kind")
        if kind not in self.context.detector.class_names:
            return False
        found = yield from self.detected_on(image, surface, f"looking for the {kind} on the {surface.name}")
        own_W = np.array([one.position_W for one in found if one.class_name == kind]).reshape(-1, 3)
        return bool(np.any(new(own_W[:, :2]) & (np.abs(own_W[:, 2] - surface.height_m) < _ON_SURFACE_M)))

    def detected_on(
        self, image: Image, surface: Surface, message: str, standing_W: FloatArray | None = None
    ) -> Routine[list[Detection3D]]:
        """Returns the detections in 3D in a picture of a surface.

        The points `standing_W` (N, 3) on the surface give the position of a detection without depth.
        """
        place, detector = self.context.localiser.estimate(), self.context.detector

        def detected() -> list[Detection3D]:
            seen = detect_in_image(detector, image)
            found = list(detections_3d(image, place, seen, [surface]))
            if standing_W is not None:
                lacking = [one for one in seen if all(one is not each.detection for each in found)]
                found += filter(None, (at_points(one, image, place, standing_W, surface.name) for one in lacking))
            return found

        return (yield from self.compute(detected, latency_s=DETECTION_LATENCY_S, name="look again", message=message))

    def seen_on(
        self, surface: Surface, spot_W: FloatArray, beside: Sequence[Box] = (), *, near: bool = False
    ) -> Routine[tuple[Image, SurfaceView | None]]:
        """Takes a picture, from afar or near, and segments the surface; no view when the held object occludes it.

        The object occludes at least the picture's lower half, so from afar the camera looks low. Raises SkillFailure
        with cause PLANNING when the surface is out of view.
        """
        message = f"looking for a free spot on the {surface.name}"
        X_WB, p_BS = self.X_WB(), self.model.p_BS
        self.boxes = [*surface_boxes([surface], X_WB), *beside]
        p_BT = X_WB.inverse() @ np.array([spot_W[0], spot_W[1], surface.height_m])
        low_BT = p_BS + (p_BT - p_BS) * [0.8, 0.8, 1.0]
        viewpoints = close_viewpoints(p_BS, p_BT) if near else overview_viewpoints(self.model.p_BS, low_BT)
        yield from self.look_at(p_BT if near else low_BT, viewpoints, message, CARRY_SPEED_RAD_S)
        image = yield from self.picture(message)
        X_WO = self.context.localiser.estimate().X_WO
        view = yield from self.compute(
            lambda: segment_surface(image, X_WO, surface), latency_s=0.15, name="segment", message=message
        )
        if view is None and not self.is_hidden(image):
            raise SkillFailure(Cause.PLANNING, f"the {surface.name} is not seen from here")
        return image, view

    def is_hidden(self, image: Image) -> bool:
        """Returns whether the held object occludes a picture, so that the LiDAR must replace it."""
        robot = self.context.robot
        near = float(np.mean(image.depth_m < _AT_HAND_M))
        return near > _HIDDEN and robot.gripper().holding and robot.scan() is not None
