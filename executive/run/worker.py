"""The two workers: lock-step for simulation, real time. Both do the work in one thread beside the ticks, in order."""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable
from concurrent.futures import Future, wait
from contextlib import suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any, Final, Generic, TypeVar

from skills.api import Job
from skills.robot import Clock

ResultT = TypeVar("ResultT")
ReadT = TypeVar("ReadT")

_LOCK_STEP_THREAD: Final = "errand-lock-step"
_REAL_TIME_THREAD: Final = "errand-worker"
_PATIENCE_S: Final = 60.0
_Work = tuple[Callable[[], Any], "Future[Any]"]


def in_lock_step_job() -> bool:
    """Returns whether this is called by a job in lock-step, which may touch nothing that the ticks change."""
    return threading.current_thread().name == _LOCK_STEP_THREAD


class WorkThread:
    """Does one piece of work after the other; ends when it is closed or let go of."""

    def __init__(self, name: str) -> None:
        self._work: SimpleQueue[_Work | None] = SimpleQueue()
        self._closed = False
        self._thread = threading.Thread(target=_work_off, args=(self._work,), name=name, daemon=True)
        self._thread.start()

    def do(self, work: Callable[[], ResultT]) -> Future[ResultT]:
        """Has `work` done after all that was given before. Raises RuntimeError when closed."""
        if self._closed:
            raise RuntimeError("the worker is closed")
        future: Future[ResultT] = Future()
        self._work.put((work, future))
        return future

    def close(self, wait_s: float) -> None:
        """Drops what has not begun, and waits so long for what runs; idempotent."""
        self._closed = True
        with suppress(Empty):
            while (given := self._work.get_nowait()) is not None:
                given[1].cancel()
        self._work.put(None)
        self._thread.join(wait_s)

    def __del__(self) -> None:
        self._work.put(None)


class _NoCollection:
    """Keeps the process's garbage collector still while any worker is busy.

    It runs in whichever thread allocates, and what it finds may be an earlier run's renderer, whose graphics context
    belongs to the main thread: freed by a worker it aborts the process.
    """

    def __init__(self) -> None:
        self._lock, self._busy, self._enabled = threading.Lock(), 0, True

    def __enter__(self) -> None:
        with self._lock:
            if self._busy == 0:
                self._enabled = gc.isenabled()
                gc.disable()
            self._busy += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._busy -= 1
            if self._busy == 0 and self._enabled:
                gc.enable()


_NO_COLLECTION: Final = _NoCollection()  # one, since a process has one collector


def _work_off(given: SimpleQueue[_Work | None]) -> None:
    for work, future in iter(given.get, None):
        with _NO_COLLECTION:
            if future.set_running_or_notify_cancel():
                fulfil(future, work)
            del work, future


def fulfil(future: Future[ResultT], work: Callable[[], ResultT]) -> None:
    """Does the work; the future gets its result, or what it raised."""
    try:
        future.set_result(work())
    except BaseException as defect:
        future.set_exception(defect)


@dataclass(frozen=True)
class _ThreadJob(Generic[ResultT]):
    """Work in the thread."""

    future: Future[ResultT]

    def done(self) -> bool:
        """True once the result may be read."""
        return self.future.done()

    def result(self) -> ResultT:
        """The result, or what the work raised. Raises RuntimeError before it is done."""
        if not self.done():
            raise RuntimeError("the work is not done yet")
        return self.future.result()

    def withdraw(self) -> None:
        """Nobody waits for the result any more; work that has not begun is dropped."""
        self.future.cancel()


@dataclass(frozen=True)
class _LockStepJob(_ThreadJob[ResultT]):
    """Work whose result shows itself when its time has come; who reads it waits for work that takes longer."""

    clock: Clock
    ready_s: float

    def done(self) -> bool:
        """True once the declared latency has passed on the robot's clock."""
        return self.clock.now() >= self.ready_s - 1e-9

    def withdraw(self) -> None:
        """Nobody waits for the result any more; returns when the work is done, so that what it uses is free."""
        wait((self.future,))


class LockStepWorker:
    """Starts work at once in a thread beside the plant's steps; its result appears after the declared latency.

    Work uses only what was read before it was submitted, so that a seed gives the same run twice. Use it as a context
    manager or close it: no work outlives the run.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock, self._thread = clock, WorkThread(_LOCK_STEP_THREAD)

    def submit(self, work: Callable[[], ResultT], *, latency_s: float, name: str) -> Job[ResultT]:
        """Starts `work`. What it raises is raised by `result`. Raises ValueError for a negative latency."""
        if latency_s < 0.0:
            raise ValueError(f"{name}: a latency of {latency_s} s")
        return _LockStepJob(self._thread.do(work), self._clock, self._clock.now() + latency_s)

    def sense(
        self, read: Callable[[], ReadT], work: Callable[[ReadT], ResultT], *, latency_s: float, name: str
    ) -> Job[ResultT]:
        """Reads the robot's sensors now, in this thread, and starts work on what they gave."""
        try:
            given = read()
        except Exception as defect:
            failed: Future[ReadT] = Future()
            failed.set_exception(defect)
            return self.submit(lambda: work(failed.result()), latency_s=latency_s, name=name)
        return self.submit(lambda: work(given), latency_s=latency_s, name=name)

    def close(self) -> None:
        """Drops what has not begun; wait for what runs."""
        self._thread.close(_PATIENCE_S)

    def __enter__(self) -> LockStepWorker:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.close()


class ThreadWorker:
    """Runs work in one thread beside the ticks, one piece after the other; for real time. Latencies are its own."""

    def __init__(self) -> None:
        self._thread = WorkThread(_REAL_TIME_THREAD)

    def submit(self, work: Callable[[], ResultT], *, latency_s: float, name: str) -> Job[ResultT]:
        """Hand `work` to the thread."""
        return _ThreadJob(self._thread.do(work))

    def sense(
        self, read: Callable[[], ReadT], work: Callable[[ReadT], ResultT], *, latency_s: float, name: str
    ) -> Job[ResultT]:
        """Lets the thread read the robot's sensors, which may block, and work on what they gave."""
        return self.submit(lambda: work(read()), latency_s=latency_s, name=name)

    def close(self) -> None:
        """Drops what has not begun; what runs is left to end by itself."""
        self._thread.close(0.0)
