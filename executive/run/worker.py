"""Workers for simulation (lock-step) and for real time. Both run jobs one after another in a background thread."""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future, wait
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
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
    """Returns whether the caller is a lock-step job, which must not use anything that ticks change."""
    return threading.current_thread().name == _LOCK_STEP_THREAD


class WorkThread:
    """Thread that runs one job after the other; it ends when it is closed or deleted."""

    def __init__(self, name: str) -> None:
        self._work: SimpleQueue[_Work | None] = SimpleQueue()
        self._closed = False
        self._thread = threading.Thread(target=_run_jobs, args=(self._work,), name=name, daemon=True)
        self._thread.start()

    def do(self, work: Callable[[], ResultT]) -> Future[ResultT]:
        """Runs `work` after all earlier jobs. Raises RuntimeError when the thread is closed."""
        if self._closed:
            raise RuntimeError("the worker is closed")
        future: Future[ResultT] = Future()
        self._work.put((work, future))
        return future

    def close(self, wait_s: float) -> None:
        """Drops jobs that have not begun, and waits up to `wait_s` for the running one; idempotent."""
        self._closed = True
        with suppress(Empty):
            while (given := self._work.get_nowait()) is not None:
                given[1].cancel()
        self._work.put(None)
        self._thread.join(wait_s)

    def __del__(self) -> None:
        self._work.put(None)


class _NoCollection:
    """Context that disables the process's garbage collector while any worker is busy.

    The collector runs in the thread that allocates, and may free an earlier run's renderer. A renderer's graphics
    context belongs to the main thread; if a worker frees it, the process aborts.
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


def _run_jobs(given: SimpleQueue[_Work | None]) -> None:
    for work, future in iter(given.get, None):
        with _NO_COLLECTION:
            if future.set_running_or_notify_cancel():
                fulfil(future, work)
            del work, future


class WorkQueue(Executor):
    """Executor whose work is done by the thread that calls `work_for`, such as the owner of a robot."""

    def __init__(self) -> None:
        self._given: SimpleQueue[_Work] = SimpleQueue()

    @property
    def is_empty(self) -> bool:
        """Returns whether no work waits."""
        return self._given.empty()

    def submit(self, work: Callable[..., ResultT], /, *args: Any, **options: Any) -> Future[ResultT]:
        """Hands work over; the future has its result."""
        future: Future[ResultT] = Future()
        self._given.put((partial(work, *args, **options), future))
        return future

    def work_for(self, limit_s: float, most: int = 1000) -> None:
        """Does the work that waits, and what comes within a time (s, wall clock), up to a number."""
        until_s = time.monotonic() + limit_s
        with suppress(Empty):
            for _ in range(most):
                work, future = self._given.get(timeout=max(0.0, until_s - time.monotonic()))
                if future.set_running_or_notify_cancel():
                    fulfil(future, work)


def fulfil(future: Future[ResultT], work: Callable[[], ResultT]) -> None:
    """Runs the work and sets the future to the result, or to the exception that the work raised."""
    try:
        future.set_result(work())
    except BaseException as defect:
        future.set_exception(defect)


@dataclass(frozen=True)
class _ThreadJob(Generic[ResultT]):
    """Job in a work thread."""

    future: Future[ResultT]

    def done(self) -> bool:
        """Returns whether the result may be read."""
        return self.future.done()

    def result(self) -> ResultT:
        """Returns the result, or raises the job's exception. Raises RuntimeError before the job is done."""
        if not self.done():
            raise RuntimeError("the work is not done yet")
        return self.future.result()

    def withdraw(self) -> None:
        """Withdraws the job; a job that has not begun is dropped."""
        self.future.cancel()


@dataclass(frozen=True)
class _LockStepJob(_ThreadJob[ResultT]):
    """Job with a result from `ready_s` on (robot's clock); reading the result waits for a job that takes longer."""

    clock: Clock
    ready_s: float

    def done(self) -> bool:
        """Returns whether the declared latency has passed on the robot's clock."""
        return self.clock.now() >= self.ready_s - 1e-9

    def withdraw(self) -> None:
        """Waits until the job has finished, so that nothing uses its inputs any more."""
        wait((self.future,))


class LockStepWorker:
    """Worker for simulation: a job starts at once in a thread, and its result appears after the declared latency.

    A job uses only inputs that were read before it was submitted, so that a seed gives the same run twice. Use it as a
    context manager or close it: no job outlives the run.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock, self._thread = clock, WorkThread(_LOCK_STEP_THREAD)

    def submit(self, work: Callable[[], ResultT], *, latency_s: float, name: str) -> Job[ResultT]:
        """Starts `work`; the job's `result` raises an exception of `work`. Raises ValueError for a negative latency."""
        if latency_s < 0.0:
            raise ValueError(f"{name}: a latency of {latency_s} s")
        return _LockStepJob(self._thread.do(work), self._clock, self._clock.now() + latency_s)

    def sense(
        self, read: Callable[[], ReadT], work: Callable[[ReadT], ResultT], *, latency_s: float, name: str
    ) -> Job[ResultT]:
        """Reads the robot's sensors now, in this thread, and starts work on the readings."""
        try:
            given = read()
        except Exception as defect:
            failed: Future[ReadT] = Future()
            failed.set_exception(defect)
            return self.submit(lambda: work(failed.result()), latency_s=latency_s, name=name)
        return self.submit(lambda: work(given), latency_s=latency_s, name=name)

    def close(self) -> None:
        """Drops jobs that have not begun, and waits for the running one."""
        self._thread.close(_PATIENCE_S)

    def __enter__(self) -> LockStepWorker:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.close()


class ThreadWorker:
    """Worker for real time: runs jobs in one thread beside the ticks, one after the other, with their true latency."""

    def __init__(self) -> None:
        self._thread = WorkThread(_REAL_TIME_THREAD)

    def submit(self, work: Callable[[], ResultT], *, latency_s: float, name: str) -> Job[ResultT]:
        """Starts `work` in the thread."""
        return _ThreadJob(self._thread.do(work))

    def sense(
        self, read: Callable[[], ReadT], work: Callable[[ReadT], ResultT], *, latency_s: float, name: str
    ) -> Job[ResultT]:
        """Reads the sensors in the background thread, because reading may block, and works on the readings there."""
        return self.submit(lambda: work(read()), latency_s=latency_s, name=name)

    def close(self) -> None:
        """Drops jobs that have not begun; the running job ends by itself."""
        self._thread.close(0.0)
