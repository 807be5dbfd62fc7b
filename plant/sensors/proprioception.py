"""Proprioceptive sensors with bias and noise: joints, inertial measurement unit, battery, odometry, gripper."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from plant.sensors.noise import NoisySensor
from skills.robot import Battery, FloatArray, Gripper, Imu, Joints, Odometry, Pose2D


@dataclass(frozen=True)
class JointNoise:
    """White noise of each measurement, and the encoders' constant offsets, drawn once."""

    offset_rad: float = 0.001
    position_rad: float = 0.0003
    velocity_rad_s: float = 0.01
    effort_nm: float = 0.3


class JointModel(NoisySensor):
    """Joint encoders and torque sensors of one robot."""

    def __init__(self, rng: np.random.Generator, names: Sequence[str], noise: JointNoise | None = None) -> None:
        """`names` is the order of the joints in the arrays of `update`."""
        super().__init__(rng)
        self._names, self._noise = tuple(names), noise or JointNoise()
        self._offsets = rng.normal(0.0, self._noise.offset_rad, len(self._names))

    def update(
        self, stamp_s: float, position_rad: FloatArray, velocity_rad_s: FloatArray, effort_nm: FloatArray
    ) -> Joints:
        """Measures the joints at stamp_s from the true arrays (joints,). Raises ValueError when a length is wrong."""
        noise = self._rng.standard_normal((3, len(self._names)))
        read = (
            position_rad + self._offsets + self._noise.position_rad * noise[0],
            velocity_rad_s + self._noise.velocity_rad_s * noise[1],
            effort_nm + self._noise.effort_nm * noise[2],
        )
        position, velocity, effort = (dict(zip(self._names, row.tolist(), strict=True)) for row in read)
        return Joints(stamp_s, position, velocity, effort)


GRAVITY_W = np.array([0.0, 0.0, -9.81])


@dataclass(frozen=True)
class ImuNoise:
    """Standard deviations, per axis, of the constant biases and of the white noise."""

    gyro_bias_rad_s: float = 0.002
    gyro_rad_s: float = 0.003
    accelerometer_bias_m_s2: float = 0.03
    accelerometer_m_s2: float = 0.05


class ImuModel(NoisySensor, saved=("_last",)):
    """IMU of one robot; the acceleration is the change of velocity between two updates."""

    def __init__(self, rng: np.random.Generator, noise: ImuNoise | None = None) -> None:
        """Draws the biases of the run."""
        super().__init__(rng)
        self._noise = noise or ImuNoise()
        self._gyro_bias = rng.normal(0.0, self._noise.gyro_bias_rad_s, 3)
        self._force_bias = rng.normal(0.0, self._noise.accelerometer_bias_m_s2, 3)
        self._last: list[Any] | None = None

    def update(self, stamp_s: float, X_WB: RigidTransform, w_WB_W: FloatArray, v_WB_W: FloatArray) -> Imu:
        """Measures at stamp_s from the true pose, angular velocity (rad/s) and velocity (m/s) of the body in W."""
        acceleration_W = self._acceleration(stamp_s, np.asarray(v_WB_W, dtype=np.float64))
        R_BW = X_WB.rotation().matrix().T
        noise = self._rng.standard_normal((2, 3))
        wx, wy, wz = (R_BW @ w_WB_W + self._gyro_bias + self._noise.gyro_rad_s * noise[0]).tolist()
        force = R_BW @ (acceleration_W - GRAVITY_W) + self._force_bias
        fx, fy, fz = (force + self._noise.accelerometer_m_s2 * noise[1]).tolist()
        return Imu(stamp_s, (wx, wy, wz), (fx, fy, fz))

    def _acceleration(self, stamp_s: float, v_WB_W: FloatArray) -> FloatArray:
        """Mean acceleration since the last update; zero at the first one."""
        last, self._last = self._last, [stamp_s, v_WB_W.tolist()]
        if last is None or stamp_s <= last[0]:
            return np.zeros(3)
        return np.asarray((v_WB_W - last[1]) / (stamp_s - last[0]))


@dataclass(frozen=True)
class BatterySpec:
    """Battery data: `runtime_s` from full to empty at load 1, and the fraction `idle_share` of that drain at load 0.

    `sigma`: error of the gauge. `charge_s`: time at a dock from empty to full, short so that no mission waits for an
    hour.
    """

    runtime_s: float = 5400.0
    idle_share: float = 0.4
    sigma: float = 0.001
    charge_s: float = 300.0


