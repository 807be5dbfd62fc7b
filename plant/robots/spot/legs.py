"""Spot's legs: the trot plans the feet; leg kinematics and servos move them there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from plant.robots.spot.description import LEGS, spot_facts
from plant.robots.spot.model import JointIndex
from plant.saved_state import Stateful
from skills.robot import FloatArray

_SIDES = {"fl": (1.0, 1.0), "fr": (1.0, -1.0), "hl": (-1.0, 1.0), "hr": (-1.0, -1.0)}


class UnreachableFootError(ValueError):
    """Error of a foot target outside the reach of its leg."""


def nominal_footholds() -> FloatArray:
    """Resting positions (4, 2) of the feet in the body frame, ordered as LEGS."""
    facts = spot_facts()["legs"]
    x = facts["hip"]["offset"][0]
    y = facts["hip"]["offset"][1] + facts["upper_leg"]["offset"][1]
    return np.array([[sx * x, sy * y] for sx, sy in (_SIDES[leg] for leg in LEGS)], dtype=np.float64)


@dataclass(frozen=True)
class LegKinematics:
    """Geometry of one leg: `p_BHip` is the hip-x joint, `side_m` the signed offset to hip y; the rest link vectors."""

    p_BHip: tuple[float, float, float]
    side_m: float
    thigh_x_m: float
    thigh_z_m: float
    shin_m: float

    @staticmethod
    def from_facts(leg: str) -> LegKinematics:
        """Builds the kinematics of the leg fl, fr, hl or hr."""
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

    def joints(self, p_BFoot: Sequence[float]) -> tuple[float, float, float]:
        """Joint angles (hip x, hip y, knee; rad) for a foot position, with the knee bent backwards.

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
        return math.remainder(hx, 2 * math.pi), hy, kn


_MAX_LEG_RATE_RAD_S = 20.0


class LegServos(Stateful, saved=("_last",)):
    """Servos of the legs: joint set points for the feet that the gait plans."""

    def __init__(self, index: JointIndex, rest_rad: FloatArray) -> None:
        """`rest_rad` (4, 3) are the joint angles at the start."""
        self._lower, self._upper = index.lower[index.legs], index.upper[index.legs]
        self._kinematics = [LegKinematics.from_facts(leg) for leg in LEGS]
        self.rest_rad = rest_rad.copy()
        self._last = rest_rad.copy()

    def set_points(self, feet_B: Sequence[Sequence[float]], dt_s: float) -> tuple[FloatArray, FloatArray]:
        """Positions and velocities (4, 3) of the leg joints for feet at (x, y, z) in the body frame.

        The leg of a foot out of reach does not move.
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


_PAIRS = ((0, 3), (1, 2))  # indices into LEGS: fl with hr, fr with hl
_SWING_S = 0.28
_SWING_HEIGHT_M = 0.07
_REST_TOLERANCE_M = 0.025
"""Largest distance of a standing foot from its foothold."""
_FOOT_RADIUS_M = 0.036


@dataclass(frozen=True)
class BodyMotion:
    """Planar pose of the body in the world and its commanded velocity in the body frame (m/s, m/s, rad/s)."""

    x_m: float
    y_m: float
    yaw_rad: float
    vx: float
    vy: float
    wz: float

    def ahead(self, dt_s: float) -> tuple[float, float, float]:
        """Pose (x, y, yaw) after dt_s at constant velocity."""
        yaw = self.yaw_rad + self.wz * dt_s
        middle = self.yaw_rad + self.wz * dt_s / 2
        c, s = math.cos(middle), math.sin(middle)
        return self.x_m + (c * self.vx - s * self.vy) * dt_s, self.y_m + (s * self.vx + c * self.vy) * dt_s, yaw


class Trot(Stateful, saved=("_feet_W", "_lift_W", "_swinging", "_next_pair", "_progress_s")):
    """Trot: plans the positions of the four feet, step by step. Feet are ordered as `LEGS`.

    Diagonal pairs of feet swing in turn, while the others stand on the floor. Footholds follow Raibert's rule (Legged
    Robots That Balance, 1986): a foot lands below the hip's position in the middle of its next stance.
    """

    def __init__(self, nominal_B: FloatArray) -> None:
        """`nominal_B` are the resting positions (4, 2) of the feet in the body frame."""
        self._nominal_B: list[list[float]] = nominal_B.tolist()
        self._feet_W = [[0.0, 0.0, 0.0] for _ in LEGS]
        self._lift_W = [[0.0, 0.0, 0.0] for _ in LEGS]
        self._swinging: int | None = None
        self._next_pair = 0
        self._progress_s = 0.0

    def reset(self, motion: BodyMotion) -> None:
        """Sets all feet to rest below a body at a pose."""
        self._feet_W = [[*self._place(foot, motion, 0.0), _FOOT_RADIUS_M] for foot in range(len(LEGS))]
        self._swinging = None
        self._progress_s = 0.0

    def step(self, motion: BodyMotion, dt_s: float) -> Sequence[Sequence[float]]:
        """Advances by dt_s; returns the centres (x, y, z) of the feet in the world, valid until the next step."""
        if self._swinging is None:
            self._maybe_lift(motion)
        if self._swinging is not None:
            self._swing(motion, dt_s)
        return self._feet_W

    def _maybe_lift(self, motion: BodyMotion) -> None:
        moving = math.hypot(motion.vx, motion.vy) > 0.02 or abs(motion.wz) > 0.05
        if not moving:
            worst = [max(self._off_place_m(foot, motion) for foot in pair) for pair in _PAIRS]
            if max(worst) < _REST_TOLERANCE_M:
                return
            self._next_pair = worst.index(max(worst))
        self._swinging = self._next_pair
        self._next_pair = 1 - self._next_pair
        self._progress_s = 0.0
        self._lift_W = [list(foot) for foot in self._feet_W]

    def _swing(self, motion: BodyMotion, dt_s: float) -> None:
        assert self._swinging is not None
        self._progress_s += dt_s
        share = min(1.0, self._progress_s / _SWING_S)
        ahead_s = _SWING_S - min(self._progress_s, _SWING_S) + _SWING_S / 2  # the middle of the next stance
        blend = share * share * (3 - 2 * share)
        height_m = _FOOT_RADIUS_M + _SWING_HEIGHT_M * math.sin(math.pi * share)
        for foot in _PAIRS[self._swinging]:
            (x, y), (lift_x, lift_y, _) = self._place(foot, motion, ahead_s), self._lift_W[foot]
            self._feet_W[foot] = [(1 - blend) * lift_x + blend * x, (1 - blend) * lift_y + blend * y, height_m]
        if share >= 1.0:
            self._swinging = None

    def _place(self, foot: int, motion: BodyMotion, ahead_s: float) -> tuple[float, float]:
        """Resting position (x, y) of a foot below the body's pose after ahead_s."""
        x, y, yaw = motion.ahead(ahead_s)
        c, s = math.cos(yaw), math.sin(yaw)
        forward, left = self._nominal_B[foot]
        return x + c * forward - s * left, y + s * forward + c * left

    def _off_place_m(self, foot: int, motion: BodyMotion) -> float:
        (x, y), (foot_x, foot_y, _) = self._place(foot, motion, 0.0), self._feet_W[foot]
        return math.hypot(foot_x - x, foot_y - y)
