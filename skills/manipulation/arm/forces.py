"""Forces at the hand, estimated from the efforts of the arm's joints: the mass of a held object, a pull at the hand."""

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from skills.manipulation.arm.kinematics import ArmModel
from skills.robot import FloatArray

_GRAVITY_M_S2 = 9.81
_DAMPING_M = 0.12
"""Damping of the least squares, for a stretched arm, which hardly feels a pull along itself."""


def levers_m(model: ArmModel, q_rad: FloatArray, p_HO: FloatArray) -> FloatArray:
    """Translational Jacobian (3, J) of the point p_HO fixed to the hand, in the body frame (m/rad)."""
    R_BL, p_BL = model.links(q_rad)
    axes_B = np.einsum("jab,jb->ja", R_BL[1:], model.frames[0])
    return np.cross(axes_B, p_BL[-1] + R_BL[-1] @ p_HO - p_BL[1:]).T


def held_mass_kg(model: ArmModel, q_rad: FloatArray, p_HO: FloatArray, extra_nm: FloatArray) -> float:
    """Mass (kg) at p_HO in the hand that best explains the efforts `extra_nm` (J,), by least squares."""
    lever_nm = _GRAVITY_M_S2 * levers_m(model, q_rad, p_HO)[2]
    return float(lever_nm @ extra_nm / (lever_nm @ lever_nm))


def hand_force_n(model: ArmModel, q_rad: FloatArray, p_HO: FloatArray, extra_nm: FloatArray) -> FloatArray:
    """Force (3,) at p_HO on the hand, in the body frame (N), from the joints' additional efforts `extra_nm` (J,)."""
    J = levers_m(model, q_rad, p_HO)
    return np.asarray(-np.linalg.solve(J @ J.T + _DAMPING_M**2 * np.eye(3), J @ extra_nm))


@dataclass
class PullWatch:
    """Detects a pull at the hand: compares the mean of the last measurements with a baseline from the first ones.

    `threshold_n` and `pull_s`: a pull exceeds this force in all measurements for this time. `mean_s` and `baseline_s`:
    spans of the mean and of the baseline. `period_s`: time between measurements of the arm.
    """

    model: ArmModel
    p_HO: FloatArray
    threshold_n: float
    period_s: float = 0.05
    pull_s: float = 0.15
    baseline_s: float = 0.5
    mean_s: float = 0.2
    force_n: float = field(default=0.0, init=False)
    _first: list[FloatArray] = field(default_factory=list, init=False)
    _last: deque[FloatArray] = field(default_factory=deque, init=False)
    _stamp_s: float = field(default=-math.inf, init=False)
    _felt: int = field(default=0, init=False)

    def feels_pull(self, stamp_s: float, q_rad: FloatArray, efforts_nm: FloatArray) -> bool:
        """Updates with a new measurement; returns whether a person pulls."""
        if stamp_s > self._stamp_s:
            self._stamp_s = stamp_s
            self._take(q_rad, efforts_nm)
        return self._felt >= self._readings(self.pull_s)

    def _readings(self, span_s: float) -> int:
        """Number of measurements within a time span, at least one."""
        return max(1, round(span_s / self.period_s))

    def _take(self, q_rad: FloatArray, efforts_nm: FloatArray) -> None:
        if len(self._first) < self._readings(self.baseline_s):
            self._first.append(efforts_nm)
            return
        self._last.append(efforts_nm)
        if len(self._last) > (mean_of := self._readings(self.mean_s)):
            self._last.popleft()
        extra_nm = np.mean(self._last, axis=0) - np.mean(self._first, axis=0)
        self.force_n = float(np.linalg.norm(hand_force_n(self.model, q_rad, self.p_HO, extra_nm)))
        enough = len(self._last) == mean_of and self.force_n > self.threshold_n
        self._felt = self._felt + 1 if enough else 0
