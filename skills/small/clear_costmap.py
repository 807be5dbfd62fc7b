"""The skill that clears the obstacle layer of the costmap, which the sensors then fill again."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, ClearableCostmap, Failed, Part, Running, Skill, Step, Succeeded
from skills.quantities import Delay


@dataclass(frozen=True)
class ClearCostmapInputs:
    """Time (s) to sense again before success; the costmap needs two scans to confirm an obstacle."""

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
        """Resets the state of an earlier attempt."""
        self._inputs = inputs
        self._cleared: int | None = None
        self._end_s = 0.0

    def step(self) -> Step:
        """Clears at the first step, then waits."""
        costmap, now_s = self.context.costmap, self.context.clock.now()
        if self._cleared is None:
            if not isinstance(costmap, ClearableCostmap):
                return Failed(Cause.PRECONDITION, "the costmap of this robot has no obstacle layer that can be cleared")
            self._cleared = costmap.clear_obstacles()
            self._end_s = now_s + self._inputs.look_s
        if now_s < self._end_s:
            return Running("looking again at the surroundings")
        return Succeeded(f"cleared {self._cleared} blocked cells and looked again")
