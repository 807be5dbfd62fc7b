"""What all sensors share: noise from a generator of their own, which is kept with what they add to it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from plant.kept import Kept


class NoisySensor(Kept, keeps=("noise",)):
    """A sensor of one robot."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    @property
    def noise(self) -> Mapping[str, Any]:
        """The state of the generator."""
        return self._rng.bit_generator.state

    @noise.setter
    def noise(self, state: Mapping[str, Any]) -> None:
        self._rng.bit_generator.state = state
