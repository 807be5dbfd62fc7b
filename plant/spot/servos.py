"""Set points of the servos of Spot's legs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from plant.locomotion.leg_kinematics import LegKinematics, UnreachableFootError
from plant.models.spot.description import LEGS
from plant.snapshot.values import State, array_of
from plant.spot.model import JointIndex
from skills.robot import FloatArray

_MAX_LEG_RATE_RAD_S = 20.0


class LegServos:
    """Joint set points that put the feet where the gait wants them under the body's pose."""

    def __init__(self, index: JointIndex, rest_rad: FloatArray) -> None:
        """`rest_rad`: (4, 3) joint angles at the beginning."""
        self._lower, self._upper = index.lower[index.legs], index.upper[index.legs]
        self._kinematics = [LegKinematics.of(leg) for leg in LEGS]
        self.rest_rad = rest_rad.copy()
        self._last = rest_rad.copy()

    def set_points(self, feet_B: Sequence[Sequence[float]], dt_s: float) -> tuple[FloatArray, FloatArray]:
        """Positions and velocities (4, 3) of the leg joints for feet at (x, y, z) in the body frame.

        A foot out of reach keeps its leg as it was.
        """
        solved = [self._solve(foot, p_BFoot) for foot, p_BFoot in enumerate(feet_B)]
        joints = np.minimum(np.maximum(solved, self._lower), self._upper)
        rates = np.minimum(np.maximum((joints - self._last) / dt_s, -_MAX_LEG_RATE_RAD_S), _MAX_LEG_RATE_RAD_S)
        self._last = joints
        return joints, rates

    def state(self) -> State:
        """The last set points."""
        return {"last": self._last.tolist()}

    def restore(self, state: State) -> None:
        """Go on from such a state."""
        self._last = array_of(state["last"])

    def _solve(self, foot: int, p_BFoot: Sequence[float]) -> tuple[float, float, float]:
        try:
            return self._kinematics[foot].joints(p_BFoot)
        except UnreachableFootError:
            hx, hy, kn = self._last[foot]
            return float(hx), float(hy), float(kn)
