"""Dead reckoning as a walking robot does it: right in the short run, drifting with the way gone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from plant.sensors.noisy import NoisySensor
from plant.snapshot.values import State
from skills.robot import FloatArray, Odometry, Pose2D


@dataclass(frozen=True)
class OdometryNoise:
    """Standard deviations.

    `scale` is the relative error of distance, `turn_scale` that of angles turned, both drawn once per run and cut at
    two sigma, as is `drift_rad_per_m`, the steady turn per metre. `wander_*` are random walks per square root metre.
    Below `still_m_s` and `still_rad_s` the robot stands and nothing adds up. The rest is white noise of each reading.
    """

    scale: float = 0.008
    turn_scale: float = 0.003
    drift_rad_per_m: float = float(np.radians(0.25))
    wander_m: float = 0.004
    wander_rad: float = float(np.radians(0.12))
    still_m_s: float = 0.03
    still_rad_s: float = 0.03
    height_m: float = 0.002
    tilt_rad: float = float(np.radians(0.1))
    velocity_m_s: float = 0.01
    turn_rate_rad_s: float = 0.01


@dataclass(frozen=True)
class _Last:
    """The truth and the estimate of the last update."""

    stamp_s: float
    true: Pose2D
    estimate: Pose2D


class OdometryModel(NoisySensor):
    """Odometry of one robot. `odom` (O) lies on the floor under the body at the first update."""

    def __init__(self, rng: np.random.Generator, noise: OdometryNoise | None = None) -> None:
        """Draw this run's systematic errors."""
        super().__init__(rng)
        self._noise = noise or OdometryNoise()
        scale, turn_scale, drift = np.clip(rng.standard_normal(3), -2.0, 2.0)
        self._scale = 1.0 + self._noise.scale * float(scale)
        self._turn_scale = 1.0 + self._noise.turn_scale * float(turn_scale)
        self._drift_rad_per_m = self._noise.drift_rad_per_m * float(drift)
        self._last: _Last | None = None

    def update(self, stamp_s: float, X_WB: RigidTransform, w_WB_W: FloatArray, v_WB_W: FloatArray) -> Odometry:
        """Reading at stamp_s from the true pose, angular velocity (rad/s) and velocity (m/s) of the body in W."""
        true = Pose2D.from_transform(X_WB)
        if self._last is None:
            estimate = Pose2D(0.0, 0.0, 0.0)
        elif stamp_s > self._last.stamp_s:
            estimate = self._step(self._last, true, stamp_s - self._last.stamp_s)
        else:
            estimate = self._last.estimate
        self._last = _Last(stamp_s, true, estimate)
        return Odometry(stamp_s, self._lifted(estimate, X_WB), self._velocity(true.yaw_rad, w_WB_W, v_WB_W))

    def state(self) -> State:
        """What changes from one reading to the next."""
        last = self._last and [self._last.stamp_s, *_numbers(self._last.true), *_numbers(self._last.estimate)]
        return {**super().state(), "last": last}

    def restore(self, state: State) -> None:
        """Go on from such a state."""
        super().restore(state)
        last = state["last"]
        self._last = last and _Last(last[0], Pose2D(*last[1:4]), Pose2D(*last[4:]))

    def _step(self, last: _Last, true: Pose2D, dt_s: float) -> Pose2D:
        """The next estimate: the true motion since the last, in the body's frame, with errors."""
        forward, left = _turned(true.x_m - last.true.x_m, true.y_m - last.true.y_m, -last.true.yaw_rad)
        turn = _wrapped(true.yaw_rad - last.true.yaw_rad)
        distance = float(np.hypot(forward, left))
        moving = distance / dt_s > self._noise.still_m_s or abs(turn) / dt_s > self._noise.still_rad_s
        walk = self._rng.standard_normal(3) * np.sqrt(distance) * moving
        forward = forward * self._scale + self._noise.wander_m * float(walk[0])
        left = left * self._scale + self._noise.wander_m * float(walk[1])
        turn = turn * self._turn_scale + self._noise.wander_rad * float(walk[2])
        turn += self._drift_rad_per_m * distance * moving
        dx, dy = _turned(forward, left, last.estimate.yaw_rad)
        estimate = last.estimate
        return Pose2D(estimate.x_m + dx, estimate.y_m + dy, _wrapped(estimate.yaw_rad + turn))

    def _lifted(self, estimate: Pose2D, X_WB: RigidTransform) -> RigidTransform:
        """X_OB: the planar estimate with the true height, roll and pitch and their reading noise."""
        rpy, noise = RollPitchYaw(X_WB.rotation()), self._noise
        roll = rpy.roll_angle() + float(self._rng.normal(0.0, noise.tilt_rad))
        pitch = rpy.pitch_angle() + float(self._rng.normal(0.0, noise.tilt_rad))
        height = float(X_WB.translation()[2]) + float(self._rng.normal(0.0, noise.height_m))
        return RigidTransform(RollPitchYaw(roll, pitch, estimate.yaw_rad), [estimate.x_m, estimate.y_m, height])

    def _velocity(self, yaw_rad: float, w_WB_W: FloatArray, v_WB_W: FloatArray) -> tuple[float, float, float]:
        """(vx, vy, wz) in the level body frame, with noise."""
        vx, vy = _turned(float(v_WB_W[0]), float(v_WB_W[1]), -yaw_rad)
        noise = self._rng.standard_normal(3) * (
            self._noise.velocity_m_s,
            self._noise.velocity_m_s,
            self._noise.turn_rate_rad_s,
        )
        return vx + float(noise[0]), vy + float(noise[1]), float(w_WB_W[2]) + float(noise[2])


def _numbers(pose: Pose2D) -> tuple[float, float, float]:
    return pose.x_m, pose.y_m, pose.yaw_rad


def _turned(x: float, y: float, angle_rad: float) -> tuple[float, float]:
    """(x, y) turned counter-clockwise."""
    c, s = float(np.cos(angle_rad)), float(np.sin(angle_rad))
    return c * x - s * y, s * x + c * y


def _wrapped(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return float((angle_rad + np.pi) % (2.0 * np.pi) - np.pi)
