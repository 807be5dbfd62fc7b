"""Trouble of a robot that lasts for seconds: a refused command, a camera without pictures. It is waited out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from skills.robot import Clock

PATIENCE_S: Final = 6.5
"""Trouble that lasts no longer than this (s) ends no skill."""


@dataclass
class Patience:
    """How long some trouble has lasted; one that is over begins anew."""

    clock: Clock
    lasts_s: float = PATIENCE_S
    _since_s: float | None = field(default=None, init=False)

    def is_left(self) -> bool:
        """Note that there is trouble now; whether it may still pass."""
        now_s = self.clock.now()
        self._since_s = now_s if self._since_s is None else self._since_s
        return now_s - self._since_s <= self.lasts_s

    def over(self) -> None:
        """Note that there is none now."""
        self._since_s = None
