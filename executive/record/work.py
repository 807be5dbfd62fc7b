"""What a run computed, as counters by name: equal for equal seeds, so that a slower path is seen without a clock."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from skills.api import Detector
from skills.robot import Image

Wrap = Callable[[Callable[..., Any]], Callable[..., Any]]


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

    def of_verb(self, verb: str, call: Callable[..., Any]) -> Callable[..., Any]:
        """A verb of the Robot protocol that counts what it gives: pictures by size."""
        if verb != "image":
            return call

        def image(*arguments: Any, **options: Any) -> Any:
            taken = call(*arguments, **options)
            if isinstance(taken, Image):
                self._count_picture("pictures", taken.grey.shape)
                self._count_picture("depth_images", taken.depth_m.shape)
            return taken

        return image

    def _count_picture(self, what: str, shape: tuple[int, ...]) -> None:
        height, width = shape[:2]
        if height:
            self.count(f"{what}_{width}x{height}")


class CountedDetector:
    """A detector that counts the pictures it looks through, by method."""

    def __init__(self, detector: Detector, work: Work, timed: Wrap = lambda call: call) -> None:
        """`timed` is put around its methods."""
        self._detector, self._work, self._timed = detector, work, timed

    @property
    def class_names(self) -> tuple[str, ...]:
        """The classes that it knows."""
        return self._detector.class_names

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._detector, name)
        if not name.startswith("detect") or not callable(value):
            return value

        def detect(pictures: Any, *arguments: Any, **options: Any) -> Any:
            self._work.count(f"{name}_pictures", len(pictures) if isinstance(pictures, list | tuple) else 1)
            return value(pictures, *arguments, **options)

        return self._timed(detect)
