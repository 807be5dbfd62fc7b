"""Spot's sensors: snapshots taken from the plant's state, with noise from the seed."""

from __future__ import annotations

from pydrake.systems.framework import Context

from plant.spot.model import SpotModel
from skills.robot import Battery, Gripper, Image, Imu, Joints, Odometry, Scan


class SpotSensors:
    def __init__(self, model: SpotModel, context: Context) -> None:
        self._model, self._context = model, context
        self._index = model.index()
        self.update(0.0)

    def update(self, now_s: float) -> None:
        plant = self._model.plant
        self._now = now_s
        X = plant.EvalBodyPoseInWorld(self._context, self._model.body)
        self._odometry = Odometry(now_s, X, (0.0, 0.0, 0.0))

    def odometry(self) -> Odometry:
        return self._odometry

    def imu(self) -> Imu:
        raise NotImplementedError

    def scan(self) -> Scan | None:
        return None

    def image(self, source: str) -> Image:
        raise NotImplementedError

    def joints(self) -> Joints:
        p = self._model.plant.GetPositions(self._context)[self._index.positions]
        v = self._model.plant.GetVelocities(self._context)[self._index.velocities]
        return Joints(self._now, dict(zip(self._index.names, p)), dict(zip(self._index.names, v)), {})

    def gripper(self, holding: bool) -> Gripper:
        return Gripper(self._now, -self.joints().position_rad["arm_f1x"], 0.0, holding)

    def battery(self) -> Battery:
        return Battery(self._now, 1.0)
