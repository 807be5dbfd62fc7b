"""The charge skill: stands on the dock until the battery is charged."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, Failed, Part, Running, Skill, Step, Succeeded
from skills.quantities import Duration, Share


@dataclass(frozen=True)
class ChargeInputs:
    """State of charge (0 to 1) to wait for."""

    level: Share = 0.8


@dataclass(frozen=True)
class ChargeOptions:
    """Limits on which a battery counts as not charging: it has not gained `least_gain` (a share) within `no_gain_s`."""

    no_gain_s: Duration = 30.0
    least_gain: Share = 0.005


class Charge(Skill[ChargeInputs]):
    """Waits on the dock until the battery is charged, and checks that the charge rises. Moves nothing."""

    name: ClassVar[str] = "charge"
    Inputs: ClassVar[type] = ChargeInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    Options: ClassVar[type] = ChargeOptions
    options: ChargeOptions
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "the level is not from 0 to 1",
        Cause.POSTCONDITION: "the charge does not rise: the robot does not stand on its dock, or the dock is dead",
    }
    default_timeout_s: ClassVar[float] = 7200.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"battery": 10.0}

    def begin(self, inputs: ChargeInputs) -> None:
        """Forgets an earlier attempt."""
        self._level = inputs.level
        self._begun_at = self._best = self.context.robot.battery().charge
        self._best_s = self.context.clock.now()

    def step(self) -> Step:
        """Checks the battery."""
        if not 0.0 <= self._level <= 1.0:
            return Failed(Cause.PRECONDITION, f"a charge is from 0 to 1, not {self._level:g}")
        charge, now_s = self.context.robot.battery().charge, self.context.clock.now()
        if charge >= self._level:
            return Succeeded(f"the battery is at {charge:.0%}")
        if charge > self._best + self.options.least_gain:
            self._best, self._best_s = charge, now_s
        if now_s - self._best_s > self.options.no_gain_s:
            return Failed(Cause.POSTCONDITION, f"the battery does not charge here; it stays at {charge:.0%}")
        done = (charge - self._begun_at) / max(self._level - self._begun_at, 1e-6)
        return Running(f"charging, {charge:.0%} of {self._level:.0%}", min(1.0, max(0.0, done)))
