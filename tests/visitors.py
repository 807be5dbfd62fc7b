"""Visitors of a run that call a function."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from executive.run.visitor import Progress, RunVisitor
from skills.api import Publish


@dataclass(frozen=True)
class OnTick(RunVisitor):
    """Calls a function after each tick."""

    call: Callable[[Progress], object]

    def tick(self, progress: Progress) -> None:
        self.call(progress)


@dataclass(frozen=True)
class OnMessage(RunVisitor):
    """Calls a function with each message."""

    call: Publish | Callable[[str, Mapping[str, Any]], object]

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        self.call(topic, message)
        return message
