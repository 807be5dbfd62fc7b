"""Patience with trouble that lasts for seconds: a refused command, a camera without pictures."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from skills.robot import Clock

PATIENCE_S: Final = 6.5
"""Duration (s) up to which trouble ends no skill."""


@dataclass
class Patience:
    """Timer of trouble that may pass; starts again after `reset`."""

    clock: Clock
    lasts_s: float = PATIENCE_S
    _since_s: float | None = field(default=None, init=False)

    def is_left(self) -> bool:
        """Notes that there is trouble now; returns whether it may still pass."""
        now_s = self.clock.now()
        self._since_s = now_s if self._since_s is None else self._since_s
        return now_s - self._since_s <= self.lasts_s

    def reset(self) -> None:
        """Notes that there is no trouble now."""
        self._since_s = None
