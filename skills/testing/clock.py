"""Clock that only the test advances."""

from __future__ import annotations

from collections.abc import Callable

STEP_S = 0.01


class VirtualClock:
    """Clock that only `advance` moves, in steps of 0.01 s with calls of what is attached; a `skills.robot.Clock`."""

    def __init__(self) -> None:
        self._now_s = 0.0
        self._followers: list[Callable[[float], None]] = []

    def attach(self, follower: Callable[[float], None]) -> None:
        """Calls `follower(dt_s)` after each step of time."""
        self._followers.append(follower)

    def now(self) -> float:
        """Seconds since the start of the clock."""
        return self._now_s

    def advance(self, dt_s: float) -> None:
        """Advances by dt_s seconds, in whole steps of 0.01 s and the remainder."""
        whole, rest = divmod(round(dt_s, 9), STEP_S)
        steps = [STEP_S] * int(whole) + ([rest] if rest > 1e-9 else [])
        for step_s in steps:
            self._now_s = round(self._now_s + step_s, 9)
            for follower in self._followers:
                follower(step_s)
