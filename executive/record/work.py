"""Counts what a run computed, equal for equal seeds, and measures CPU time by subsystem."""

from __future__ import annotations

import functools
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final, TypeVar

from skills.detection import Detector, DetectorWrapper

ResultT = TypeVar("ResultT")


class Work:
    """Counters by name (`skills.api.WorkCounter`), which several threads may use at once."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._lock = threading.Lock()

    def count(self, name: str, amount: int = 1) -> None:
        """Adds to the counter of this name."""
        with self._lock:
            self._counts[name] += amount

    def totals(self) -> Mapping[str, int]:
        """Returns all counters above 0 in the order of their names."""
        with self._lock:
            return MappingProxyType(dict(sorted((+self._counts).items())))


class CountedDetector(DetectorWrapper):
    """Detector that counts the pictures passed to another detector, by method."""

    def __init__(self, detector: Detector, work: Work) -> None:
        super().__init__(detector)
        self._work = work

    def _call(self, method: str, pictures: int, call: Callable[..., ResultT], *arguments: Any) -> ResultT:
        self._work.count(f"{method}_pictures", pictures)
        return call(*arguments)


START: Final = "before the first tick"
OTHER: Final = "other threads and the end"


class Profile:
    """CPU seconds by subsystem; each second counts once, for the innermost timed call of its thread."""

    def __init__(self) -> None:
        self._spent: dict[str, float] = {}
        self._lock = threading.Lock()
        self._inner = threading.local()
        self._began_s: float | None = None

    def timed(self, name: str, call: Callable[..., ResultT]) -> Callable[..., ResultT]:
        """Wraps a call so that its time counts for the named subsystem."""

        @functools.wraps(call)
        def timed_call(*arguments: Any, **options: Any) -> ResultT:
            """Adds the call's time, without the time of timed calls inside it, to the subsystem's time."""
            begun_s = self.enter()
            try:
                return call(*arguments, **options)
            finally:
                self.leave(name, begun_s)

        return timed_call

    def enter(self) -> float:
        """Records that a call begins in this thread; returns the thread's CPU time (s)."""
        self._calls().append(0.0)
        return time.thread_time()

    def leave(self, name: str, begun_s: float) -> None:
        """Records that the last call in this thread has ended, and adds its time to a subsystem."""
        whole_s, calls = time.thread_time() - begun_s, self._calls()
        within_s = calls.pop()
        if calls:
            calls[-1] += whole_s
        with self._lock:
            self._spent[name] = self._spent.get(name, 0.0) + whole_s - within_s

    def attach(self, name: str, owner: object, *methods: str) -> None:
        """Times the named methods of one object from now on."""
        for method in methods:
            setattr(owner, method, self.timed(name, getattr(owner, method)))

    def begin(self) -> None:
        """Records that the run begins; CPU time until now counts as START."""
        self._began_s = time.process_time()

    def table(self) -> Mapping[str, float]:
        """Returns CPU seconds by subsystem, the largest first, then the time outside all calls and before the run."""
        spent = dict(sorted(self._spent.items(), key=lambda item: -item[1]))
        began_s = self._began_s or 0.0
        other_s = time.process_time() - began_s - sum(spent.values())
        return {**spent, OTHER: max(0.0, other_s), START: began_s}

    def _calls(self) -> list[float]:
        """Stack of this thread's timed calls: for each the time (s) spent in timed calls inside it."""
        if not hasattr(self._inner, "calls"):
            self._inner.calls = []
        calls: list[float] = self._inner.calls
        return calls


def lines(table: Mapping[str, float]) -> tuple[str, ...]:
    """Formats the table as text: subsystem, CPU seconds, fraction of the total."""
    whole_s = sum(table.values()) or 1.0
    rows = [f"{name:<28}{spent_s:8.2f} s{100 * spent_s / whole_s:7.1f} %" for name, spent_s in table.items()]
    return (f"{'CPU time by subsystem':<28}{whole_s:8.2f} s", *rows)
