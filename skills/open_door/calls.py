"""Calls of the plug-ins that open doors."""

import math
from collections.abc import Sequence
from typing import Final

from skills.api import Job, SkillContext
from skills.perception.doorway import DoorOpener, Doorway

_LATENCY_S: Final = 0.5


class DoorCalls:
    """Calls of the plug-ins of closed doors, one for each door; a door opens within `opens_s` of the answer, or not."""

    def __init__(self, context: SkillContext, opens_s: float) -> None:
        self._context, self._opens_s = context, opens_s
        self._calls: dict[Doorway, Job[str | None]] = {}
        self._until_s: dict[Doorway, float] = {}

    def may_open(self, doors: Sequence[Doorway]) -> bool:
        """Calls the plug-ins of `doors` that were not called yet; returns whether one of these doors may still open."""
        for door in doors:
            if door.opener is not None and door not in self._calls:
                self._calls[door] = self._call(door, door.opener)
        open_yet = [self._may_open(door) for door in doors if door in self._calls]
        return any(open_yet)

    def reasons(self, doors: Sequence[Doorway]) -> str:
        """Sentences on why the called ones of `doors` stay closed; empty without a call."""
        return " ".join(self._reason(door, call) for door, call in self._calls.items() if door in doors)

    def _call(self, door: Doorway, opener: DoorOpener) -> Job[str | None]:
        def call() -> str | None:
            try:
                opener.open(_name(door), door.between)
            except Exception as error:
                return str(error) or type(error).__name__
            return None

        return self._context.worker.submit(call, latency_s=_LATENCY_S, name="open a door")

    def _may_open(self, door: Doorway) -> bool:
        call = self._calls[door]
        if not call.done():
            return True
        end_s = self._context.clock.now() + self._opens_s if call.result() is None else -math.inf
        return self._context.clock.now() < self._until_s.setdefault(door, end_s)

    def _reason(self, door: Doorway, call: Job[str | None]) -> str:
        failure = call.result() if call.done() else "there is no answer yet"
        if failure is None:
            return f"The {_name(door)} was called, and did not open within {self._opens_s:g} s."
        return f"The call of the {_name(door)} failed: {failure}."


def _name(door: Doorway) -> str:
    return f"door between {door.between[0]} and {door.between[1]}"
