"""Base of the skills that take pictures with the hand camera or the head camera."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skills.api import Cause, InputsT, PlanningError
from skills.manipulation.arm.arm_skill import ArmSkill, Goal
from skills.manipulation.arm.collision import ArmScene
from skills.manipulation.arm.gaze import head_angles, without_arm
from skills.manipulation.arm.poses import look_configuration
from skills.manipulation.arm.solid_cells import with_picture, with_view
from skills.patience import PATIENCE_S
from skills.perception.detector.camera_images import is_dark, lacks_depth
from skills.perception.visibility import APART_S, is_at_rest
from skills.robot import CameraCapabilities, FloatArray, Image, NoImageError
from skills.routine import Routine, SkillFailure

PICTURE_LATENCY_S = 0.1
SETTLE_S = 0.15
OLDEST_PICTURE_S = 0.5
_HEAD_EXPIRY_S, _HELD_RADIUS_M = 5.0, 0.2
_ASK_AGAIN_S = 0.3


class LookingSkill(ArmSkill[InputsT]):
    """A routine that looks at objects: it points the camera, takes pictures, and compares them."""

    @property
    def object_camera(self) -> CameraCapabilities:
        """The camera that looks for objects. Raises SkillFailure with cause PRECONDITION when there is none."""
        camera = self.context.robot.capabilities().object_camera
        if camera is None:
            raise SkillFailure(Cause.PRECONDITION, "the robot has no camera on its hand or head")
        return camera

    def look_at(
        self,
        p_BT: FloatArray,
        viewpoints_B: Sequence[FloatArray],
        message: str,
        speed_rad_s: float | None = None,
        raised_m: float | None = None,
    ) -> Routine[None]:
        """Points the camera that looks for objects at p_BT.

        One on the hand goes to the first possible of some viewpoints; one on the head turns there, from a body that is
        raised by so much where that is given, and the arm is out of its view. Raises SkillFailure.
        """
        camera, head = self.object_camera, self.context.robot.capabilities().head
        if camera.on_hand or head is None:

            def goal(scene: ArmScene, q: FloatArray) -> FloatArray:
                return look_configuration(scene, camera.X_FC, viewpoints_B, p_BT, q)

            yield from self.look_from(goal, message, speed_rad_s)
            return
        p_WT = self.X_WB() @ p_BT
        if not self.context.robot.gripper().holding:
            yield from self.stow(message)
        if raised_m is not None:
            yield from self.stand_at(self.context.robot.capabilities().standing_height_m + raised_m, message)
        try:
            pan_rad, tilt_rad = head_angles(head, camera, self.X_WB().inverse() @ p_WT)
        except PlanningError as error:
            raise SkillFailure(Cause.PLANNING, str(error)) from error
        context = self.context

        def attempt() -> Routine[None]:
            until_s = context.clock.now() + _HEAD_EXPIRY_S
            command = self.issue(context.robot.point_head(pan_rad, tilt_rad, until_s=until_s, lease=context.lease))
            yield from self.finish(command, message, "the head", until_s=until_s)

        yield from self.persist(attempt, message)

    def look_from(self, goal: Goal, message: str, speed_rad_s: float | None = None) -> Routine[None]:
        """Goes where `goal` says to take a picture; an empty gripper, which else stands before the camera, opens."""
        gripper = self.context.robot.gripper()
        opens = not gripper.holding and gripper.opening < 0.9 * self.widest
        yield from self.move_to(goal, message, speed_rad_s, opening=0.98 * self.widest if opens else None)

    def picture(self, message: str, settle_s: float = SETTLE_S) -> Routine[Image]:
        """A new picture of the camera that looks for objects, once it is still; one on the head leaves out the arm.

        A camera that gives none, an old one, a dark one, or one without depth is asked again for a while; in all, an
        attempt waits `PATIENCE_S` for light and depth, which may be missing for good. Raises SkillFailure with cause
        EXECUTION when the camera gives none, or an old one.
        """
        yield from self.pause(settle_s, message)
        robot, camera = self.context.robot, self.object_camera
        while True:
            begun_s = self.context.clock.now()
            image = yield from self._picture_now(camera, message)
            if self._doubted_s > PATIENCE_S or not (is_dark(image) or lacks_depth(image)):
                break
            yield from self.pause(_ASK_AGAIN_S, f"the {camera.mount.value} camera shows nothing; {message}")
            self._doubted_s += self.context.clock.now() - begun_s
        if not camera.on_hand:
            held_m = _HELD_RADIUS_M if robot.gripper().holding else None
            image = without_arm(image, self._arm_points_B(), held_m)
        solid, X_WO = self.context.solid, self.context.localiser.estimate().X_WO
        solid.cells, solid.views = (
            with_picture(solid.cells, image, X_WO, self._own()),
            with_view(solid.views, image, X_WO),
        )
        return image

    def _picture_now(self, camera: CameraCapabilities, message: str) -> Routine[Image]:
        """What a camera gives now. Raises SkillFailure with cause EXECUTION when it gives none, or an old one."""
        robot, clock, source, name = self.context.robot, self.context.clock, camera.source, camera.mount.value

        def taken() -> Image:
            asked_s, image = clock.now(), robot.image(source)
            if image.stamp_s < asked_s - OLDEST_PICTURE_S:
                age_s = asked_s - image.stamp_s
                raise NoImageError(f"the {name} camera gives only a picture that is {age_s:.1f} s old")
            return image

        return (yield from self.sense(taken, latency_s=PICTURE_LATENCY_S, name=f"{name} picture", message=message))

    def at_rest_since(self, image: Image, p_W: FloatArray, within_m: float, message: str) -> Routine[bool]:
        """Returns whether more depth pictures, each a moment after the one before, show the same as `image` about p_W.

        Their intervals differ: what rolls to and fro may be back at one time, and not at the next.
        """
        robot, source, before = self.context.robot, self.object_camera.source, image
        X_WO = self.context.localiser.estimate().X_WO
        for apart_s in APART_S:
            yield from self.pause(before.stamp_s + apart_s - self.context.clock.now(), message)
            later = yield from self.sense(
                lambda: robot.image(source, visual=False), latency_s=PICTURE_LATENCY_S, name="again", message=message
            )
            if not is_at_rest(before, later, X_WO, p_W, within_m):
                return False
            before = later
        return True

    def _arm_points_B(self) -> list[FloatArray]:
        """The arm as it is now, from the shoulder to the tip beyond the hand: points (3,) in B."""
        q_rad = self.q_rad()
        return [*self.model.points_B(q_rad), self.model.X_BH(q_rad) @ np.array([self.gripper.length_m, 0.0, 0.0])]
