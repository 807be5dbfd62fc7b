"""The skill that clears the seen layer of the costmap and lets the sensors fill it anew."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, Failed, ForgettingCostmap, Part, Running, Skill, Step, Succeeded
from skills.quantities import Delay


@dataclass(frozen=True)
class ClearCostmapInputs:
    """How long (s) to sense again before success; two scans must agree on an obstacle."""

    look_s: Delay = 1.0


class ClearCostmap(Skill[ClearCostmapInputs]):
    """Clears the obstacle layer of the costmap and waits until the sensors have filled it again."""

    name: ClassVar[str] = "clear_costmap"
    Inputs: ClassVar[type] = ClearCostmapInputs
    uses: ClassVar[frozenset[Part]] = frozenset()
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "this robot's costmap has no layer that can be cleared"
    }
    default_timeout_s: ClassVar[float] = 10.0

    def begin(self, inputs: ClearCostmapInputs) -> None:
        """Starts anew."""
        self._inputs = inputs
        self._cleared: int | None = None
        self._end_s = 0.0

    def step(self) -> Step:
        """Clears at the first step, then look."""
        costmap, now_s = self.context.costmap, self.context.clock.now()
        if self._cleared is None:
            if not isinstance(costmap, ForgettingCostmap):
                return Failed(Cause.PRECONDITION, "the costmap of this robot cannot forget what was seen")
            self._cleared = costmap.forget_seen()
            self._end_s = now_s + self._inputs.look_s
        if now_s < self._end_s:
            return Running("looking anew at what stands around")
        return Succeeded(f"{self._cleared} blocked cells were forgotten, and what stands there was seen anew")
