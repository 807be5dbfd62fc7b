"""A trot: diagonal pairs of feet swing in turn, and the others stay where they are on the floor.

Footholds follow Raibert's rule (Legged Robots That Balance, 1986): a foot lands where the hip will be in the middle
of its next stance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from plant.models.spot.description import LEGS
from plant.snapshot.values import State, array_of
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


class Trot:
    """Where the four feet shall be, step by step. Feet are ordered as `LEGS`."""

    def __init__(self, nominal_B: FloatArray, parameters: TrotParameters | None = None) -> None:
        """`nominal_B`: (4, 2) resting places of the feet in the body frame."""
        self._nominal_B = nominal_B
        self._parameters = parameters or TrotParameters()
        self._feet_W = np.zeros((len(LEGS), 3))
        self._lift_W = np.zeros((len(LEGS), 3))
        self._swinging: int | None = None
        self._next_pair = 0
        self._progress_s = 0.0

    def reset(self, motion: BodyMotion) -> None:
        """Put all feet to rest under a body at this pose."""
        self._feet_W = self._places(motion, 0.0, 0.0)
        self._swinging = None
        self._progress_s = 0.0

    @property
    def stance(self) -> tuple[bool, ...]:
        """For each foot whether it stands on the floor."""
        lifted = _PAIRS[self._swinging] if self._swinging is not None else ()
        return tuple(foot not in lifted for foot in range(len(LEGS)))

    def step(self, motion: BodyMotion, dt_s: float) -> FloatArray:
        """Advance by dt_s; returns the feet's centres in the world frame, (4, 3)."""
        if self._swinging is None:
            self._maybe_lift(motion)
        if self._swinging is not None:
            self._swing(motion, dt_s)
        return self._feet_W.copy()

    def state(self) -> State:
        """Where the feet are in their gait."""
        gait = {"swinging": self._swinging, "next_pair": self._next_pair, "progress_s": self._progress_s}
        return {"feet_W": self._feet_W.tolist(), "lift_W": self._lift_W.tolist(), **gait}

    def restore(self, state: State) -> None:
        """Go on from such a state."""
        self._feet_W, self._lift_W = array_of(state["feet_W"]), array_of(state["lift_W"])
        self._swinging, self._next_pair = state["swinging"], state["next_pair"]
        self._progress_s = state["progress_s"]

    def _maybe_lift(self, motion: BodyMotion) -> None:
        moving = math.hypot(motion.vx, motion.vy) > 0.02 or abs(motion.wz) > 0.05
        if not moving:
            offsets = self._feet_W - self._places(motion, 0.0, 0.0)
            worst = [max(math.hypot(*offsets[foot, :2]) for foot in pair) for pair in _PAIRS]
            if max(worst) < self._parameters.rest_tolerance_m:
                return
            self._next_pair = int(np.argmax(worst))
        self._swinging = self._next_pair
        self._next_pair = 1 - self._next_pair
        self._progress_s = 0.0
        self._lift_W = self._feet_W.copy()

    def _swing(self, motion: BodyMotion, dt_s: float) -> None:
        assert self._swinging is not None
        p = self._parameters
        self._progress_s += dt_s
        share = min(1.0, self._progress_s / p.swing_s)
        landing = self._places(motion, p.swing_s - min(self._progress_s, p.swing_s), p.swing_s / 2)
        blend = share * share * (3 - 2 * share)
        for foot in _PAIRS[self._swinging]:
            self._feet_W[foot] = (1 - blend) * self._lift_W[foot] + blend * landing[foot]
            self._feet_W[foot, 2] = p.foot_radius_m + p.swing_height_m * math.sin(math.pi * share)
        if share >= 1.0:
            self._swinging = None

    def _places(self, motion: BodyMotion, until_landing_s: float, half_stance_s: float) -> FloatArray:
        """Resting places under the body as it will be in the middle of the next stance, (4, 3)."""
        x, y, yaw = motion.ahead(until_landing_s + half_stance_s)
        c, s = math.cos(yaw), math.sin(yaw)
        turned_to_W = np.array([[c, s, 0.0], [-s, c, 0.0]])
        places: FloatArray = self._nominal_B @ turned_to_W + (x, y, self._parameters.foot_radius_m)
        return places
