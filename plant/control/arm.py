"""The servos of an arm: they follow a joint trajectory, and hold where it ends."""

from __future__ import annotations

import numpy as np

from plant.control.joints import ActuatedJoints
from plant.kept import Kept
from skills.robot import ArmTrajectory, FloatArray

_ARRIVED_RAD = 0.03
_STILL_RAD_S = 0.06
_TRAJECTORY_START_RAD = 0.25


class ArmServos(Kept, keeps=("goal_rad",)):
    """Set points of one arm's joints."""

    def __init__(self, joints: ActuatedJoints, now_rad: FloatArray) -> None:
        """`now_rad` is where all joints are."""
        self._arm, self._fastest_rad_s = joints.arm, joints.fastest_arm_rad_s
        self._lower, self._upper = joints.lower[self._arm] - 1e-3, joints.upper[self._arm] + 1e-3
        self.hold(now_rad)

    def hold(self, joints_rad: FloatArray) -> None:
        """Stay where all joints are."""
        self.goal_rad, self.rate_rad_s = joints_rad[self._arm], np.zeros(len(self._arm))

    def refusal(self, trajectory: ArmTrajectory) -> str | None:
        """Why the arm cannot follow a trajectory from here."""
        positions = trajectory.positions_rad
        if positions.shape[1] != len(self._arm):
            return f"move_arm: {positions.shape[1]} joints given, the arm has {len(self._arm)}"
        if np.any(positions < self._lower) or np.any(positions > self._upper):
            return "move_arm: the trajectory leaves the joint limits"
        if np.any(np.abs(positions[0] - self.goal_rad) > _TRAJECTORY_START_RAD):
            return "move_arm: the trajectory begins away from where the arm is"
        rates = np.abs(np.diff(positions, axis=0)) / np.diff(trajectory.times_s)[:, None]
        if rates.size and np.any(rates > self._fastest_rad_s):
            row, joint = np.unravel_index(int(np.argmax(rates / self._fastest_rad_s)), rates.shape)
            return (
                f"move_arm: a joint would move at {rates[row, joint]:.1f} rad/s; "
                f"at most {self._fastest_rad_s[joint]:.1f} is allowed"
            )
        return None

    def follow(
        self, trajectory: ArmTrajectory | None, elapsed_s: float, joints_rad: FloatArray, rates_rad_s: FloatArray
    ) -> bool:
        """Take the set points at a time since the trajectory's start, if there is one; True when it has ended there."""
        self.rate_rad_s = np.zeros(len(self._arm))
        if trajectory is None:
            return False
        self.goal_rad, self.rate_rad_s = arm_set_point(trajectory, elapsed_s)
        if elapsed_s < trajectory.times_s[-1]:
            return False
        off = np.abs(joints_rad[self._arm] - trajectory.positions_rad[-1]).max()
        return bool(off < _ARRIVED_RAD and np.abs(rates_rad_s[self._arm]).max() < _STILL_RAD_S)


def arm_set_point(trajectory: ArmTrajectory, elapsed_s: float) -> tuple[FloatArray, FloatArray]:
    """Positions and velocities (J,), (J,) of a trajectory at a time since its start; at rest beyond its ends."""
    times, positions = trajectory.times_s, trajectory.positions_rad
    if len(times) == 1 or elapsed_s >= times[-1]:
        return positions[-1].copy(), np.zeros(positions.shape[1])
    if elapsed_s <= times[0]:
        return positions[0].copy(), np.zeros(positions.shape[1])
    k = int(np.searchsorted(times, elapsed_s, side="right")) - 1
    rate = (positions[k + 1] - positions[k]) / (times[k + 1] - times[k])
    return positions[k] + rate * (elapsed_s - times[k]), rate
