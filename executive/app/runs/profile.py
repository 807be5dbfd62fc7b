"""CPU time of a run by subsystem, from Python's profiler."""

from __future__ import annotations

import cProfile
import re
import time
from collections import Counter
from collections.abc import Mapping
from functools import cache
from typing import Any, Final

from executive.run.outcome import RunResult
from executive.run.visitor import RunSettings, RunVisitor
from skills.api import Worker

START: Final = "before the first tick"
OTHER: Final = "planning, other threads, end"
_SUBSYSTEM: Final = re.compile(r"/(executive|skills|plant|errand_\w+)/(\w+)(?=[/.])")
"""Two packages in a file's path, which name a subsystem: `skills.navigate`."""
_DEEPEST: Final = 30
Function = tuple[str, int, str]
"""File, line and name, as the profiler tells a function."""


class Profile(RunVisitor):
    """Measures the CPU seconds of the run's thread; code of libraries counts for the subsystem that calls it."""

    def __init__(self) -> None:
        self._profiler, self._began_s = cProfile.Profile(time.thread_time), 0.0

    def begin(self, settings: RunSettings, worker: Worker) -> None:
        """Begins the measurement; CPU time until now counts as START."""
        self._began_s = time.process_time()
        self._profiler.enable()

    def end(self, result: RunResult) -> None:
        """Ends the measurement."""
        self._profiler.disable()

    def table(self) -> Mapping[str, float]:
        """Returns CPU seconds by subsystem, the largest first, then the time of other threads and before the run."""
        self._profiler.create_stats()
        spent = by_subsystem(self._profiler.stats)
        del spent[OTHER]
        rest_s = time.process_time() - self._began_s - sum(spent.values())
        return {**dict(spent.most_common()), OTHER: max(0.0, rest_s), START: self._began_s}


def by_subsystem(stats: Mapping[Function, Any]) -> Counter[str]:
    """Sums the profiler's times (s) by subsystem; a library's function shares its time out among its callers."""
    spent = Counter[str]()

    @cache
    def shares(function: Function, depth: int = 0) -> Mapping[str, float]:
        if named := _SUBSYSTEM.findall(function[0]):
            return {".".join(named[-1]): 1.0}
        callers = {each: times[3] for each, times in stats[function][4].items()}
        whole_s, found = sum(callers.values()), Counter[str]()
        if whole_s <= 0.0 or depth > _DEEPEST:
            return {OTHER: 1.0}
        for caller, time_s in callers.items():
            for name, share in shares(caller, depth + 1).items():
                found[name] += share * time_s / whole_s
        return found

    for function, (_, _, own_s, *_) in stats.items():
        for name, share in shares(function).items():
            spent[name] += share * own_s
    return spent


def lines(table: Mapping[str, float]) -> tuple[str, ...]:
    """Formats the table as text: subsystem, CPU seconds, fraction of the total."""
    whole_s = sum(table.values()) or 1.0
    rows = [f"{name:<28}{spent_s:8.2f} s{100 * spent_s / whole_s:7.1f} %" for name, spent_s in table.items()]
    return (f"{'CPU time by subsystem':<28}{whole_s:8.2f} s", *rows)
