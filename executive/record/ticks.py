"""How long the ticks took on the wall's clock, and which overran; logged under a topic of their own."""

from __future__ import annotations

import math

from executive.record.schemas import WALL
from skills.api import Publish
from skills.robot import Clock

REPORT_PERIOD_S = 1.0


class TickMeter:
    """Gathers tick durations and logs them once a second of the robot's clock.

    Wall times differ from run to run: they stand under the topic `wall`, which comparisons of logs leave out.
    """

    def __init__(self, publish: Publish, clock: Clock, *, limit_s: float) -> None:
        """`limit_s`: a tick that took longer on the wall's clock has overrun."""
        self._publish, self._clock, self._limit_s = publish, clock, limit_s
        self._durations_s: list[float] = []
        self._reported_s = -math.inf
        self.overruns = 0

    def __call__(self, duration_s: float) -> None:
        """A tick has taken so long."""
        self._durations_s.append(duration_s)
        self.overruns += duration_s > self._limit_s
        if self._clock.now() - self._reported_s >= REPORT_PERIOD_S:
            self._report({})

    def close(self, wall_time_s: float) -> None:
        """Log what is left, with the wall time of the whole run."""
        self._report({"wall_time_s": wall_time_s})

    def _report(self, more: dict[str, float]) -> None:
        self._reported_s = self._clock.now()
        ticks = [round(duration_s, 6) for duration_s in self._durations_s]
        self._durations_s = []
        self._publish(WALL, {"tick_s": ticks, "limit_s": self._limit_s, "overruns": self.overruns, **more})
