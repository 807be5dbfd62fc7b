"""An inertial measurement unit in the body: rates and specific force with bias and noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from plant.sensors.noisy import NoisySensor
from skills.robot import FloatArray, Imu

GRAVITY_W = np.array([0.0, 0.0, -9.81])


@dataclass(frozen=True)
class ImuNoise:
    """Standard deviations of the constant biases and of the white noise of each axis."""

    gyro_bias_rad_s: float = 0.002
    gyro_rad_s: float = 0.003
    accelerometer_bias_m_s2: float = 0.03
    accelerometer_m_s2: float = 0.05


class ImuModel(NoisySensor):
    """The IMU of one robot; acceleration comes from the change of velocity between two updates."""

    kept = ("last",)

    def __init__(self, rng: np.random.Generator, noise: ImuNoise | None = None) -> None:
        """Draw this run's biases."""
        super().__init__(rng)
        self._noise = noise or ImuNoise()
        self._gyro_bias = rng.normal(0.0, self._noise.gyro_bias_rad_s, 3)
        self._force_bias = rng.normal(0.0, self._noise.accelerometer_bias_m_s2, 3)
        self._last: list[Any] | None = None

    def update(self, stamp_s: float, X_WB: RigidTransform, w_WB_W: FloatArray, v_WB_W: FloatArray) -> Imu:
        """Reading at stamp_s from the true pose, angular velocity (rad/s) and velocity (m/s) of the body in W."""
        acceleration_W = self._acceleration(stamp_s, np.asarray(v_WB_W, dtype=np.float64))
        R_BW = X_WB.rotation().matrix().T
        rates = R_BW @ w_WB_W + self._gyro_bias + self._rng.normal(0.0, self._noise.gyro_rad_s, 3)
        force = R_BW @ (acceleration_W - GRAVITY_W) + self._force_bias
        force = force + self._rng.normal(0.0, self._noise.accelerometer_m_s2, 3)
        return Imu(
            stamp_s,
            (float(rates[0]), float(rates[1]), float(rates[2])),
            (float(force[0]), float(force[1]), float(force[2])),
        )

    def _acceleration(self, stamp_s: float, v_WB_W: FloatArray) -> FloatArray:
        """Mean acceleration since the last update, zero at the first."""
        last, self._last = self._last, [stamp_s, v_WB_W.tolist()]
        if last is None or stamp_s <= last[0]:
            return np.zeros(3)
        return np.asarray((v_WB_W - last[1]) / (stamp_s - last[0]))
