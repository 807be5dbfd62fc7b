"""What a run computed, as counters by name: equal for equal seeds, so that a slower path is seen without a clock."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from skills.api import Detector


class Work:
    """Counters by name; implements `skills.api.WorkCounter`. Threads may share it."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._lock = threading.Lock()

    def count(self, name: str, amount: int = 1) -> None:
        """Add to the counter of this name."""
        with self._lock:
            self._counts[name] += amount

    def totals(self, more: Mapping[str, int] = MappingProxyType({})) -> Mapping[str, int]:
        """All counters that are not 0, in the order of their names; `more` are those of others."""
        with self._lock:
            both = self._counts + Counter(dict(more))
        return MappingProxyType(dict(sorted(both.items())))


class CountedDetector:
    """A detector that counts the pictures it looks through, by method; it has all `methods` of the one within."""

    def __init__(self, detector: Detector, work: Work) -> None:
        self._detector = detector
        found = {name: getattr(detector, name) for name in dir(detector) if name.startswith("detect")}
        self.methods = tuple(name for name, method in found.items() if callable(method))
        for name in self.methods:
            setattr(self, name, _counted(found[name], f"{name}_pictures", work))

    @property
    def class_names(self) -> tuple[str, ...]:
        """The classes that it knows."""
        return self._detector.class_names

    def __getattr__(self, name: str) -> Any:
        return getattr(self._detector, name)


def _counted(method: Callable[..., Any], counter: str, work: Work) -> Callable[..., Any]:
    def detect(pictures: Any, *arguments: Any, **options: Any) -> Any:
        work.count(counter, len(pictures) if isinstance(pictures, list | tuple) else 1)
        return method(pictures, *arguments, **options)

    return detect