class BatteryModel(NoisySensor, saved=("_charge", "_stamp_s")):
    """Battery of one robot."""

    def __init__(self, rng: np.random.Generator, charge: float = 1.0, spec: BatterySpec | None = None) -> None:
        """Starts with a charge from 0 to 1. Raises ValueError for any other value."""
        if not 0.0 <= charge <= 1.0:
            raise ValueError(f"battery charge must be from 0 to 1, not {charge}")
        super().__init__(rng)
        self._spec, self._charge = spec or BatterySpec(), charge
        self._stamp_s: float | None = None

    def update(self, stamp_s: float, load: float, *, docked: bool = False) -> Battery:
        """Measures the charge at stamp_s, after a load from 0 (standing) to 1 (walking), or on a dock."""
        elapsed = 0.0 if self._stamp_s is None else max(0.0, stamp_s - self._stamp_s)
        self._stamp_s = stamp_s
        if docked:
            self._charge = min(1.0, self._charge + elapsed / self._spec.charge_s)
        else:
            self._charge = charge_after(self._charge, elapsed, load, self._spec)
        read = self._charge + float(self._rng.normal(0.0, self._spec.sigma))
        return Battery(stamp_s, min(max(round(read, 3), 0.0), 1.0))


def charge_after(charge: float, elapsed_s: float, load: float, spec: BatterySpec) -> float:
    """Remaining charge after elapsed_s at a load (clipped to 0..1)."""
    share = spec.idle_share + (1.0 - spec.idle_share) * min(max(load, 0.0), 1.0)
    return max(0.0, charge - elapsed_s * share / spec.runtime_s)


@dataclass(frozen=True)
class OdometryNoise:
    """Errors of odometry, as standard deviations.

    `scale`, `turn_scale` and `drift_rad_per_m`: relative error of distances, that of turns, and a steady turn per
    metre; each is drawn once per run and clipped at two sigma. `wander_*`: random walks per square root of a metre.
    `still_m_s` and `still_rad_s`: below these the robot stands, and no error accumulates. The rest is white noise of
    each measurement.
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
    """True pose and estimate at the last update."""

    stamp_s: float
    true: Pose2D
    estimate: Pose2D


class OdometryModel(NoisySensor, saved=("_last",)):
    """Odometry of one robot; the frame `odom` (O) lies on the floor below the body at the first update."""

    def __init__(self, rng: np.random.Generator, noise: OdometryNoise | None = None) -> None:
        """Draws the systematic errors of the run."""
        super().__init__(rng)
        self._noise = noise or OdometryNoise()
        scale, turn_scale, drift = np.clip(rng.standard_normal(3), -2.0, 2.0)
        self._scale = 1.0 + self._noise.scale * float(scale)
        self._turn_scale = 1.0 + self._noise.turn_scale * float(turn_scale)
        self._drift_rad_per_m = self._noise.drift_rad_per_m * float(drift)
        self._last: _Last | None = None

    def update(self, stamp_s: float, X_WB: RigidTransform, w_WB_W: FloatArray, v_WB_W: FloatArray) -> Odometry:
        """Measures odometry at stamp_s from the true pose, angular velocity (rad/s) and velocity (m/s) of the body."""
        true = Pose2D.from_transform(X_WB)
        if self._last is None:
            estimate = Pose2D(0.0, 0.0, 0.0)
        elif stamp_s > self._last.stamp_s:
            estimate = self._step(self._last, true, stamp_s - self._last.stamp_s)
        else:
            estimate = self._last.estimate
        self._last = _Last(stamp_s, true, estimate)
        noise = self._rng.standard_normal(6).tolist()
        X_OB = self._lifted(estimate, X_WB, noise[:3])
        return Odometry(stamp_s, X_OB, self._velocity(true.yaw_rad, w_WB_W, v_WB_W, noise[3:]))

    def _step(self, last: _Last, true: Pose2D, dt_s: float) -> Pose2D:
        """Next estimate: the true motion since the last update, in the body frame, with errors."""
        forward, left = _turned(true.x_m - last.true.x_m, true.y_m - last.true.y_m, -last.true.yaw_rad)
        turn = _wrapped(true.yaw_rad - last.true.yaw_rad)
        distance = float(np.hypot(forward, left))
        moving = distance / dt_s > self._noise.still_m_s or abs(turn) / dt_s > self._noise.still_rad_s
        root = math.sqrt(distance) * moving
        along, across, about = self._rng.standard_normal(3).tolist()
        forward = forward * self._scale + self._noise.wander_m * (along * root)
        left = left * self._scale + self._noise.wander_m * (across * root)
        turn = turn * self._turn_scale + self._noise.wander_rad * (about * root)
        turn += self._drift_rad_per_m * distance * moving
        dx, dy = _turned(forward, left, last.estimate.yaw_rad)
        estimate = last.estimate
        return Pose2D(estimate.x_m + dx, estimate.y_m + dy, _wrapped(estimate.yaw_rad + turn))

    def _lifted(self, estimate: Pose2D, X_WB: RigidTransform, noise: Sequence[float]) -> RigidTransform:
        """Pose X_OB: the planar estimate with the true height, roll and pitch, and standard normal `noise` on these."""
        rpy, (roll, pitch, height) = RollPitchYaw(R=X_WB.rotation()), noise
        tilt_rad, height_m = self._noise.tilt_rad, float(X_WB.translation()[2]) + self._noise.height_m * height
        roll_rad, pitch_rad = rpy.roll_angle() + tilt_rad * roll, rpy.pitch_angle() + tilt_rad * pitch
        place = np.array([estimate.x_m, estimate.y_m, height_m])
        return RigidTransform(RollPitchYaw(roll_rad, pitch_rad, estimate.yaw_rad), place)

    def _velocity(
        self, yaw_rad: float, w_WB_W: FloatArray, v_WB_W: FloatArray, noise: Sequence[float]
    ) -> tuple[float, float, float]:
        """Velocity (vx, vy, wz) in the levelled body frame, with standard normal `noise`."""
        vx, vy = _turned(float(v_WB_W[0]), float(v_WB_W[1]), -yaw_rad)
        speed_m_s, turn_rad_s = self._noise.velocity_m_s, self._noise.turn_rate_rad_s
        return vx + speed_m_s * noise[0], vy + speed_m_s * noise[1], float(w_WB_W[2]) + turn_rad_s * noise[2]


def _turned(x: float, y: float, angle_rad: float) -> tuple[float, float]:
    """Rotates (x, y) counter-clockwise."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return c * x - s * y, s * x + c * y


