"""The place skill: find a free spot on a surface, lower the object until it stands, let go, check that it is there."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from skills.api import Cause, PlanningError, Succeeded, Surface
from skills.approach.standing import COMFORTABLE_M, free_places
from skills.arm.arm_skill import GRIPPER_FORCE_N, ArmSkill
from skills.arm.collision import ArmScene
from skills.arm.poses import look_configuration, overview_viewpoints
from skills.arm.routine import Routine, SkillFailure
from skills.detect.viewpoints import cluster_boxes, surface_boxes
from skills.geometry import wrap
from skills.grasp.candidates import hand_rotation
from skills.navigate.skill import Navigate, NavigateInputs
from skills.perception.surface_segmentation import SurfaceView, view_surface
from skills.place.free_spot import free_spots, spots
from skills.quantities import Length
from skills.robot import FloatArray, GripperCapabilities, Pose2D
from skills.stack import ArmPlanner

ABOVE_M = 0.22
_SURELY_FREE_M = 0.135
_LOWEST_M = 0.02
_RELAX_M = 0.003
_FEEL_S = 0.4
_OVER_SPOT_M = 0.45
_TIPS_BEYOND_M = 0.03
"""The fingertips reach so far below the middle of what is held from above."""


@dataclass(frozen=True)
class PlaceInputs:
    """The surface to put the object on."""

    surface: Surface


@dataclass(frozen=True)
class PlaceOptions:
    """How an object is put down.

    It is lowered in steps of `step_m` until the arm lags by `contact_m`. It must be seen again within `seen_again_m`.
    """

    step_m: Length = 0.008
    contact_m: Length = 0.005
    seen_again_m: Length = 0.12


class Place(ArmSkill[PlaceInputs]):
    """Puts the held object down on a surface and stows the arm. Goes nearer when no free spot is in reach."""

    name = "place"
    Inputs = PlaceInputs
    Options: ClassVar[type] = PlaceOptions
    options: PlaceOptions
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "nothing is held",
        Cause.PLANNING: "no free spot is seen within reach, or the arm finds no path to it",
        Cause.EXECUTION: "the robot or its arm did not reach its goal",
        Cause.POSTCONDITION: "the object is not seen where it was put down, or is still in the gripper",
    }
    default_timeout_s = 150.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"joints": 0.5, "gripper": 0.5}
    changes_world = True
    gripper_before = True
    gripper_after = False

    def undone(self, inputs: PlaceInputs) -> str | None:
        """Judged by the gripper."""
        return "the object is still in the gripper" if self.context.robot.gripper().holding else None

    def run(self, inputs: PlaceInputs) -> Routine[Succeeded]:
        """Go near, look, put down, look again."""
        surface = inputs.surface
        if not self.context.robot.gripper().holding:
            raise SkillFailure(Cause.PRECONDITION, "there is nothing in the gripper to put down")
        carried = self._carried()
        yield from self._go_near(surface)
        view = yield from self._look(surface, _nearest_spot(surface, self.X_WB()))
        q_above_rad = yield from self._go_above(surface, view, carried)
        spot_W = self._below_hand_W()
        self.checkpoint = {**self.checkpoint, "spot_W": spot_W.tolist()}
        yield from self._lower(surface, q_above_rad)
        yield from self._let_go()
        yield from self._check(surface, spot_W)
        yield from self.stow()
        return Succeeded(f"put the object down on the {surface.name}")

    def run_again(self, inputs: PlaceInputs) -> Routine[Succeeded]:
        """With an empty gripper: draw the hand back, and look whether the object stands where it was to be put."""
        surface = inputs.surface
        yield from self.pause(_FEEL_S, "feeling what the gripper holds")
        spot = self.checkpoint.get("spot_W")
        spot_W = None if spot is None else np.array([*spot, surface.height_m])
        over_spot = spot_W is not None and self.hand_near(spot_W, _OVER_SPOT_M)
        if self.context.robot.gripper().holding:
            if over_spot:
                yield from self.try_shift_hand(np.array([0.0, 0.0, _SURELY_FREE_M]), "lifting the object again")
            return (yield from self.run(inputs))
        if spot_W is None:
            raise SkillFailure(Cause.PRECONDITION, "there is nothing in the gripper, and it was not yet over its place")
        if over_spot:
            yield from self._let_go()
        yield from self._check(surface, spot_W[:2])
        yield from self.stow()
        return Succeeded(f"the object stood on the {surface.name} already")

    def _carried(self) -> RotationMatrix:
        """How the hand was turned as the object was brought, which an attempt that was broken off has noted."""
        noted = self.checkpoint.get("carried")
        rotation = self.model.X_BH(self.q_rad()).rotation() if noted is None else RotationMatrix(np.array(noted))
        self.checkpoint = {**self.checkpoint, "carried": rotation.matrix().tolist()}
        return rotation

    def _go_near(self, surface: Surface) -> Routine[None]:
        """Drive nearer when the surface is out of the arm's reach."""
        spot = _nearest_spot(surface, self.X_WB())
        pose = self.context.pose()
        offset = np.array([spot[0] - pose.x_m, spot[1] - pose.y_m])
        bearing = wrap(math.atan2(offset[1], offset[0]) - pose.yaw_rad)
        if np.linalg.norm(offset) < COMFORTABLE_M[1] and abs(bearing) < 0.6:
            return
        context = self.context
        places = free_places((spot[0], spot[1]), pose, context.costmap, context.robot.capabilities())
        if not places:
            raise SkillFailure(Cause.PLANNING, f"there is no free place to stand at the {surface.name}")
        yield from self.perform(Navigate(context), NavigateInputs(places[0].pose, 0.08, 0.1, 0.5))

    def _look(self, surface: Surface, spot_W: FloatArray) -> Routine[SurfaceView]:
        """A picture of the surface; the object in the gripper hides its lower half, so the camera looks low."""
        message = f"looking for a free spot on the {surface.name}"
        X_WB = self.X_WB()
        self.boxes = surface_boxes([surface], X_WB)
        X_HC = self.hand_camera.X_FC
        p_BT = X_WB.inverse() @ np.array([spot_W[0], spot_W[1], surface.height_m])
        low_BT = self.model.p_BS + (p_BT - self.model.p_BS) * [0.8, 0.8, 1.0]

        def goal(scene: ArmScene, q: FloatArray) -> FloatArray:
            return look_configuration(scene, X_HC, overview_viewpoints(self.model, low_BT), low_BT, q)

        yield from self.move_to(goal, message, speed_rad_s=0.9)
        yield from self.clear_view(message)
        image = yield from self.picture(message)
        X_WO = self.context.localiser.estimate().X_WO
        view = yield from self.compute(
            lambda: view_surface(image, X_WO, surface), latency_s=0.15, name="segment", message=message
        )
        if view is None:
            raise SkillFailure(Cause.PLANNING, f"the {surface.name} is not seen from here")
        return view

    def _go_above(self, surface: Surface, view: SurfaceView, carried: RotationMatrix) -> Routine[FloatArray]:
        """Bring the object above the best free spot; gives the joint angles that the arm is to have there."""
        X_WB = self.X_WB()
        free = free_spots(view, spots(surface))
        if len(free) == 0:
            raise SkillFailure(Cause.PLANNING, f"no free spot is seen on the {surface.name}")
        X_BW = X_WB.inverse()
        tops = [X_BW @ np.array([x, y, view.plane.height_m + ABOVE_M]) for x, y in _by_distance(free, X_WB)]
        self.boxes = [*surface_boxes([surface], X_WB), *cluster_boxes(view.clusters, X_WB)]
        goal = above_goal(tops, carried, self.gripper, self.context.stack.arm_planner)
        return (yield from self.move_to(goal, f"bringing the object over the {surface.name}", speed_rad_s=0.8))

    def _lower(self, surface: Surface, q_above_rad: FloatArray) -> Routine[None]:
        """Go down in small steps until the arm is held up, by contact, or the height is that of the surface.

        The path down begins at the angles for which it was found to be possible, and not at those of the arm: they
        differ a little, and near a singular posture that may make the difference between a path and none.
        After contact the arm no longer presses, or it would dip onto the surface as the gripper lets go.
        """
        message = f"putting the object down on the {surface.name}"
        p_BH = self.model.X_BH(q_above_rad).translation() - [0.0, 0.0, ABOVE_M - _SURELY_FREE_M]
        yield from self.move_straight(p_BH, message, q_from_rad=q_above_rad)
        q_wanted = self.q_rad()
        X_BH = self.model.X_BH(q_wanted)
        rest_m = float(X_BH.translation()[2]) - self._hand_z()
        lowest_m = surface.height_m + _LOWEST_M - float(self.X_WB().translation()[2])
        planner = self.context.stack.arm_planner
        while self._below_hand_m() > lowest_m:
            X_BH = RigidTransform(X_BH.rotation(), X_BH.translation() - [0.0, 0.0, self.options.step_m])
            try:
                path = planner.line(self.model, q_wanted, X_BH)
            except PlanningError as error:
                raise SkillFailure(Cause.PLANNING, str(error)) from error
            q_wanted = path[-1]
            yield from self.follow(planner.timed(path, speed_rad_s=0.3), message)
            if self._hand_z() - float(X_BH.translation()[2]) + rest_m > self.options.contact_m:
                yield from self.try_shift_hand(np.array([0.0, 0.0, _RELAX_M]), message)
                return

    def _let_go(self) -> Routine[None]:
        """Open, and draw the hand back along its fingers."""
        yield from self.move_gripper(0.75 * self.open_rad, GRIPPER_FORCE_N, "letting go")
        yield from self.pause(0.3, "letting go")
        fingers = self.model.X_BH(self.q_rad()).rotation().matrix()[:, 0]
        if not (yield from self.try_shift_hand(-0.16 * fingers, "drawing the hand back")):
            yield from self.shift_hand(-0.08 * fingers, "drawing the hand back")

    def _check(self, surface: Surface, spot_W: FloatArray) -> Routine[None]:
        """Raise SkillFailure with cause POSTCONDITION unless something stands where the object was put."""
        if self.context.robot.gripper().holding:
            raise SkillFailure(Cause.POSTCONDITION, "the object is still in the gripper")
        self.boxes = surface_boxes([surface], self.X_WB())
        view = yield from self._look(surface, spot_W)
        off = [float(np.min(np.linalg.norm(c.points.p_W[:, :2] - spot_W, axis=1))) for c in view.clusters]
        if not off or min(off) > self.options.seen_again_m:
            yield from self.try_stow()
            raise SkillFailure(
                Cause.POSTCONDITION, f"the object is not seen on the {surface.name} where it was put down"
            )

    def _hand_z(self) -> float:
        return float(self.model.X_BH(self.q_rad()).translation()[2])

    def _below_hand_m(self) -> float:
        """Height in B of the object's middle as it is held."""
        return float((self.model.X_BH(self.q_rad()) @ self.p_HT)[2])

    def _below_hand_W(self) -> FloatArray:
        p_BT = self.model.X_BH(self.q_rad()) @ self.p_HT
        return np.asarray((self.X_WB() @ p_BT)[:2])


