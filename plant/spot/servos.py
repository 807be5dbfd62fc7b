"""Set points of the servos of Spot's legs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from plant.kept import Kept
from plant.models.spot.description import LEGS, spot_facts
from plant.spot.model import JointIndex
from skills.robot import FloatArray

_SIDES = {"fl": (1.0, 1.0), "fr": (1.0, -1.0), "hl": (-1.0, 1.0), "hr": (-1.0, -1.0)}


class UnreachableFootError(ValueError):
    """The foot's target lies outside the leg's reach."""


@dataclass(frozen=True)
class LegKinematics:
    """Geometry of one leg: `p_BHip` is the hip-x joint, `side_m` the signed offset to hip y, the rest link vectors."""

    p_BHip: tuple[float, float, float]
    side_m: float
    thigh_x_m: float
    thigh_z_m: float
    shin_m: float

    @staticmethod
    def of(leg: str) -> LegKinematics:
        """The leg named fl, fr, hl or hr."""
        facts = spot_facts()["legs"]
        x, y = _SIDES[leg]
        hip = facts["hip"]["offset"]
        thigh = facts["lower_leg"]["offset"]
        return LegKinematics(
            p_BHip=(x * hip[0], y * hip[1], hip[2]),
            side_m=y * facts["upper_leg"]["offset"][1],
            thigh_x_m=thigh[0],
            thigh_z_m=-thigh[2],
            shin_m=-facts["foot"]["xyz"][2],
        )

    @cached_property
    def _thigh(self) -> tuple[float, float]:
        """Length of the thigh (m) and its angle to the link's vertical (rad)."""
        return math.hypot(self.thigh_x_m, self.thigh_z_m), math.atan2(self.thigh_x_m, self.thigh_z_m)

    def foot(self, hx_rad: float, hy_rad: float, kn_rad: float) -> FloatArray:
        """p_BFoot, the foot's centre in the body frame, shape (3,)."""
        shin_x, shin_z = -self.shin_m * math.sin(kn_rad), -self.shin_m * math.cos(kn_rad)
        u_x, u_z = self.thigh_x_m + shin_x, -self.thigh_z_m + shin_z
        x = u_x * math.cos(hy_rad) + u_z * math.sin(hy_rad)
        z = -u_x * math.sin(hy_rad) + u_z * math.cos(hy_rad)
        y = self.side_m
        c, s = math.cos(hx_rad), math.sin(hx_rad)
        return np.array([x, c * y - s * z, s * y + c * z]) + self.p_BHip

    def joints(self, p_BFoot: Sequence[float]) -> tuple[float, float, float]:
        """Joint angles (hip x, hip y, knee; rad) that put the foot there, knee bent backwards.

        Raises UnreachableFootError when the foot would lie beyond the stretched leg or inside its smallest fold.
        """
        x, y, z = p_BFoot[0] - self.p_BHip[0], p_BFoot[1] - self.p_BHip[1], p_BFoot[2] - self.p_BHip[2]
        drop_squared = y * y + z * z - self.side_m**2
        if drop_squared <= 0.0:
            raise UnreachableFootError(f"foot at {p_BFoot} lies beside the hip")
        drop = -math.sqrt(drop_squared)
        hx = math.atan2(z, y) - math.atan2(drop, self.side_m)
        thigh, bend = self._thigh
        cosine = (x * x + drop_squared - thigh**2 - self.shin_m**2) / (2 * thigh * self.shin_m)
        if abs(cosine) > 1.0:
            raise UnreachableFootError(f"foot at {p_BFoot} is out of the leg's reach")
        kn = -math.acos(cosine) - bend
        u_x = self.thigh_x_m - self.shin_m * math.sin(kn)
        u_z = -self.thigh_z_m - self.shin_m * math.cos(kn)
        hy = math.atan2(u_x, -u_z) - math.atan2(x, -drop)
        return _wrap(hx), hy, kn


def _wrap(angle_rad: float) -> float:
    return math.remainder(angle_rad, 2 * math.pi)


_MAX_LEG_RATE_RAD_S = 20.0


class LegServos(Kept, keeps=("_last",)):
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

    def _solve(self, foot: int, p_BFoot: Sequence[float]) -> tuple[float, float, float]:
        try:
            return self._kinematics[foot].joints(p_BFoot)
        except UnreachableFootError:
            hx, hy, kn = self._last[foot]
            return float(hx), float(hy), float(kn)
