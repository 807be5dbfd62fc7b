"""Fetch's sensors: odometry from its wheels, a planar LiDAR on its base, one camera on its head."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from plant.fetch.model import FetchModel
from plant.fetch.wheels import Axle, WheelOdometer
from plant.kinds import SensorOptions
from plant.models.fetch.description import (
    HAND_LINK,
    HEAD_CAMERA,
    HEAD_JOINTS,
    HEAD_LINK,
    LIFT_JOINT,
    arm_joint_names,
    fetch_facts,
    head_camera,
)
from plant.sensors.lidar import LidarSpec
from plant.sensors.proprioception import GripperNoise
from plant.sensors.suite import LidarMount, SensorSuite
from skills.robot import FloatArray

_GRIPPER_MOVES_M_S = 0.004
_GRIPPER_NOISE = GripperNoise(opening=0.0003, closed=0.004)
_LIDAR_SIGMA_M = 0.015


def axle() -> Axle:
    """Fetch's driven wheels."""
    wheel = fetch_facts()["wheel"]
    return Axle(wheel["radius"], wheel["offset"][1])


class FetchSensors(SensorSuite, keeps=("_odometer",)):
    """All sensors of one Fetch."""

    def __init__(self, model: FetchModel, options: SensorOptions) -> None:
        """`options.context` is the plant's."""
        self._joints = model.index()
        facts = fetch_facts()
        self._p_BaseL = np.array(facts["lidar"]["xyz"])
        self._odometer = WheelOdometer(axle(), self._wheels_rad(model, options))
        self._context = options.context
        super().__init__(
            model,
            self._joints,
            options,
            lidar=LidarMount(model.base, RigidTransform(self._p_BaseL), lidar_spec(), 1.0 / facts["lidar"]["rate"]),
            cameras={HEAD_CAMERA: head_camera()},
            runtime_s=facts["capabilities"]["runtime"],
            gripper_noise=_GRIPPER_NOISE,
        )

    def _wheels_rad(self, model: FetchModel, options: SensorOptions) -> FloatArray:
        positions = model.plant.GetPositions(options.context)
        return np.asarray(positions[self._joints.positions[self._joints.wheels]], dtype=np.float64)

    def count_wheels(self, wheels_rad: FloatArray) -> None:
        """Takes in where the wheels (2,) are: encoders count faster than readings are asked for."""
        self._odometer.count(wheels_rad)

    def _reckoned(self, X_WB: RigidTransform) -> RigidTransform:
        """The pose that the encoders count, at the height of the lift, tilted as the body really is."""
        plant = self._body.plant
        positions = np.asarray(plant.GetPositions(self._context)[self._joints.positions])
        self._odometer.count(positions[self._joints.wheels])
        pose, rpy = self._odometer.pose, RollPitchYaw(X_WB.rotation())
        height_m = fetch_facts()["lift"]["height"] + float(positions[self._joints.lift])
        tilted = RollPitchYaw(rpy.roll_angle(), rpy.pitch_angle(), pose.yaw_rad)
        return RigidTransform(tilted, np.array([pose.x_m, pose.y_m, height_m]))

    def _gripper_feels(self, positions: FloatArray, rates: FloatArray, efforts: FloatArray) -> tuple[float, float]:
        """How far the fingers are apart, and the force of each on what is between them."""
        fingers = self._joints.fingers
        opening = float(positions[fingers].sum())
        if float(np.abs(rates[fingers]).max()) > _GRIPPER_MOVES_M_S:
            return opening, 0.0
        return opening, max(0.0, -float(efforts[fingers].mean()))

    def _X_BL(self) -> RigidTransform:
        """The LiDAR stays with the base when the lift moves the body frame."""
        height_m = fetch_facts()["lift"]["height"] + self.joints.position_rad[LIFT_JOINT]
        return RigidTransform(self._p_BaseL - [0.0, 0.0, height_m])

    def _frames_of_links(self) -> Mapping[str, tuple[str, RigidTransform]]:
        X_BH, X_BHead = self._X_BLinks((*arm_joint_names(), *HEAD_JOINTS), (HAND_LINK, HEAD_LINK))
        return {HAND_LINK: ("hand", X_BH), HEAD_LINK: ("head", X_BHead)}


def lidar_spec() -> LidarSpec:
    """One ring ahead and to the sides."""
    lidar = fetch_facts()["lidar"]
    return LidarSpec(
        rings=1,
        half_fov_rad=0.0,
        azimuth_step_rad=math.tau / lidar["points_per_turn"],
        min_range_m=lidar["range"][0],
        max_range_m=lidar["range"][1],
        sigma_m=_LIDAR_SIGMA_M,
        columns=lidar["points"],
    )
