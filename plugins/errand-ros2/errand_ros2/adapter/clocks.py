"""Clocks of a robot of ROS 2: the wall's, or that of `/clock` where a simulator publishes it."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from threading import Event
from typing import Any

_JUMP_S, _DELAYS_S, _LOOK_S = 0.7, 5.0, 0.02
_GRACE_S = 1.0  # silence of `/clock` (wall clock) after which time goes on without it


class RobotClock:
    """Wall time since the connection; maps stamps of a robot whose clock is ahead or behind.

    The shortest delay of the last seconds counts as none. After a jump of the robot's clock by 0.7 s or more, which
    `jumps` counts, this begins again. `advance` calls `after` after each wait.
    """

    is_heard = True  # whether the clock runs

    def __init__(self) -> None:
        self._began_s, self._due_s = time.monotonic(), 0.0
        self._behind: deque[tuple[float, float]] = deque()
        self._behind_s, self._last_s = 0.0, -math.inf
        self.jumps = 0
        self.after: Callable[[], None] = lambda: None

    def now(self) -> float:
        """Seconds since the connection was made."""
        return time.monotonic() - self._began_s

    def advance(self, dt_s: float) -> None:
        """Waits until dt_s have passed since the last advance; a late program goes on at once."""
        self._due_s = max(self._due_s + dt_s, self.now() - dt_s)
        self._wait_until(self._due_s)
        self.after()

    def _wait_until(self, due_s: float) -> None:
        Event().wait(max(0.0, due_s - self.now()))

    def hear(self, stamp_s: float) -> None:
        """Takes the stamp of a message that has just arrived."""
        now_s = self.now()
        behind_s = now_s - stamp_s
        back, ahead = stamp_s < self._last_s - _JUMP_S, self._behind and behind_s < self._behind_s - _JUMP_S
        if back or ahead:
            self.jumps += 1
            self._behind.clear()
        self._last_s = stamp_s if back else max(stamp_s, self._last_s)
        self._behind.append((now_s, behind_s))
        while self._behind[0][0] < now_s - _DELAYS_S and len(self._behind) > 1:
            self._behind.popleft()
        self._behind_s = min(each for _, each in self._behind)

    def ours(self, stamp_s: float) -> float:
        """Returns a stamp on this clock; never later than now."""
        return min(stamp_s + self._behind_s, self.now())

    def theirs(self, time_s: float) -> float:
        """Returns a time of this clock on the robot's."""
        return time_s - self._behind_s


class SimulatedClock(RobotClock):
    """Clock that follows `/clock`, whose stamps it takes as they are; it never goes back, nor stands still for long."""

    def __init__(self) -> None:
        super().__init__()
        self._told = threading.Condition()
        self._stamp_s, self._heard_s, self._base_s = 0.0, math.inf, 0.0
        self.is_heard = False

    def hear_clock(self, message: Any) -> None:
        """Takes rosgraph_msgs/Clock."""
        stamp_s = message.clock.sec + 1e-9 * message.clock.nanosec
        with self._told:
            now_s = self.now()
            if stamp_s < self._stamp_s - _JUMP_S:
                self.jumps += 1
                self._base_s = now_s - stamp_s
            self._behind_s = max(self._base_s, now_s - stamp_s)
            self._stamp_s, self._heard_s, self.is_heard = stamp_s, time.monotonic(), True
            self._told.notify_all()

    def now(self) -> float:
        """Time of `/clock`."""
        with self._told:
            silent_s = time.monotonic() - self._heard_s if self.is_heard else 0.0
            return self._stamp_s + self._behind_s + max(0.0, silent_s - _GRACE_S)

    def _wait_until(self, due_s: float) -> None:
        with self._told:
            while self.is_heard and self.now() < due_s - 1e-6:
                self._told.wait(_LOOK_S)

    def hear(self, stamp_s: float) -> None:
        """Does nothing: stamps are those of `/clock`."""
