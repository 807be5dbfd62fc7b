"""How a run ends that something stops: what that means for its missions, and a log that does not stand in the way."""

from __future__ import annotations

import traceback
from collections.abc import Mapping
from typing import Any, Final

from executive.run.outcome import Outcome
from executive.run.tree_run import Ending
from executive.run.watchdog import VerbHung
from executive.tree.behaviours.skill_leaf import ERROR_TOPIC
from skills.api import Cause, Publish
from skills.robot import LeaseError

__all__ = ["CancelledError", "LastingLog", "TimeOverError", "ending_of"]


class CancelledError(Exception):
    """Somebody cancelled the run."""


class TimeOverError(Exception):
    """The run's time limit has passed."""


class LastingLog:
    """The log as the parts of a run see it: while a run is ending, a broken log keeps no robot from being stopped."""

    def __init__(self, publish: Publish) -> None:
        self._publish = publish
        self.ending = False

    def __call__(self, topic: str, message: Mapping[str, Any]) -> None:
        """Log a message. Raises what the log raises, but not while the run is ending."""
        try:
            self._publish(topic, message)
        except Exception:
            if not self.ending:
                raise


def ending_of(stop: BaseException, publish: Publish) -> Ending:
    """The end of a mission that an exception stopped; the trace of a defect is logged."""
    for kind, (outcome, cause, sentence) in _ENDINGS.items():
        if isinstance(stop, kind):
            return Ending(outcome, cause, str(stop) or sentence)
    trace = "".join(traceback.format_exception(stop))
    publish(ERROR_TOPIC, {"node": "runner", "traceback": trace})
    return Ending(Outcome.ERROR, Cause.ERROR, f"{type(stop).__name__}: {stop}")


_ENDINGS: Final[dict[type[BaseException], tuple[Outcome, Cause, str]]] = {
    CancelledError: (Outcome.CANCELLED, Cause.CANCELLED, "cancelled"),
    KeyboardInterrupt: (Outcome.CANCELLED, Cause.CANCELLED, "cancelled from the keyboard"),
    TimeOverError: (Outcome.FAILURE, Cause.TIMEOUT, "time over"),
    LeaseError: (Outcome.FAILURE, Cause.PRECONDITION, "the lease is held by another"),
    VerbHung: (Outcome.ERROR, Cause.ERROR, "a verb hung"),
}
