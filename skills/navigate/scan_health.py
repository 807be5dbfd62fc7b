"""Whether the LiDAR can be relied on: without it a robot that moves is blind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skills.api import ReturnsView, SkillContext
from skills.quantities import Delay, Share
from skills.robot import Scan


@dataclass(frozen=True)
class ScanHealthOptions:
    """A scan may be `old_s` old, and a share of at least `least_valid` of its ranges must be valid.

    One that repeats the last, noise and all, counts as that one.
    """

    old_s: Delay = 0.5
    least_valid: Share = 0.02


class ScanHealth:
    """Looks at the newest scan whenever it is asked. Content where the costmap does not live on LiDAR returns."""

    def __init__(self, context: SkillContext, options: ScanHealthOptions | None = None) -> None:
        self._context, self._options = context, options or ScanHealthOptions()
        self._needed = isinstance(context.costmap, ReturnsView)
        self._last: Scan | None = None

    def trouble(self) -> str | None:
        """What is wrong with the LiDAR, in a sentence; None when nothing is."""
        if not self._needed:
            return None
        scan, now_s = self._context.robot.scan(), self._context.clock.now()
        if scan is None:
            return "The LiDAR gives no scans."
        if scan is not self._last:
            if np.mean(np.isfinite(scan.ranges_m)) < self._options.least_valid:
                return "The LiDAR measures nothing: its ranges are invalid."
            if self._last is None or not scan.repeats(self._last):
                self._last = scan
        age_s = now_s - self._last.stamp_s
        if age_s > self._options.old_s:
            repeated = "repeats its last scan" if scan.stamp_s > self._last.stamp_s else "gives no new scans"
            return f"The LiDAR {repeated}, which is {age_s:.1f} s old."
        return None
