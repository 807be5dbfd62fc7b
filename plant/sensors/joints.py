"""Joint encoders and motor currents: positions, velocities and efforts with noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from plant.sensors.noisy import NoisySensor
from skills.robot import FloatArray, Joints


@dataclass(frozen=True)
class JointNoise:
    """White noise of each reading, and the encoders' constant offsets, drawn once."""

    offset_rad: float = 0.001
    position_rad: float = 0.0003
    velocity_rad_s: float = 0.01
    effort_nm: float = 0.3


class JointModel(NoisySensor):
    """All joint sensors of one robot."""

    def __init__(self, rng: np.random.Generator, names: Sequence[str], noise: JointNoise | None = None) -> None:
        """`names` gives the order of the arrays in `update`."""
        super().__init__(rng)
        self._names, self._noise = tuple(names), noise or JointNoise()
        self._offsets = rng.normal(0.0, self._noise.offset_rad, len(self._names))

    def update(
        self, stamp_s: float, position_rad: FloatArray, velocity_rad_s: FloatArray, effort_nm: FloatArray
    ) -> Joints:
        """Reading at stamp_s from the true arrays (joints,). Raises ValueError when a length is wrong."""
        noise = self._rng.standard_normal((3, len(self._names)))
        read = (
            position_rad + self._offsets + self._noise.position_rad * noise[0],
            velocity_rad_s + self._noise.velocity_rad_s * noise[1],
            effort_nm + self._noise.effort_nm * noise[2],
        )
        position, velocity, effort = (dict(zip(self._names, row.tolist(), strict=True)) for row in read)
        return Joints(stamp_s, position, velocity, effort)
