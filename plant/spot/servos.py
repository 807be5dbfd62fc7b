"""Set points of Spot's joint servos: arm along a trajectory, jaw with limited force, legs under the body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from plant.locomotion.leg_kinematics import LegKinematics, UnreachableFootError
from plant.models.spot.description import LEGS
from plant.snapshot.values import State, array_of
from plant.spot.model import JointIndex
from skills.robot import ArmTrajectory, FloatArray


@dataclass(frozen=True)
class JawGoal:
    """Jaw angle to reach (0 closed, positive open) with at most `force_n` at the tip."""

    opening_rad: float
    force_n: float


def arm_set_point(trajectory: ArmTrajectory, elapsed_s: float) -> tuple[FloatArray, FloatArray]:
    """Positions and velocities (6,), (6,) of a trajectory at a time since its start; at rest beyond its ends."""
    times, positions = trajectory.times_s, trajectory.positions_rad
    if len(times) == 1 or elapsed_s >= times[-1]:
        return positions[-1].copy(), np.zeros(positions.shape[1])
    if elapsed_s <= times[0]:
        return positions[0].copy(), np.zeros(positions.shape[1])
    k = int(np.searchsorted(times, elapsed_s, side="right")) - 1
    rate = (positions[k + 1] - positions[k]) / (times[k + 1] - times[k])
    return positions[k] + rate * (elapsed_s - times[k]), rate


def jaw_set_point(goal: JawGoal, jaw_rad: float, gain_nm_rad: float, tip_radius_m: float) -> float:
    """Jaw joint position (rad, negative open) that makes the servo push with no more than the goal's force."""
    lead = goal.force_n * tip_radius_m / gain_nm_rad
    return float(np.clip(-goal.opening_rad, jaw_rad - lead, jaw_rad + lead))


class LegServos:
    """Joint set points that put the feet where the gait wants them under the body's pose."""

    def __init__(self, index: JointIndex, rest_rad: FloatArray) -> None:
        """`rest_rad`: (4, 3) joint angles at the beginning."""
        self._index = index
        self._kinematics = [LegKinematics.of(leg) for leg in LEGS]
        self.rest_rad = rest_rad.copy()
        self._last = rest_rad.copy()

    def set_points(self, X_WB: RigidTransform, feet_W: FloatArray, dt_s: float) -> tuple[FloatArray, FloatArray]:
        """Positions and velocities (4, 3) of the leg joints; a foot out of reach keeps its leg as it was."""
        feet_B = (feet_W - X_WB.translation()) @ X_WB.rotation().matrix()
        lower, upper = self._index.lower[self._index.legs], self._index.upper[self._index.legs]
        joints = np.clip([self._solve(foot, feet_B[foot]) for foot in range(len(LEGS))], lower, upper)
        rates = np.clip((joints - self._last) / dt_s, -20.0, 20.0)
        self._last = joints
        return joints, rates

    def state(self) -> State:
        """The last set points."""
        return {"last": self._last.tolist()}

    def restore(self, state: State) -> None:
        """Go on from such a state."""
        self._last = array_of(state["last"])

    def _solve(self, foot: int, p_BFoot: FloatArray) -> tuple[float, float, float]:
        try:
            return self._kinematics[foot].joints(p_BFoot)
        except UnreachableFootError:
            hx, hy, kn = self._last[foot]
            return float(hx), float(hy), float(kn)
