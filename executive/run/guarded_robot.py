"""The robot as a run sees it: every verb under the watchdog, under the lease that counts, its answer checked."""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Callable
from typing import Any, Final

from executive.run.verb_answers import garbage_check
from executive.run.watchdog import IMAGE_LIMIT_S, VERB_LIMIT_S, Watchdog, done_aside, hung
from executive.run.worker import in_lock_step_job
from skills.robot import Lease, LeaseError, Robot


class GarbageError(RuntimeError):
    """A verb of the Robot protocol gave back what the protocol does not allow."""


_NEVER_CHANGING = frozenset({"capabilities"})
"""Verbs that a job may ask as well: their answers stay the same."""
_NOTHING_YET: Final = object()


class GuardedRobot:
    """Passes every verb on to a robot; each is wrapped once, when it is first asked for.

    A verb raises `VerbHung` when it takes too long (see `Watchdog`), and `GarbageError` when its answer has the wrong
    type, numbers that are not finite, or a stamp before the clock's beginning.

    After `claim`, skills show `token` for as long as the run goes on, whatever lease stands behind it just now.
    """

    def __init__(
        self,
        robot: Robot,
        watchdog: Watchdog,
        *,
        limit_s: float = VERB_LIMIT_S,
        image_limit_s: float = IMAGE_LIMIT_S,
    ) -> None:
        self._robot, self._watchdog = robot, watchdog
        self._limit_s, self._image_limit_s = limit_s, image_limit_s
        self._main = threading.main_thread().ident
        self._holder = ""
        self.token: Lease | None = None
        self._lease: Lease | None = None

    def claim(self, holder: str) -> Lease:
        """Acquire the lease; the token that stands for it. Raises LeaseError."""
        self._holder = holder
        self.token = self._lease = self.acquire_lease(holder)
        return self.token

    def lease_lost(self) -> str | None:
        """Why the robot would refuse to move for us, None when it would not."""
        counts = self.lease_holder()
        if counts == self._lease:
            return None
        return f"{counts.holder} holds the lease of {self.name}" if counts else "the lease was given back"

    def regain_lease(self) -> bool:
        """Acquire the lease again when it is free; True when it was."""
        if self.lease_holder() is not None:
            return False
        try:
            self._lease = self.acquire_lease(self._holder)
        except LeaseError:
            return False
        return True

    def give_lease_back(self) -> None:
        """Return the lease; the robot stops."""
        self.return_lease(self._lease)

    def __getattr__(self, verb: str) -> Any:
        value = getattr(self._robot, verb)
        if verb.startswith("_") or not callable(value):
            return value
        guarded = self._guarded(verb, value)
        self.__dict__[verb] = guarded
        return guarded

    def _guarded(self, verb: str, call: Callable[..., Any]) -> Callable[..., Any]:
        watchdog, main, check, ident = self._watchdog, self._main, garbage_check(verb), threading.get_ident
        limit_s = self._image_limit_s if verb == "image" else self._limit_s
        sentence, now_s = hung(verb, limit_s), time.monotonic
        good: Any = _NOTHING_YET

        @functools.wraps(call)
        def guarded_call(*arguments: Any, **options: Any) -> Any:
            """The verb under the watchdog and the lease that counts, its answer checked."""
            nonlocal good
            if "lease" in options and options["lease"] == self.token:
                options["lease"] = self._lease
            if ident() != main:
                answer = self._elsewhere(verb, functools.partial(call, *arguments, **options), limit_s)
            else:
                watchdog.verb = (now_s() + limit_s, sentence)
                try:
                    answer = call(*arguments, **options)
                finally:
                    watchdog.verb = None
            if answer is not good and check is not None:  # sensors give one snapshot many times
                wrong = check(answer)
                if wrong is not None:
                    raise GarbageError(f"the robot answered '{verb}' with garbage: {wrong}")
                good = answer
            return answer

        return guarded_call

    def _elsewhere(self, verb: str, call: Callable[[], Any], limit_s: float) -> Any:
        """A verb outside the main thread. Pictures are not watched there: what renders them is bound to its thread."""
        if in_lock_step_job():
            if verb in _NEVER_CHANGING:
                return call()
            raise RuntimeError(f"'{verb}' was asked for inside a job: read the robot before, or by `Worker.sense`")
        return call() if verb == "image" else done_aside(call, verb, limit_s)
