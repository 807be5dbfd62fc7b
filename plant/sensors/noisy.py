"""What all sensors share: noise from a generator of their own, and a state that can be kept."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from plant.kept import State


class NoisySensor:
    """A sensor of one robot. `kept` names what changes from one reading to the next, beside the noise."""

    kept: ClassVar[tuple[str, ...]] = ()

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def state(self) -> State:
        """What changes from one reading to the next."""
        return {"rng": dict(self._rng.bit_generator.state), **{name: getattr(self, f"_{name}") for name in self.kept}}

    def restore(self, state: State) -> None:
        """Go on from such a state."""
        self._rng.bit_generator.state = state["rng"]
        for name in self.kept:
            setattr(self, f"_{name}", state[name])
