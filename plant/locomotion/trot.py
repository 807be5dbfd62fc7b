"""A trot: diagonal pairs of feet swing in turn, and the others stay where they are on the floor.

Footholds follow Raibert's rule (Legged Robots That Balance, 1986): a foot lands where the hip will be in the middle
of its next stance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from plant.kept import Kept
from plant.models.spot.description import LEGS
from skills.robot import FloatArray

_PAIRS = ((0, 3), (1, 2))  # indices into LEGS: fl with hr, fr with hl


@dataclass(frozen=True)
class TrotParameters:
    """Shape of the trot: how long a pair swings, how high, and how far off its place a foot may rest."""

    swing_s: float = 0.28
    swing_height_m: float = 0.07
    rest_tolerance_m: float = 0.025
    foot_radius_m: float = 0.036


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
        """Pose (x, y, yaw) after dt_s at this velocity."""
        yaw = self.yaw_rad + self.wz * dt_s
        middle = self.yaw_rad + self.wz * dt_s / 2
        c, s = math.cos(middle), math.sin(middle)
        return self.x_m + (c * self.vx - s * self.vy) * dt_s, self.y_m + (s * self.vx + c * self.vy) * dt_s, yaw


class Trot(Kept, keeps=("_feet_W", "_lift_W", "_swinging", "_next_pair", "_progress_s")):
    """Where the four feet shall be, step by step. Feet are ordered as `LEGS`."""

    def __init__(self, nominal_B: FloatArray, parameters: TrotParameters | None = None) -> None:
        """`nominal_B`: (4, 2) resting places of the feet in the body frame."""
        self._nominal_B: list[list[float]] = nominal_B.tolist()
        self._parameters = parameters or TrotParameters()
        self._feet_W = [[0.0, 0.0, 0.0] for _ in LEGS]
        self._lift_W = [[0.0, 0.0, 0.0] for _ in LEGS]
        self._swinging: int | None = None
        self._next_pair = 0
        self._progress_s = 0.0

    def reset(self, motion: BodyMotion) -> None:
        """Put all feet to rest under a body at this pose."""
        self._feet_W = [[*self._place(foot, motion, 0.0), self._parameters.foot_radius_m] for foot in range(len(LEGS))]
        self._swinging = None
        self._progress_s = 0.0

    @property
    def stance(self) -> tuple[bool, ...]:
        """For each foot whether it stands on the floor."""
        lifted = _PAIRS[self._swinging] if self._swinging is not None else ()
        return tuple(foot not in lifted for foot in range(len(LEGS)))

    def step(self, motion: BodyMotion, dt_s: float) -> Sequence[Sequence[float]]:
        """Advance by dt_s; returns the feet's centres (x, y, z) in the world frame, to be read before the next step."""
        if self._swinging is None:
            self._maybe_lift(motion)
        if self._swinging is not None:
            self._swing(motion, dt_s)
        return self._feet_W

    def _maybe_lift(self, motion: BodyMotion) -> None:
        moving = math.hypot(motion.vx, motion.vy) > 0.02 or abs(motion.wz) > 0.05
        if not moving:
            worst = [max(self._off_place_m(foot, motion) for foot in pair) for pair in _PAIRS]
            if max(worst) < self._parameters.rest_tolerance_m:
                return
            self._next_pair = worst.index(max(worst))
        self._swinging = self._next_pair
        self._next_pair = 1 - self._next_pair
        self._progress_s = 0.0
        self._lift_W = _copied(self._feet_W)

    def _swing(self, motion: BodyMotion, dt_s: float) -> None:
        assert self._swinging is not None
        p = self._parameters
        self._progress_s += dt_s
        share = min(1.0, self._progress_s / p.swing_s)
        ahead_s = p.swing_s - min(self._progress_s, p.swing_s) + p.swing_s / 2  # the middle of the next stance
        blend = share * share * (3 - 2 * share)
        height_m = p.foot_radius_m + p.swing_height_m * math.sin(math.pi * share)
        for foot in _PAIRS[self._swinging]:
            (x, y), (lift_x, lift_y, _) = self._place(foot, motion, ahead_s), self._lift_W[foot]
            self._feet_W[foot] = [(1 - blend) * lift_x + blend * x, (1 - blend) * lift_y + blend * y, height_m]
        if share >= 1.0:
            self._swinging = None

    def _place(self, foot: int, motion: BodyMotion, ahead_s: float) -> tuple[float, float]:
        """Resting place (x, y) of a foot under the body as it will be so much later."""
        x, y, yaw = motion.ahead(ahead_s)
        c, s = math.cos(yaw), math.sin(yaw)
        forward, left = self._nominal_B[foot]
        return x + c * forward - s * left, y + s * forward + c * left

    def _off_place_m(self, foot: int, motion: BodyMotion) -> float:
        (x, y), (foot_x, foot_y, _) = self._place(foot, motion, 0.0), self._feet_W[foot]
        return math.hypot(foot_x - x, foot_y - y)


def _copied(rows: Sequence[Sequence[float]]) -> list[list[float]]:
    return [list(row) for row in rows]
