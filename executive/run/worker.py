"""The two workers: lock-step for simulation, a thread for real time."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Generic, TypeVar

from skills.api import Job
from skills.robot import Clock

ResultT = TypeVar("ResultT")


@dataclass(frozen=True)
class _LockStepJob(Generic[ResultT]):
    """A result that is already there, and shows itself when its time has come."""

    clock: Clock
    ready_s: float
    future: Future[ResultT]

    def done(self) -> bool:
        """True once the declared latency has passed on the robot's clock."""
        return self.clock.now() >= self.ready_s - 1e-9

    def result(self) -> ResultT:
        """The result, or what the work raised. Raises RuntimeError before its time."""
        if not self.done():
            raise RuntimeError(f"the result is due at {self.ready_s:.3f} s")
        return self.future.result()


class LockStepWorker:
    """Runs work at once; its result appears after the declared latency. A seed gives the same run twice."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock

    def submit(self, work: Callable[[], ResultT], *, latency_s: float, name: str) -> Job[ResultT]:
        """Do `work` now. What it raises is raised by `result`. Raises ValueError for a negative latency."""
        if latency_s < 0.0:
            raise ValueError(f"{name}: a latency of {latency_s} s")
        return _LockStepJob(self._clock, self._clock.now() + latency_s, _done_now(work))


def _done_now(work: Callable[[], ResultT]) -> Future[ResultT]:
    future: Future[ResultT] = Future()
    try:
        future.set_result(work())
    except Exception as defect:
        future.set_exception(defect)
    return future


@dataclass(frozen=True)
class _ThreadJob(Generic[ResultT]):
    future: Future[ResultT]

    def done(self) -> bool:
        """True once the work is done."""
        return self.future.done()

    def result(self) -> ResultT:
        """The result, or what the work raised. Raises RuntimeError before it is done."""
        if not self.future.done():
            raise RuntimeError("the work is not done yet")
        return self.future.result()


class ThreadWorker:
    """Runs work in one thread beside the ticks, one piece after the other; for real time. Latencies are its own."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix="errand-worker")

    def submit(self, work: Callable[[], ResultT], *, latency_s: float, name: str) -> Job[ResultT]:
        """Hand `work` to the thread."""
        return _ThreadJob(self._pool.submit(work))

    def close(self) -> None:
        """Drop what has not begun; what runs is left to end by itself."""
        self._pool.shutdown(wait=False, cancel_futures=True)
