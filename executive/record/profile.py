"""Where a run's CPU time goes, by timing the calls that lead from one subsystem into another."""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, Final, TypeVar

ResultT = TypeVar("ResultT")

START: Final = "before the first tick"
OTHER: Final = "other threads and the end"


class Profile:
    """CPU-seconds by subsystem. A second counts once, for the innermost timed call of its thread."""

    def __init__(self) -> None:
        self._spent: dict[str, float] = {}
        self._lock = threading.Lock()
        self._inner = threading.local()
        self._began_s: float | None = None

    def timed(self, name: str, call: Callable[..., ResultT]) -> Callable[..., ResultT]:
        """The call, whose time counts for the subsystem of this name."""

        @functools.wraps(call)
        def timed_call(*arguments: Any, **options: Any) -> ResultT:
            """The call; what it takes, without the timed calls within, is added to the subsystem's time."""
            begun_s = self.enter()
            try:
                return call(*arguments, **options)
            finally:
                self.leave(name, begun_s)

        return timed_call

    def enter(self) -> float:
        """A call begins in this thread; its CPU time then (s)."""
        self._calls().append(0.0)
        return time.thread_time()

    def leave(self, name: str, begun_s: float) -> None:
        """The call of a subsystem that began last has ended."""
        whole_s, calls = time.thread_time() - begun_s, self._calls()
        within_s = calls.pop()
        if calls:
            calls[-1] += whole_s
        with self._lock:
            self._spent[name] = self._spent.get(name, 0.0) + whole_s - within_s

    def attach(self, name: str, owner: object, *methods: str) -> None:
        """Time methods of one object from now on."""
        for method in methods:
            setattr(owner, method, self.timed(name, getattr(owner, method)))

    def begin(self) -> None:
        """The run begins: what the process used until now counts as its start."""
        self._began_s = time.process_time()

    def table(self) -> Mapping[str, float]:
        """CPU-seconds by subsystem, the dearest first, then what was used before the run and outside of all calls."""
        spent = dict(sorted(self._spent.items(), key=lambda item: -item[1]))
        began_s = self._began_s or 0.0
        other_s = time.process_time() - began_s - sum(spent.values())
        return {**spent, OTHER: max(0.0, other_s), START: began_s}

    def _calls(self) -> list[float]:
        """The timed calls under way in this thread: how much of each was spent in those within."""
        if not hasattr(self._inner, "calls"):
            self._inner.calls = []
        calls: list[float] = self._inner.calls
        return calls


def lines(table: Mapping[str, float]) -> tuple[str, ...]:
    """The table as text: subsystem, CPU-seconds, share of all."""
    whole_s = sum(table.values()) or 1.0
    rows = [f"{name:<28}{spent_s:8.2f} s{100 * spent_s / whole_s:7.1f} %" for name, spent_s in table.items()]
    return (f"{'CPU time by subsystem':<28}{whole_s:8.2f} s", *rows)
