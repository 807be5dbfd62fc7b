"""Inverse kinematics of an arm with seven joints in closed form, and of any other arm by damped least squares.

The seven joints are shoulder pan and lift, upper-arm roll, elbow flex, forearm roll, wrist flex and wrist roll.

The shoulder pan is the redundant degree of freedom: the solver samples its whole range, and the other joints follow in
closed form. A flex joint that bends to the other side, with half a turn of roll before and after it, gives the same
link poses. Therefore elbow and wrist bend to the positive side, except in solutions near a given one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from skills.compiled import compiled
from skills.manipulation.arm.clearance import place_links
from skills.robot import FloatArray

JOINTS = 7
AXES = ((0, 0, 1), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0))
_PANS = 17
"""Number of pan angles that are tried."""
_PANS_FOR_REACH = 9
"""Number of pan angles in the first attempt, if any solution will do."""
_BESIDE_RAD = np.array([0.0, 0.03, -0.03, 0.08, -0.08, 0.16, -0.16, 0.3, -0.3, 0.5, -0.5])
"""Differences of the pan angle from a near solution's."""
_SINGULAR = 1e-9
"""Sine of the wrist's flex below which only the sum of its rolls counts."""
_MOST = 4 * 2 * _PANS
"""Largest number of solutions."""
_STARTS = 24
"""Number of starts: the limits are sampled by a fixed sequence."""
_ITERATIONS = 40
_CLOSE = 1e-5
"""Residual (m, and rad times `_ROTATION_M`) at which a pose counts as reached."""
_ROTATION_M = 0.3
_DAMPING = 1e-4
_LONGEST_STEP_RAD = 0.6
_SAME_RAD = 0.02
"""Largest joint difference between equal solutions."""


