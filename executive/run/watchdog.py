"""A watchdog on the wall's clock over the verbs of a robot and over ticks: what hangs ends the run."""

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
    """A verb of the Robot protocol, or a tick, did not come back in time.

    Like KeyboardInterrupt, no skill may swallow it.
    """

    stops_run: Final = True


class Watchdog:
    """Raises `VerbHung` in the main thread when a verb or a tick takes too long there; a context manager.

    To watch costs two assignments: `verb` and `tick` hold what is under way as (due time, sentence). A thread compares
    them with the wall's clock and interrupts the main thread by SIGALRM; an alarm of somebody else goes to its handler.

    What this cannot do: compiled code is interrupted only when it returns to Python, and outside the main thread
    nothing is interrupted; see `done_aside`.
    """

    def __init__(self, shortest_limit_s: float = VERB_LIMIT_S) -> None:
        """`shortest_limit_s` of those to watch says how often is looked."""
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
        """Break off a tick that takes longer than its limit: a skill in an endless loop."""
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
        """The sentence of what has taken too long; the tick before the verb in it."""
        now_s = time.monotonic()
        return next((what for due_s, what in filter(None, (self.tick, self.verb)) if now_s >= due_s), None)

    def _on_alarm(self, number: int, frame: FrameType | None) -> None:
        rang, self._rang = self._rang, False
        overdue = self._overdue()
        if overdue is not None:
            raise VerbHung(overdue)
        if not rang and callable(self._before):
            self._before(number, frame)


def hung(verb: str, limit_s: float) -> str:
    """What is said of a verb that did not come back."""
    return f"the robot did not answer '{verb}' within {limit_s:g} s"


def done_aside(call: Callable[[], ResultT], verb: str, limit_s: float) -> ResultT:
    """The call's result, for callers outside the main thread: a thread does it, which is left alone when it hangs.

    It may still act when it comes back; by then the run has returned the lease, under which that is refused. Raises
    VerbHung: it took longer than the limit.
    """
    future: Future[ResultT] = Future()
    threading.Thread(target=fulfil, args=(future, call), name=f"errand-{verb}", daemon=True).start()
    try:
        return future.result(timeout=limit_s)
    except TimeoutError:
        if future.done():
            raise
        raise VerbHung(hung(verb, limit_s)) from None