def _wrapped(angle_rad: float) -> float:
    """Angle, wrapped to [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


_TOLERANCE_S = 1e-6


@dataclass(frozen=True)
class GripperNoise:
    """Noise of the measurements, and thresholds for reporting that the gripper holds an object.

    `holding_force_n`, `closed` and `holding_after_s`: the report becomes True once the force is at least the first and
    the opening above the second for this time without a break, and False once one of both fails for this time. Empty
    jaws close to an opening of 0, where they feel nothing; `closed` is five standard deviations of the noise. Up to
    `thin`, an object may slip behind the fingertips, where shut jaws do not feel it. The defaults are for a hinged
    gripper (rad).
    """

    opening: float = 0.003
    force_n: float = 0.8
    force_share: float = 0.03
    holding_force_n: float = 4.0
    closed: float = 0.015
    thin: float = 0.04
    holding_after_s: float = 0.15


class GripperModel(NoisySensor, saved=("_holding", "_told", "_opening", "_changing_since_s")):
    """Gripper sensors of one robot."""

    def __init__(self, rng: np.random.Generator, noise: GripperNoise | None = None) -> None:
        """Starts without an object. Draws the systematic part of the force error."""
        super().__init__(rng)
        self._noise = noise or GripperNoise()
        self._force_scale = 1.0 + float(rng.normal(0.0, self._noise.force_share))
        self._holding = self._told = False
        self._opening = math.inf
        self._changing_since_s: float | None = None

    def tell(self, holding: bool) -> None:
        """Takes a client's word that shut jaws hold a thin object; it counts until the client takes it back."""
        self._told = holding and self._opening <= self._noise.thin

    def update(self, stamp_s: float, opening: float, force_n: float) -> Gripper:
        """Measures the gripper at stamp_s from the true opening (0 closed) and the force at its tip.

        `force_n` is 0 while the gripper moves freely.
        """
        read = opening + float(self._rng.normal(0.0, self._noise.opening))
        force = max(0.0, force_n * self._force_scale + float(self._rng.normal(0.0, self._noise.force_n)))
        gripped = force >= self._noise.holding_force_n and read > self._noise.closed
        self._settle(stamp_s, gripped)
        self._opening = read
        return Gripper(stamp_s, max(0.0, read), force, self._holding or self._told)

    def _settle(self, stamp_s: float, gripped: bool) -> None:
        """Changes the report once the measurements contradict it for long enough."""
        if gripped == self._holding:
            self._changing_since_s = None
            return
        if self._changing_since_s is None:
            self._changing_since_s = stamp_s
        if stamp_s - self._changing_since_s >= self._noise.holding_after_s - _TOLERANCE_S:
            self._holding, self._changing_since_s = gripped, None