def above_goal(
    tops_B: list[FloatArray], carried: RotationMatrix, gripper: GripperCapabilities, planner: ArmPlanner
) -> Callable[[ArmScene, FloatArray], FloatArray]:
    """A goal with the object above the first of some points that the arm can reach, tilted as fits how it is held.

    An object taken from the side (fingers closing level) keeps its tilt; one taken from above hangs below the hand.
    """
    side = abs(carried.matrix()[2, 2]) < 0.5
    ahead_m = gripper.grip_x_m if side else gripper.tip_x_m - _TIPS_BEYOND_M

    def goal(scene: ArmScene, q: FloatArray) -> FloatArray:
        """Arm angles above the first spot that can be reached and gone down to. Raises PlanningError."""
        for p_BT in tops_B:
            azimuth = math.atan2(p_BT[1] - scene.model.p_BS[1], p_BT[0] - scene.model.p_BS[0])
            for rotation in _side(carried, azimuth) if side else _from_above(azimuth):
                offset = rotation.matrix() @ np.array([ahead_m, 0.0, 0.0])
                for q_above in scene.model.inverse(RigidTransform(rotation, p_BT - offset), margin_rad=0.05):
                    if scene.free(q_above) and _can_lower(scene, q_above, planner):
                        return q_above
        raise PlanningError("no free spot is within the arm's reach")

    return goal


