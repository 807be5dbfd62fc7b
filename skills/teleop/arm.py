"""The arm by hand: each period a short trajectory that ends at rest, so that the arm stops when no more comes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from skills.arm.collision import ArmScene
from skills.arm.kinematics import ArmModel
from skills.quantities import Duration, Speed, Turn, TurnAcceleration, TurnRate
from skills.robot import ArmTrajectory, FloatArray
from skills.teleop.keys import HAND, JOINTS

_TAIL_POINTS = 5
_STILL_RAD_S = 1e-6


@dataclass(frozen=True)
class ArmOptions:
    """Speeds of the hand and of each joint; a step that would turn a joint by more than `jump_rad` is refused."""

    hand_m_s: Speed = 0.2
    hand_rad_s: TurnRate = 0.6
    joint_rad_s: TurnRate = 0.6
    joint_rad_s2: TurnAcceleration = 3.0
    jump_rad: Turn = 0.35
    period_s: Duration = 0.1


@dataclass(frozen=True)
class ArmMotion:
    """Joint angles and rates at a time (s), and that the arm brakes from there on, `braking_s` long."""

    at_s: float
    q_rad: FloatArray
    rate_rad_s: FloatArray
    braking_s: float

    def state(self, now_s: float) -> tuple[FloatArray, FloatArray]:
        """Joint angles and rates at a time not before `at_s`."""
        if self.braking_s <= 0.0:
            return self.q_rad, np.zeros(len(self.q_rad))
        s = float(np.clip(now_s - self.at_s, 0.0, self.braking_s))
        angles = self.q_rad + self.rate_rad_s * (s - 0.5 * s * s / self.braking_s)
        return angles, self.rate_rad_s * (1.0 - s / self.braking_s)


class HandControl:
    """Turns what is asked of the arm into motions; remembers the last one, from which the next one goes on."""

    def __init__(self, model: ArmModel, options: ArmOptions) -> None:
        self._model, self._options = model, options
        self._motion: ArmMotion | None = None
        self.note = ""

    def next(
        self, asked: Mapping[str, float], now_s: float, q_measured_rad: FloatArray, scene: ArmScene
    ) -> ArmTrajectory | None:
        """The trajectory from now on, None while nothing moves. `note` says why the arm does not go on."""
        options = self._options
        q, rate = (q_measured_rad, np.zeros(len(q_measured_rad)))
        if self._motion is not None:
            q, rate = self._motion.state(now_s)
        if np.max(np.abs(rate)) < _STILL_RAD_S and np.max(np.abs(q - q_measured_rad)) > 0.1:
            q = q_measured_rad
        self.note = ""
        wanted = _slewed(rate, self._wanted(asked, q), options.joint_rad_s2 * options.period_s)
        motion = self._moved(q, rate, wanted, now_s)
        if not self._free(q, motion, scene):
            self.note = self.note or "the arm would touch something or pass a joint's limit"
            motion = self._moved(q, rate, _slewed(rate, 0.0 * rate, options.joint_rad_s2 * options.period_s), now_s)
        self._motion = motion
        moves = max(np.max(np.abs(rate)), np.max(np.abs(motion.rate_rad_s))) > _STILL_RAD_S
        return _trajectory(q, motion, options.period_s) if moves else None

    def _wanted(self, asked: Mapping[str, float], q: FloatArray) -> FloatArray:
        """Joint rates that what is asked for means."""
        joints = np.array([asked.get(axis, 0.0) for axis in JOINTS[: len(q)]])
        hand = np.array([asked.get(axis, 0.0) for axis in HAND])
        if np.any(joints) or not np.any(hand):
            return self._options.joint_rad_s * joints
        options = self._options
        X_BH = self._model.X_BH(q)
        turn = RotationMatrix(RollPitchYaw(hand[3:] * options.hand_rad_s * options.period_s))
        place = X_BH.translation() + hand[:3] * options.hand_m_s * options.period_s
        # Joints that stand at their limit, as those of a stowed arm, may leave it: hence no margin.
        solution = self._model.nearest_inverse(RigidTransform(X_BH.rotation() @ turn, place), q, margin_rad=0.0)
        if solution is None or np.max(np.abs(solution - q)) > options.jump_rad:
            self.note = "the hand is at the end of the arm's reach"
            return np.zeros(len(q))
        rates = (solution - q) / options.period_s
        return np.asarray(rates * min(1.0, options.joint_rad_s / max(float(np.max(np.abs(rates))), 1e-9)))

    def _moved(self, q: FloatArray, before: FloatArray, after: FloatArray, now_s: float) -> ArmMotion:
        period_s = self._options.period_s
        braking_s = float(np.max(np.abs(after))) / self._options.joint_rad_s2
        return ArmMotion(now_s + period_s, q + 0.5 * (before + after) * period_s, after, braking_s)

    def _free(self, q: FloatArray, motion: ArmMotion, scene: ArmScene) -> bool:
        end, _ = motion.state(motion.at_s + motion.braking_s)
        for point in (motion.q_rad, end):
            beyond = np.maximum(self._model.lower_rad - point, point - self._model.upper_rad)
            before = np.maximum(self._model.lower_rad - q, q - self._model.upper_rad)
            if np.any(beyond > np.maximum(before, 0.0) + 1e-9):
                return False
        return scene.edge_free(q, motion.q_rad) and scene.edge_free(motion.q_rad, end)


def _slewed(rate: FloatArray, wanted: FloatArray, most: float) -> FloatArray:
    """The rate that comes as near to the wanted one as the acceleration allows."""
    change = wanted - rate
    return np.asarray(rate + change * min(1.0, most / max(float(np.max(np.abs(change))), 1e-9)))


def _trajectory(q: FloatArray, motion: ArmMotion, period_s: float) -> ArmTrajectory:
    times, points = [0.0, period_s], [q, motion.q_rad]
    if motion.braking_s > 1e-3:
        for fraction in np.linspace(0.0, 1.0, _TAIL_POINTS)[1:]:
            times.append(period_s + fraction * motion.braking_s)
            points.append(motion.state(motion.at_s + fraction * motion.braking_s)[0])
    return ArmTrajectory(np.array(times), np.array(points))
