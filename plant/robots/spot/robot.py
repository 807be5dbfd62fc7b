"""The simulated Spot behind the Robot protocol, and its sensors."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform

from plant.robots.commanded_robot import CommandedRobot
from plant.robots.robot_kind import SensorOptions
from plant.robots.sensor_suite import LidarMount, SensorSuite
from plant.robots.servos import GripperTolerances, Part, Velocity, gripper_set_point
from plant.robots.spot.description import CAMERAS, spot_facts
from plant.robots.spot.legs import BodyMotion, LegServos, Trot, nominal_footholds
from plant.robots.spot.model import JointIndex, SpotModel
from plant.sensors.camera_spec import load_cameras
from plant.sensors.lidar import LidarSpec
from skills.robot import CommandCause, CommandId, CommandState, FloatArray, Lease

_LIDAR_PERIOD_S = 0.1
_GRIPPER_MOVES_RAD_S = 0.05


class SpotSensors(SensorSuite):
    """Sensors of one Spot."""

    def __init__(self, model: SpotModel, joints: JointIndex, options: SensorOptions) -> None:
        """Mounts the sensors on `model`."""
        self._joints = joints
        self._X_BL_mounted = RigidTransform(spot_facts()["lidar"]["xyz"])
        super().__init__(
            model,
            self._joints,
            options,
            lidar=LidarMount(model.body, self._X_BL_mounted, LidarSpec(), _LIDAR_PERIOD_S),
            cameras=load_cameras(CAMERAS),
            runtime_s=spot_facts()["capabilities"]["runtime"],
        )

    def _gripper_feels(self, positions: FloatArray, rates: FloatArray, efforts: FloatArray) -> tuple[float, float]:
        """Angle of the finger, and the force at its tip estimated from its motor's torque."""
        gripper = self._joints.gripper
        opening = -float(positions[gripper])
        if abs(float(rates[gripper])) > _GRIPPER_MOVES_RAD_S:
            return opening, 0.0
        return opening, max(0.0, float(efforts[gripper])) / float(spot_facts()["gripper"]["tip_radius"])

    def _X_BL(self) -> RigidTransform:
        return self._X_BL_mounted


_GRIPPER_TOLERANCES = GripperTolerances(arrived=0.03, stall_rate=0.03)


