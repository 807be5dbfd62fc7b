"""Conditions for guards."""

from __future__ import annotations

from executive.behaviours.context import RunContext
from skills.api import Cause, Failed


class Holding:
    """The gripper holds something. A loss shorter than `patience_s` on the robot's clock is let pass.

    PRECONDITION when nothing is held at the start, EXECUTION when it is lost on the way.
    """

    def __init__(self, thing: str, patience_s: float = 0.5) -> None:
        self._thing, self._patience_s = thing, patience_s
        self._last_held_s: float | None = None

    def begin(self, context: RunContext) -> None:
        """Forget what was held before."""
        self._last_held_s = None

    def violated(self, context: RunContext) -> Failed | None:
        """A failure when the gripper has been empty for longer than the patience."""
        now = context.clock.now()
        if context.robot.gripper().holding:
            self._last_held_s = now
            return None
        if self._last_held_s is None:
            return Failed(Cause.PRECONDITION, f"there is no {self._thing} in the gripper")
        if now - self._last_held_s <= self._patience_s:
            return None
        return Failed(Cause.EXECUTION, f"the {self._thing} was lost on the way")
