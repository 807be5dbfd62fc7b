"""Inverse kinematics of an arm of any structure: damped least squares from several starts.

The damping follows Sugihara (Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method, 2011).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydrake.math import RigidTransform

from skills.estimate.compiled import compiled
from skills.manipulation.arm.clearance import place_links
from skills.robot import FloatArray

_STARTS = 24
"""Number of starts: the limits are sampled by a fixed sequence."""
_ITERATIONS = 40
_CLOSE = 1e-5
"""Residual (m, and rad times `_ROTATION_M`) at which a pose counts as reached."""
_ROTATION_M = 0.3
_DAMPING = 1e-4
_LONGEST_STEP_RAD = 0.6
_SAME_RAD = 0.02
"""Difference of every joint below which two solutions count as one."""


@dataclass(frozen=True)
class AnyJoints:
    """Joints of an arm: axes (J, 3) in F, X_PF as R_PF (J, 3, 3) and p_PF (J, 3), limits (J,) in rad."""

    axes: FloatArray
    R_PF: FloatArray
    p_PF: FloatArray
    lower_rad: FloatArray
    upper_rad: FloatArray

    @cached_property
    def _starts(self) -> FloatArray:
        """Joint angles (N, J) that are spread over the limits; those of endless joints over a turn."""
        low, high = np.maximum(self.lower_rad, -math.pi), np.minimum(self.upper_rad, math.pi)
        share = np.random.default_rng(0).random((_STARTS, len(low)))
        share[0] = 0.5
        return np.asarray(low + share * (high - low))

    @cached_property
    def _reach_m(self) -> float:
        return float(np.linalg.norm(self.p_PF[1:], axis=1).sum())

    def _descend(self, X_BL: RigidTransform, starts: FloatArray, margin_rad: float, most: int) -> FloatArray:
        """Returns at most `most` different joint angles (N, J) that put the last link at X_BL."""
        p_BL = X_BL.translation()
        if float(np.linalg.norm(p_BL - self.p_PF[0])) > self._reach_m:
            return np.empty((0, starts.shape[1]))
        found = np.empty((most, starts.shape[1]))
        limits = self.lower_rad + margin_rad, self.upper_rad - margin_rad
        chain = self.axes, self.R_PF, self.p_PF
        count = _solve(found, np.ascontiguousarray(starts), X_BL.rotation().matrix(), p_BL, *chain, *limits)
        return found[:count]

    def solutions(self, X_BL: RigidTransform, margin_rad: float) -> FloatArray:
        """Returns joint angles (N, J) that put the last link at X_BL; N may be 0."""
        return self._descend(X_BL, self._starts, margin_rad, _STARTS)

    def reaches(self, X_BL: RigidTransform, margin_rad: float) -> bool:
        """Returns whether there are joint angles that put the last link at X_BL, as far as the starts tell."""
        return bool(len(self._descend(X_BL, self._starts, margin_rad, 1)))

    def nearest(self, X_BL: RigidTransform, q_near_rad: FloatArray, margin_rad: float) -> FloatArray | None:
        """Returns joint angles (J,) near to given ones, None when there are none."""
        near = np.clip(q_near_rad, self.lower_rad + margin_rad, self.upper_rad - margin_rad)[None]
        found = self._descend(X_BL, near, margin_rad, 1)
        if not len(found):
            found = self.solutions(X_BL, margin_rad)
        return min(found, key=lambda q: float(np.max(np.abs(q - q_near_rad))), default=None)


@compiled
def _solve(
    found: FloatArray,
    starts: FloatArray,
    R_BT: FloatArray,
    p_BT: FloatArray,
    axes: FloatArray,
    R_PF: FloatArray,
    p_PF: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
) -> int:
    """Writes different joint angles (J,) that reach the target T into the rows of `found`; returns their number."""
    joints, count = axes.shape[0], 0
    R, p = np.empty((joints + 1, 3, 3)), np.empty((joints + 1, 3))
    jacobian, error = np.empty((6, joints)), np.empty(6)
    for start in range(starts.shape[0]):
        q = starts[start].copy()
        for _ in range(_ITERATIONS):
            place_links(R, p, q, axes, R_PF, p_PF)
            _differ(error, R[joints], p[joints], R_BT, p_BT)
            size = math.sqrt(error @ error)
            if size < _CLOSE:
                break
            for j in range(joints):
                axis = R[j + 1] @ axes[j]
                arm = p[joints] - p[j + 1]
                jacobian[0, j] = axis[1] * arm[2] - axis[2] * arm[1]
                jacobian[1, j] = axis[2] * arm[0] - axis[0] * arm[2]
                jacobian[2, j] = axis[0] * arm[1] - axis[1] * arm[0]
                jacobian[3:, j] = _ROTATION_M * axis
            normal = jacobian @ jacobian.T + (0.5 * size * size + _DAMPING * size) * np.eye(6)
            step = jacobian.T @ np.linalg.solve(normal, error)
            longest = np.max(np.abs(step))
            if longest > _LONGEST_STEP_RAD:
                step *= _LONGEST_STEP_RAD / longest
            q = np.minimum(np.maximum(q + step, lower), upper)
        if size >= _CLOSE:
            continue
        new = True
        for k in range(count):
            new = new and np.max(np.abs(found[k] - q)) > _SAME_RAD
        if new:
            found[count] = q
            count += 1
            if count == found.shape[0]:
                return count
    return count


@compiled
def _differ(error: FloatArray, R: FloatArray, p: FloatArray, R_BT: FloatArray, p_BT: FloatArray) -> None:
    """Writes the way to the target into `error` (6,): m, then the turn as a vector (rad times `_ROTATION_M`)."""
    M = R_BT @ R.T
    x, y, z = M[2, 1] - M[1, 2], M[0, 2] - M[2, 0], M[1, 0] - M[0, 1]
    sine = 0.5 * math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(sine, 0.5 * (M[0, 0] + M[1, 1] + M[2, 2] - 1.0))
    scale = _ROTATION_M * (0.5 * angle / sine if sine > 1e-9 else 0.5)
    error[:3] = p_BT - p
    error[3], error[4], error[5] = scale * x, scale * y, scale * z