class SpotRobot(CommandedRobot, saved=("_posture", "_falls", "_leg_servos", "_trot", "_floating_base")):
    """One Spot: converts the commands of the lease holder to set points of the plant's servos."""

    _index: JointIndex

    def __init__(self, model: SpotModel, options: SensorOptions) -> None:
        """Takes control of the robot in the state of `options.context`, at time 0."""
        joints = JointIndex(model.plant, model.instance)
        super().__init__(model, joints, SpotSensors(model, joints, options), options.context, _GRIPPER_TOLERANCES)
        self._body, self._floating_base = model.body, model.floating_base
        self._posture, self._falls = (float(spot_facts()["capabilities"]["standing_height"]), 0.0), False
        self._leg_servos = LegServos(self._index, self._joints()[self._index.legs])
        self._trot = Trot(nominal_footholds())
        self._trot.reset(self._motion(self._base()))
        self._tip_radius_m = float(spot_facts()["gripper"]["tip_radius"])

    # -- act ------------------------------------------------------------------------------------------------------

    def stand(self, height_m: float, pitch_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Holds the body origin at a height above the floor and a pitch."""
        low, high = self._capabilities.height_range_m
        least, most = self._capabilities.pitch_range_rad
        if not (low <= height_m <= high and least <= pitch_rad <= most):
            return self._commands.refuse(
                f"stand: height {height_m:.2f} m must lie in [{low}, {high}] "
                f"and pitch {pitch_rad:.2f} rad in [{least}, {most}]"
            )
        self._falls = False
        return self._begin(Part.POSTURE, (height_m, pitch_rad), until_s, lease)

    def sit(self, *, until_s: float, lease: Lease) -> CommandId:
        """Lowers the body to the floor; driving stops."""
        command = self._begin(Part.POSTURE, (spot_facts()["capabilities"]["sitting_height"], 0.0), until_s, lease)
        if self._runs(command):
            self._falls = False
            self._commands.finish(Part.VELOCITY, CommandState.STOPPED, "the robot sits down", CommandCause.STOPPED)
        return command

    def fall(self, *, until_s: float, lease: Lease) -> CommandId:
        """Falls to the floor, as without power in the legs; driving stops."""
        command = self.sit(until_s=until_s, lease=lease)
        self._falls = self._runs(command)
        return command

    # -- inside ---------------------------------------------------------------------------------------------------

    def _drive_refusal(self, velocity: Velocity) -> str | None:
        sits = self._posture[0] < spot_facts()["capabilities"]["height_range"][0] - 0.02
        return "drive: the robot sits; stand up first" if sits else None

    def _fingers_at(self, joints: FloatArray, rates: FloatArray) -> tuple[float, float]:
        return -float(joints[self._index.gripper]), abs(float(rates[self._index.gripper]))

    def _desired(self, joints: FloatArray, rates: FloatArray, dt_s: float) -> FloatArray:
        index, base, goal = self._index, self._base(), self._gripper.goal
        self._follow_posture(base)
        desired = np.concatenate([joints, np.zeros(len(joints))])
        lead_rad = goal.force_n * self._tip_radius_m / index.gripper_gain
        desired[index.gripper] = gripper_set_point(-goal.opening, float(joints[index.gripper]), lead_rad)
        self._drive_body(base, dt_s)
        desired[index.legs], desired[index.rates_of(index.legs)] = self._legs(base, dt_s)
        return desired

    def _hold_still(self, part: Part) -> None:
        super()._hold_still(part)
        if part is Part.POSTURE and self._floating_base is not None:
            self._posture = self._floating_base.posture

    def _follow_posture(self, base: Sequence[float]) -> None:
        posture = self._goal(Part.POSTURE, tuple)
        if posture is None:
            return
        self._posture = posture
        height, pitch = base[3:]
        if abs(height - self._posture[0]) < 0.01 and abs(pitch - self._posture[1]) < 0.02:
            self._commands.finish(Part.POSTURE, CommandState.DONE)

    def _drive_body(self, base: Sequence[float], dt_s: float) -> None:
        if self._floating_base is None:
            return
        wanted = self._goal(Part.VELOCITY, Velocity)
        self._floating_base.control(
            self._context, base, wanted or Velocity(), self._posture, dt_s, stopping=wanted is None, falls=self._falls
        )

    def _legs(self, base: Sequence[float], dt_s: float) -> tuple[FloatArray, FloatArray]:
        if self._floating_base is None:
            return self._leg_servos.rest_rad, np.zeros_like(self._leg_servos.rest_rad)
        motion = self._motion(base)
        feet_W = self._trot.step(motion, dt_s)
        X_WB = self._plant.EvalBodyPoseInWorld(self._context, self._body).GetAsMatrix34()
        return self._leg_servos.set_points(_feet_ahead(feet_W, motion, X_WB, dt_s), dt_s)

    def _motion(self, base: Sequence[float]) -> BodyMotion:
        velocity = Velocity() if self._floating_base is None else self._floating_base.velocity
        return BodyMotion(base[0], base[1], base[2], velocity.vx, velocity.vy, velocity.wz)

    def _base(self) -> Sequence[float]:
        """Pose (x, y, yaw, height, pitch) of the floating base."""
        floating_base = self._floating_base
        return (0.0,) * 5 if floating_base is None else floating_base.pose(self._plant.GetPositions(self._context))


def _feet_ahead(
    feet_W: Sequence[Sequence[float]], motion: BodyMotion, X_WB: FloatArray, dt_s: float
) -> list[tuple[float, float, float]]:
    """Positions of the feet in the body frame after dt_s, when the body moves on from X_WB (3, 4) at the same tilt."""
    x, y, yaw = motion.ahead(dt_s)
    c, s = math.cos(yaw - motion.yaw_rad), math.sin(yaw - motion.yaw_rad)
    (xx, xy, xz, x0), (yx, yy, yz, y0), (zx, zy, zz, z0) = X_WB.tolist()
    feet_B = []
    for foot_x, foot_y, foot_z in feet_W:
        ahead_x, ahead_y = foot_x - x, foot_y - y
        dx = c * ahead_x + s * ahead_y + motion.x_m - x0
        dy = c * ahead_y - s * ahead_x + motion.y_m - y0
        dz = foot_z - z0
        feet_B.append((xx * dx + yx * dy + zx * dz, xy * dx + yy * dy + zy * dz, xz * dx + yz * dy + zz * dz))
    return feet_B
