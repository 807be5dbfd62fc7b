"""A battery that runs down: by its full load in `runtime_s`, slower when the robot rests; on a dock it charges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from plant.sensors.noisy import NoisySensor
from skills.robot import Battery


@dataclass(frozen=True)
class BatterySpec:
    """`runtime_s` from full to empty at load 1; at load 0 it draws `idle_share` of that; the gauge errs by `sigma`.

    On a dock it goes from empty to full in `charge_s`: a quick dock, so that missions need not wait for an hour.
    """

    runtime_s: float = 5400.0
    idle_share: float = 0.4
    sigma: float = 0.001
    charge_s: float = 300.0


class BatteryModel(NoisySensor):
    """The battery of one robot."""

    kept = ("charge", "stamp_s")

    def __init__(self, rng: np.random.Generator, charge: float = 1.0, spec: BatterySpec | None = None) -> None:
        """Start with a charge from 0 to 1. Raises ValueError for another."""
        if not 0.0 <= charge <= 1.0:
            raise ValueError(f"battery charge must be from 0 to 1, not {charge}")
        super().__init__(rng)
        self._spec, self._charge = spec or BatterySpec(), charge
        self._stamp_s: float | None = None

    def update(self, stamp_s: float, load: float, *, docked: bool = False) -> Battery:
        """Reading at stamp_s after a load from 0 (standing) to 1 (walking), or on a dock, since the last update."""
        elapsed = 0.0 if self._stamp_s is None else max(0.0, stamp_s - self._stamp_s)
        self._stamp_s = stamp_s
        if docked:
            self._charge = min(1.0, self._charge + elapsed / self._spec.charge_s)
        else:
            self._charge = discharged(self._charge, elapsed, load, self._spec)
        read = self._charge + float(self._rng.normal(0.0, self._spec.sigma))
        return Battery(stamp_s, min(max(round(read, 3), 0.0), 1.0))


def discharged(charge: float, elapsed_s: float, load: float, spec: BatterySpec) -> float:
    """The charge left after elapsed_s at a load (cut to 0..1)."""
    share = spec.idle_share + (1.0 - spec.idle_share) * min(max(load, 0.0), 1.0)
    return max(0.0, charge - elapsed_s * share / spec.runtime_s)
