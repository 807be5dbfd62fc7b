"""Base of the skills that take pictures with the camera on the hand, the head or the body."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
from pydrake.math import RigidTransform

from skills.api import Cause, InputsT, PlanningError
from skills.estimate.scan_points import segment_distance
from skills.manipulation.arm.arm_skill import ArmSkill, Goal
from skills.manipulation.arm.collision import ArmScene
from skills.manipulation.arm.kinematics import arm_model
from skills.manipulation.arm.poses import look_configuration
from skills.manipulation.arm.solid_cells import add_picture, add_view
from skills.perception.detector.camera_images import fresh_image, is_dark, lacks_depth
from skills.perception.point_cloud import APART_S, is_at_rest
from skills.robot import CameraCapabilities, Capabilities, FloatArray, HeadCapabilities, Image, Mount
from skills.routine import PATIENCE_S, Routine, SkillFailure

PICTURE_LATENCY_S = 0.1
SETTLE_S = 0.15
"""Pause before a picture, in which the camera comes to rest."""
_HEAD_EXPIRY_S = 5.0
_ASK_AGAIN_S = 0.3
"""Pause after a dark picture or one without depth."""
_OPEN_WIDE = 0.98
"""Opening of a gripper that clears the view, as a fraction of the maximum opening."""
_OPEN_ENOUGH = 0.9
"""Fraction of the maximum opening from which on the gripper occludes nothing."""
_HEAD_TURNS = 6
"""Steps of the iteration for the head's angles."""
_OFF_AXIS_RAD = 0.2
"""Largest angle between the optical axis and the point to look at."""
_IN_VIEW_RAD = 0.5
"""The same for a camera that is fixed to the body."""
_NO_HEAD = HeadCapabilities(("", ""), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
"""Stands for a head that does not move."""
_NEAREST_M = 0.25
"""Least distance from the head's camera to the point to look at."""
_ARM_WITHIN_M = 1.6
"""Distance from the camera beyond which no part of the arm is."""
_ARM_RADIUS_M = 0.1
_HELD_RADIUS_M = 0.2


class LookingSkill(ArmSkill[InputsT]):
    """Routine that points the object camera, takes pictures and compares them."""

    @classmethod
    def reached_heights_m(cls, capabilities: Capabilities) -> tuple[float, float]:
        """Heights above the floor of the lowest and the highest surface that the arm reaches.

        They depend on the arm's length, the range of body heights, and the nearest standing distance.
        """
        try:
            model, arm = arm_model(capabilities), capabilities.arm
        except ValueError:
            return super().reached_heights_m(capabilities)
        assert arm is not None
        x_m, _, z_m = model.p_BS
        ahead_m = max(0.0, min(*arm.standing_m, *arm.nearer_m) - float(x_m))
        upright_m = math.sqrt(max(0.0, arm.max_reach_m**2 - ahead_m**2))
        low_m, high_m = capabilities.height_range_m
        return low_m + float(z_m) - upright_m, high_m + float(z_m) + upright_m

    @property
    def object_camera(self) -> CameraCapabilities:
        """The camera that searches for objects. Raises SkillFailure with cause PRECONDITION when there is none."""
        camera = self.context.robot.capabilities().object_camera
        if camera is None:
            raise SkillFailure(Cause.PRECONDITION, "the robot has no camera on hand or head, or ahead on its body")
        return camera

    @property
    def p_BS(self) -> FloatArray:
        """Point (3,) about which viewpoints turn: the shoulder, or the camera of a robot without an arm."""
        can, camera = self.context.robot.capabilities(), self.object_camera
        if can.arm is not None:
            return self.model.p_BS
        X_BF = can.head.X_BF(0.0, 0.0) if can.head is not None and camera.mount is Mount.HEAD else RigidTransform()
        return np.asarray((X_BF @ camera.X_FC).translation())

    def look_at(
        self,
        p_BT: FloatArray,
        viewpoints_B: Sequence[FloatArray],
        message: str,
        speed_rad_s: float | None = None,
        raised_m: float | None = None,
    ) -> Routine[None]:
        """Points the object camera at p_BT. Raises SkillFailure when that is not possible.

        A hand camera moves to the first free viewpoint within reach. For another camera the arm leaves the view, and
        the body rises by up to `raised_m`; a camera on the body must have p_BT in view.
        """
        camera, can = self.object_camera, self.context.robot.capabilities()
        head = can.head if camera.mount is Mount.HEAD else None
        if camera.on_hand:

            def goal(scene: ArmScene, q: FloatArray) -> FloatArray:
                return look_configuration(scene, camera.X_FC, viewpoints_B, p_BT, q)

            yield from self.look_from(goal, message, speed_rad_s)
            return
        p_WT = self.X_WB() @ p_BT
        if not self.context.robot.gripper().holding:
            yield from self.stow(message)
        if raised_m is not None:
            low_m, high_m = can.height_range_m
            yield from self.stand_at(min(max(can.standing_height_m + raised_m, low_m), high_m), message)
        try:
            pan_rad, tilt_rad = head_angles(head or _NO_HEAD, camera, self.X_WB().inverse() @ p_WT)
        except PlanningError as error:
            raise SkillFailure(Cause.PLANNING, str(error)) from error
        if head is None:
            return
        context = self.context

        def attempt() -> Routine[None]:
            until_s = context.clock.now() + _HEAD_EXPIRY_S
            command = self.issue(context.robot.point_head(pan_rad, tilt_rad, until_s=until_s, lease=context.lease))
            yield from self.finish(command, message, "the head", until_s=until_s)

        yield from self.persist(attempt, message)

    def look_from(self, goal: Goal, message: str, speed_rad_s: float | None = None) -> Routine[None]:
        """Moves the hand camera to the configuration of `goal`; opens an empty gripper that would occlude the view."""
        reading, gripper = self.context.robot.gripper(), self.context.robot.capabilities().gripper
        opens = gripper is not None and not reading.holding and reading.opening < _OPEN_ENOUGH * gripper.widest
        opening = _OPEN_WIDE * gripper.widest if gripper is not None and opens else None
        yield from self.move_to(goal, message, speed_rad_s, opening=opening)

    def picture(self, message: str, settle_s: float = SETTLE_S, *, near: bool = False) -> Routine[Image]:
        """Takes a picture with the object camera at rest; a head camera's picture has no depth on the robot's own arm.

        Tries again for a while when the picture is missing, old, dark or without depth; one attempt of a skill waits
        `PATIENCE_S` in total for light and depth. With `near`, when the camera may be too close for depth, it tries
        once. Raises SkillFailure with cause EXECUTION when the camera returns no picture or an old one.
        """
        yield from self.pause(settle_s, message)
        robot, camera = self.context.robot, self.object_camera
        while True:
            begun_s = self.context.clock.now()
            image = yield from self._picture_now(camera, message)
            if near or self._doubted_s > PATIENCE_S or not (is_dark(image) or lacks_depth(image)):
                break
            yield from self.pause(_ASK_AGAIN_S, f"the {camera.mount.value} camera shows nothing; {message}")
            self._doubted_s += self.context.clock.now() - begun_s
        if not camera.on_hand and robot.capabilities().arm is not None:
            held_radius_m = _HELD_RADIUS_M if robot.gripper().holding else None
            image = mask_arm(image, self.arm_points_B(self.q_rad()), held_radius_m)
        solid, X_WO = self.context.solid, self.context.localiser.estimate().X_WO
        solid.cells = add_picture(solid.cells, image, X_WO, self._outline())
        solid.views = add_view(solid.views, image, X_WO)
        return image

    def _picture_now(self, camera: CameraCapabilities, message: str) -> Routine[Image]:
        """Takes one picture. Raises SkillFailure with cause EXECUTION when there is none, or only an old one."""
        robot, clock, name = self.context.robot, self.context.clock, camera.mount.value
        taken = partial(fresh_image, robot, clock, camera.source, name)
        return (yield from self.sense(taken, latency_s=PICTURE_LATENCY_S, name=f"{name} picture", message=message))

    def stays_at_rest(self, image: Image, p_W: FloatArray, within_m: float, message: str) -> Routine[bool]:
        """Returns whether later depth images match `image` within a distance of p_W.

        The intervals between them differ, because a rolling object may be back after one interval but not after two.
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


def head_angles(head: HeadCapabilities, camera: CameraCapabilities, p_BT: FloatArray) -> tuple[float, float]:
    """Returns pan and tilt (rad) that point the head's camera at p_BT (3,); the error may be larger near the limits.

    Raises PlanningError when the head cannot turn far enough, or the point is too near the head.
    """
    pan_rad = math.atan2(p_BT[1] - head.p_BP_m[1], p_BT[0] - head.p_BP_m[0])
    tilt_rad = 0.0
    for _ in range(_HEAD_TURNS):
        pan_rad, tilt_rad = float(np.clip(pan_rad, *head.pan_range_rad)), float(np.clip(tilt_rad, *head.tilt_range_rad))
        x, y, z = (head.X_BF(pan_rad, tilt_rad) @ camera.X_FC).inverse() @ p_BT
        off_rad = math.atan2(math.hypot(x, y), z)
        pan_rad, tilt_rad = pan_rad - math.atan2(x, max(z, _NEAREST_M)), tilt_rad + math.atan2(y, max(z, _NEAREST_M))
    most_rad = _OFF_AXIS_RAD if camera.mount is Mount.HEAD else _IN_VIEW_RAD
    if off_rad > most_rad or math.hypot(x, y, z) < _NEAREST_M:
        blind = "the head does not turn far enough to see it" if camera.mount is Mount.HEAD else ""
        raise PlanningError(blind or f"it is outside of the view of the {camera.source} camera")
    return float(np.clip(pan_rad, *head.pan_range_rad)), float(np.clip(tilt_rad, *head.tilt_range_rad))


def mask_arm(image: Image, arm_B: FloatArray, held_radius_m: float | None = None) -> Image:
    """Removes the depth on the robot's own arm, a line through points (N, 3) in the body frame.

    `held_radius_m` is the radius around the last segment of the line, where an object is held.
    """
    lens, depth = image.depth_intrinsics, image.depth_m
    v, u = np.nonzero((depth > 0.0) & (depth < _ARM_WITHIN_M))
    z = depth[v, u].astype(np.float64)
    points_C = np.column_stack([(u - lens.cx) / lens.fx * z, (v - lens.cy) / lens.fy * z, z])
    X_BC = image.frames.pose(image.camera_frame, "body")
    points_B = points_C @ X_BC.rotation().matrix().T + X_BC.translation()
    segments = list(pairwise(arm_B))
    radii_m = [_ARM_RADIUS_M] * (len(segments) - 1) + [held_radius_m or _ARM_RADIUS_M]
    own = np.zeros(len(points_B), dtype=bool)
    for (start, end), radius_m in zip(segments, radii_m, strict=True):
        own |= segment_distance(points_B, start, end) < radius_m
    masked = depth.copy()
    masked[v[own], u[own]] = 0.0
    return replace(image, depth_m=masked)
