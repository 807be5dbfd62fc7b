"""What a gripper feels: its opening, clamp force, and whether something is between its fingers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from plant.sensors.noisy import NoisySensor
from skills.robot import Gripper

_TOLERANCE_S = 1e-6


@dataclass(frozen=True)
class GripperNoise:
    """Noise of the readings, and when the robot believes that it holds something; openings are of a hinged gripper.

    It does when the read force is at least `holding_force_n` with the gripper wider than `closed` for
    `holding_after_s` on end; the belief ends as soon as one of both is no longer so for that time.
    """

    opening: float = 0.003
    force_n: float = 0.8
    force_share: float = 0.03
    holding_force_n: float = 4.0
    closed: float = 0.04
    holding_after_s: float = 0.15


class GripperModel(NoisySensor, keeps=("_holding", "_changing_since_s")):
    """The gripper of one robot."""

    def __init__(self, rng: np.random.Generator, noise: GripperNoise | None = None) -> None:
        """Start empty. A share of the force error is systematic and drawn here."""
        super().__init__(rng)
        self._noise = noise or GripperNoise()
        self._force_scale = 1.0 + float(rng.normal(0.0, self._noise.force_share))
        self._holding = False
        self._changing_since_s: float | None = None

    def update(self, stamp_s: float, opening: float, force_n: float) -> Gripper:
        """Reading at stamp_s from the true opening (0 closed) and clamp force at the tip.

        `force_n` is what the gripper presses with, 0 while it moves freely.
        """
        read = opening + float(self._rng.normal(0.0, self._noise.opening))
        force = max(0.0, force_n * self._force_scale + float(self._rng.normal(0.0, self._noise.force_n)))
        gripped = force >= self._noise.holding_force_n and read > self._noise.closed
        self._settle(stamp_s, gripped)
        return Gripper(stamp_s, max(0.0, read), force, self._holding)

    def _settle(self, stamp_s: float, gripped: bool) -> None:
        """Change the belief once the readings have said so for long enough."""
        if gripped == self._holding:
            self._changing_since_s = None
            return
        if self._changing_since_s is None:
            self._changing_since_s = stamp_s
        if stamp_s - self._changing_since_s >= self._noise.holding_after_s - _TOLERANCE_S:
            self._holding, self._changing_since_s = gripped, None
