"""Watchdog on the wall clock over a robot's verbs and ticks; a call that hangs ends the run."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import Any, Final, TypeVar

from executive.run.worker import fulfil

ResultT = TypeVar("ResultT")

VERB_LIMIT_S: Final = 2.0
IMAGE_LIMIT_S: Final = 20.0  # `image` may block by contract
TICK_LIMIT_S: Final = 300.0  # a tick may render pictures and wait for a job
_LOOKS_PER_LIMIT: Final = 5
_LONGEST_PERIOD_S: Final = 0.25


class VerbHung(BaseException):
    """Verb of the Robot protocol, or tick, that did not return in time; like KeyboardInterrupt, no skill catches it."""

    stops_run: Final = True


class Watchdog:
    """Context manager that raises `VerbHung` in the main thread when a verb or a tick takes too long there.

    Guarding a call costs two assignments: `verb` and `tick` hold the calls under way as (due time, sentence). A thread
    compares due times with the wall clock and interrupts the main thread by SIGALRM; the previous handler gets others.

    Only the main thread is interrupted (see `call_aside` for others), and compiled code only at its return to Python.
    """

    def __init__(self, shortest_limit_s: float = VERB_LIMIT_S) -> None:
        """Takes the shortest of all limits, from which the period of the checks follows."""
        self.verb: tuple[float, str] | None = None
        self.tick: tuple[float, str] | None = None
        self._period_s = min(shortest_limit_s / _LOOKS_PER_LIMIT, _LONGEST_PERIOD_S)
        self._over = threading.Event()
        self._rang = False
        self._before: Any = None
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Watchdog:
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGALRM, self._on_alarm)
            self._thread = threading.Thread(target=self._watch, name="errand-watchdog", daemon=True)
            self._thread.start()
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        if self._thread is not None:
            self._over.set()
            self._thread.join()
            signal.signal(signal.SIGALRM, self._before)

    @contextmanager
    def over_tick(self, robot_name: str, limit_s: float) -> Iterator[None]:
        """Interrupts a tick that takes longer than its limit, such as a skill in an endless loop."""
        self.tick = (time.monotonic() + limit_s, f"a tick of {robot_name} took longer than {limit_s:g} s")
        try:
            yield
        finally:
            self.tick = None

    def _watch(self) -> None:
        main = threading.main_thread().ident
        assert main is not None
        while not self._over.wait(self._period_s):
            if self._overdue() is not None:
                self._rang = True
                signal.pthread_kill(main, signal.SIGALRM)

    def _overdue(self) -> str | None:
        """Sentence on the overdue tick, else on the overdue verb; None if no call is overdue."""
        now_s = time.monotonic()
        return next((what for due_s, what in filter(None, (self.tick, self.verb)) if now_s >= due_s), None)

    def _on_alarm(self, number: int, frame: FrameType | None) -> None:
        rang, self._rang = self._rang, False
        overdue = self._overdue()
        if overdue is not None:
            raise VerbHung(overdue)
        if not rang and callable(self._before):
            self._before(number, frame)


def hung_message(verb: str, limit_s: float) -> str:
    """Sentence that reports a verb that did not return in time."""
    return f"the robot did not answer '{verb}' within {limit_s:g} s"


def call_aside(call: Callable[[], ResultT], verb: str, limit_s: float) -> ResultT:
    """Calls a verb in a thread of its own, for callers outside the main thread, and returns the result.

    A thread that hangs is abandoned; when the call returns later, the robot refuses the motion, since the run has
    returned the lease by then. Raises VerbHung when the call takes longer than the limit.
    """
    future: Future[ResultT] = Future()
    threading.Thread(target=fulfil, args=(future, call), name=f"errand-{verb}", daemon=True).start()
    try:
        return future.result(timeout=limit_s)
    except TimeoutError:
        if future.done():
            raise
        raise VerbHung(hung_message(verb, limit_s)) from None