@dataclass(frozen=True)
class SevenJoints:
    """Dimensions (m): pan joint in B, from there to the lift joint (ahead, up), upper arm, forearm, and wrist.

    `wrist_m` is the distance from the wrist's centre to the last joint, whose frame is rotated by `roll_rad` about its
    axis. Limits (7,) are in rad.
    """

    p_BS: FloatArray
    ahead_m: float
    up_m: float
    upper_m: float
    fore_m: float
    wrist_m: float
    roll_rad: float
    lower_rad: FloatArray
    upper_rad: FloatArray

    def solutions(self, X_BL: RigidTransform, margin_rad: float) -> FloatArray:
        """Returns joint angles (N, 7) for the last link at X_BL, those far from the limits first; N may be 0."""
        found, count = np.empty((_MOST, JOINTS)), 0
        count = _solve(*self._pose(X_BL), self._pans(_PANS, margin_rad), *self._limits(margin_rad), False, False, found)
        found = found[:count]
        with np.errstate(invalid="ignore"):
            middle, half = 0.5 * (self.lower_rad + self.upper_rad), 0.5 * (self.upper_rad - self.lower_rad)
            strain = np.where(np.isfinite(half), np.abs(found - middle) / half, 0.0)
        return np.asarray(found[np.argsort(np.max(strain, axis=1, initial=0.0), kind="stable")])

    def reaches(self, X_BL: RigidTransform, margin_rad: float) -> bool:
        """Returns whether joint angles exist that put the last link at X_BL."""
        found, pose, limits = np.empty((1, JOINTS)), self._pose(X_BL), self._limits(margin_rad)
        for pans in (self._pans(_PANS_FOR_REACH, margin_rad), self._pans(2 * _PANS, margin_rad)):
            if _solve(*pose, pans, *limits, False, True, found):
                return True
        return False

    def nearest(self, X_BL: RigidTransform, q_near_rad: FloatArray, margin_rad: float) -> FloatArray | None:
        """Returns the joint angles (7,) nearest to q_near_rad, preferring a similar pan; None when there are none."""
        found = np.empty((_MOST, JOINTS))
        low, high = self.lower_rad[0] + margin_rad, self.upper_rad[0] - margin_rad
        pans = np.clip(q_near_rad[0] + _BESIDE_RAD, low, high)
        count = _solve(*self._pose(X_BL), pans, *self._limits(margin_rad), True, False, found)
        if not count:
            pans = self._pans(_PANS, margin_rad)
            count = _solve(*self._pose(X_BL), pans, *self._limits(margin_rad), True, False, found)
        if not count:
            return None
        turned = found[:count] + math.tau * np.round((q_near_rad - found[:count]) / math.tau)
        found = np.where(np.isinf(self.upper_rad), turned, found[:count])
        return np.asarray(found[np.argmin(np.max(np.abs(found - q_near_rad), axis=1))])

    def _pans(self, count: int, margin_rad: float) -> FloatArray:
        return np.linspace(self.lower_rad[0] + margin_rad, self.upper_rad[0] - margin_rad, count)

    def _limits(self, margin_rad: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        lengths = [self.ahead_m, self.up_m, self.upper_m, self.fore_m]
        return np.array(lengths), self.lower_rad + margin_rad, self.upper_rad - margin_rad

    def _pose(self, X_BL: RigidTransform) -> tuple[FloatArray, FloatArray]:
        """Rotation of the last link, and position of the wrist's centre relative to the pan joint."""
        R = np.ascontiguousarray((X_BL.rotation() @ RotationMatrix.MakeXRotation(-self.roll_rad)).matrix())
        return R, np.asarray(X_BL.translation() - self.wrist_m * R[:, 0] - self.p_BS)


@compiled
def _solve(
    R: NDArray[np.float64],
    p: NDArray[np.float64],
    pans: NDArray[np.float64],
    lengths: NDArray[np.float64],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    bent_both_ways: bool,
    first_only: bool,
    found: NDArray[np.float64],
) -> int:
    """Writes solutions within the limits into the rows of `found` (N, 7); returns their number."""
    ahead, up, a, f = lengths
    count = 0
    for k in range(len(pans)):
        q1 = pans[k]
        c1, s1 = math.cos(q1), math.sin(q1)
        x, y, z = c1 * p[0] + s1 * p[1] - ahead, c1 * p[1] - s1 * p[0], p[2] - up
        c4 = (x * x + y * y + z * z - a * a - f * f) / (2.0 * a * f)
        if abs(c4) >= 1.0:
            continue
        q4 = math.acos(c4)
        s4 = math.sin(q4)
        s3 = y / (f * s4)
        if abs(s3) > 1.0 or q4 > max(upper[3], -lower[3]):
            continue
        for side in range(2):
            q3 = math.asin(s3) if side == 0 else math.pi - math.asin(s3)
            c3 = math.cos(q3)
            q2 = _wrapped(math.atan2(-f * s4 * c3, a + f * c4) - math.atan2(z, x))
            if q2 < lower[1] or q2 > upper[1]:
                continue
            q5, q6, q7 = _wrist(R, c1, s1, math.cos(q2), math.sin(q2), c3, s3, c4, s4)
            if q6 > max(upper[5], -lower[5]):
                continue
            for bend in range(4 if bent_both_ways else 1):
                elbow, wrist = bend % 2, bend // 2
                row = found[count]
                row[0], row[1], row[2] = q1, q2, _wrapped(q3 + math.pi * elbow)
                row[3], row[4] = -q4 if elbow else q4, _wrapped(q5 + math.pi * (elbow + wrist))
                row[5], row[6] = -q6 if wrist else q6, _wrapped(q7 + math.pi * wrist)
                within = True
                for j in range(2, JOINTS):
                    within &= lower[j] <= row[j] <= upper[j]
                if not within:
                    continue
                count += 1
                if first_only or count == len(found):
                    return count
    return count


@compiled
def _wrist(
    R: NDArray[np.float64], c1: float, s1: float, c2: float, s2: float, c3: float, s3: float, c4: float, s4: float
) -> tuple[float, float, float]:
    """Returns the last three angles for the last link's rotation R, from cosines and sines of the first four."""
    # Columns of Rz(q1) Ry(q2) Rx(q3) Ry(q4), first in the panned frame.
    y0, y1, y2 = s2 * s3, c3, c2 * s3
    u0, u1, u2 = s2 * c3, -s3, c2 * c3
    x0, x1, x2 = c4 * c2 - s4 * u0, -s4 * u1, -c4 * s2 - s4 * u2
    z0, z1, z2 = s4 * c2 + c4 * u0, c4 * u1, -s4 * s2 + c4 * u2
    ax, bx = c1 * x0 - s1 * x1, s1 * x0 + c1 * x1
    ay, by = c1 * y0 - s1 * y1, s1 * y0 + c1 * y1
    az, bz = c1 * z0 - s1 * z1, s1 * z0 + c1 * z1
    m00 = ax * R[0, 0] + bx * R[1, 0] + x2 * R[2, 0]
    m01 = ax * R[0, 1] + bx * R[1, 1] + x2 * R[2, 1]
    m02 = ax * R[0, 2] + bx * R[1, 2] + x2 * R[2, 2]
    sine = math.hypot(m01, m02)
    if sine < _SINGULAR:
        m11 = ay * R[0, 1] + by * R[1, 1] + y2 * R[2, 1]
        m21 = az * R[0, 1] + bz * R[1, 1] + z2 * R[2, 1]
        return 0.0, math.atan2(sine, m00), math.atan2(m21, m11)
    m10 = ay * R[0, 0] + by * R[1, 0] + y2 * R[2, 0]
    m20 = az * R[0, 0] + bz * R[1, 0] + z2 * R[2, 0]
    return math.atan2(m10, -m20), math.atan2(sine, m00), math.atan2(m01, m02)


@compiled
def _wrapped(angle_rad: float) -> float:
    """Returns an angle in [-pi, pi]."""
    return angle_rad - 2.0 * math.pi * math.floor(angle_rad / (2.0 * math.pi) + 0.5)


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
        """Joint angles (N, J) spread over the limits; continuous joints over one turn."""
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
        count = _descend(found, np.ascontiguousarray(starts), X_BL.rotation().matrix(), p_BL, *chain, *limits)
        return found[:count]

    def solutions(self, X_BL: RigidTransform, margin_rad: float) -> FloatArray:
        """Returns joint angles (N, J) that put the last link at X_BL; N may be 0."""
        return self._descend(X_BL, self._starts, margin_rad, _STARTS)

    def reaches(self, X_BL: RigidTransform, margin_rad: float) -> bool:
        """Returns whether the iteration finds, from one of its starts, a solution for the last link at X_BL."""
        return bool(len(self._descend(X_BL, self._starts, margin_rad, 1)))

    def nearest(self, X_BL: RigidTransform, q_near_rad: FloatArray, margin_rad: float) -> FloatArray | None:
        """Returns joint angles (J,) near q_near_rad; None when there are none."""
        near = np.clip(q_near_rad, self.lower_rad + margin_rad, self.upper_rad - margin_rad)[None]
        found = self._descend(X_BL, near, margin_rad, 1)
        if not len(found):
            found = self.solutions(X_BL, margin_rad)
        return min(found, key=lambda q: float(np.max(np.abs(q - q_near_rad))), default=None)


@compiled
def _descend(
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
    """Writes the pose error to the target into `error` (6,): m, then the rotation vector (rad times `_ROTATION_M`)."""
    M = R_BT @ R.T
    x, y, z = M[2, 1] - M[1, 2], M[0, 2] - M[2, 0], M[1, 0] - M[0, 1]
    sine = 0.5 * math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(sine, 0.5 * (M[0, 0] + M[1, 1] + M[2, 2] - 1.0))
    scale = _ROTATION_M * (0.5 * angle / sine if sine > 1e-9 else 0.5)
    error[:3] = p_BT - p
    error[3], error[4], error[5] = scale * x, scale * y, scale * z