def _can_lower(scene: ArmScene, q_rad: FloatArray, planner: ArmPlanner) -> bool:
    X_BH = scene.model.X_BH(q_rad)
    lowered = RigidTransform(X_BH.rotation(), X_BH.translation() - [0.0, 0.0, ABOVE_M - 0.03])
    try:
        planner.line(scene.model, q_rad, lowered)
    except PlanningError:
        return False
    return True


def _side(carried: RotationMatrix, azimuth: float) -> list[RotationMatrix]:
    """The tilt as carried, turned about the vertical towards the spot and a little aside."""
    x_axis = carried.matrix()[:, 0]
    ahead = azimuth - math.atan2(x_axis[1], x_axis[0])
    return [RotationMatrix.MakeZRotation(ahead + turn) @ carried for turn in (0.0, 0.4, -0.4)]


def _from_above(azimuth: float) -> list[RotationMatrix]:
    """Fingers down, or as far down as may be; the gripper closes level."""
    tilts = np.radians([90.0, 75.0, 60.0, 45.0])
    return [hand_rotation(tilt, azimuth, side) for tilt in tilts for side in (1.0, -1.0)]


def _nearest_spot(surface: Surface, X_WB: RigidTransform) -> FloatArray:
    """The spot on the surface nearest to the robot."""
    return np.asarray(_by_distance(spots(surface), X_WB)[0])


def _by_distance(points_W: FloatArray, X_WB: RigidTransform) -> FloatArray:
    here = Pose2D.from_transform(X_WB)
    ahead = np.array([here.x_m + 0.2 * math.cos(here.yaw_rad), here.y_m + 0.2 * math.sin(here.yaw_rad)])
    return points_W[np.argsort(np.linalg.norm(points_W - ahead, axis=1))]
