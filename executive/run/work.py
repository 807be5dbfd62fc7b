"""Counts what a run computed, equal for equal seeds."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, TypeVar

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
