"""Spot's sensors."""

from __future__ import annotations

from collections.abc import Mapping

from pydrake.math import RigidTransform

from plant.kinds import SensorOptions
from plant.models.spot.description import CAMERAS, HAND_LINK, arm_joint_names, spot_facts
from plant.sensors.camera_spec import load_cameras
from plant.sensors.lidar import LidarSpec
from plant.sensors.suite import LidarMount, SensorSuite
from plant.spot.model import SpotModel
from skills.robot import FloatArray

_LIDAR_PERIOD_S = 0.1
_GRIPPER_MOVES_RAD_S = 0.05


class SpotSensors(SensorSuite):
    """All sensors of one Spot."""

    def __init__(self, model: SpotModel, options: SensorOptions) -> None:
        """`options.context` is the plant's."""
        self._joints = model.index()
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
        """The finger's angle, and the force at its tip from its motor's torque."""
        gripper = self._joints.gripper
        opening = -float(positions[gripper])
        if abs(float(rates[gripper])) > _GRIPPER_MOVES_RAD_S:
            return opening, 0.0
        return opening, max(0.0, float(efforts[gripper])) / float(spot_facts()["gripper"]["tip_radius"])

    def _X_BL(self) -> RigidTransform:
        return self._X_BL_mounted

    def _frames_of_links(self) -> Mapping[str, tuple[str, RigidTransform]]:
        (X_BH,) = self._X_BLinks(tuple(arm_joint_names()), (HAND_LINK,))
        return {HAND_LINK: ("hand", X_BH)}
