"""What came of one run of an evaluation."""

from __future__ import annotations

import enum
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

__all__ = ["Evidence", "RunOutcome", "Standing", "same_everywhere"]

_OF_THE_MACHINE: Final = ("wall_time_s", "real_time_factor", "log")
_COUNTERS_OF_THE_MACHINE: Final = ("bytes_logged",)


class Standing(enum.Enum):
    """What a run claims against what the referee saw, in words."""

    FULFILLED = "claimed and fulfilled"
    FALSE_CLAIM = "claimed, not fulfilled: FALSE CLAIM"
    NOT_JUDGED = "claimed, not judged"
    FAILED = "failed and said so"
    FULFILLED_YET_FAILED = "failed, though fulfilled"
    REFUSED = "refused"
    BROKEN = "broken by an error"


_CLAIMED: Final = {True: Standing.FULFILLED, False: Standing.FALSE_CLAIM, None: Standing.NOT_JUDGED}
_NO_CLAIM: Final = {"refused": Standing.REFUSED, "error": Standing.BROKEN}


@dataclass(frozen=True)
class Evidence:
    """What shows why a run failed: its timeline as (s, about, text), pictures as caption and JPEG file, other files."""

    timeline: tuple[tuple[float, str, str], ...] = ()
    pictures: tuple[tuple[str, bytes], ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class RunOutcome:
    """The report of a run as JSON values with the keys of `errand run --json`, and what a page shows of it.

    `steps_s` tells how long each skill ran, on the robot's clock. `spent_s` is the wall's time from the beginning of
    the work on it to its end, `worker` where it ran.
    """

    run_id: str
    report: Mapping[str, Any]
    steps_s: Mapping[str, float] = field(default_factory=dict)
    evidence: Evidence = Evidence()
    spent_s: float = 0.0
    worker: str = ""

    @property
    def claimed(self) -> bool:
        """The tree says that the mission is achieved."""
        return bool(self.report["outcome"] == "success")

    @property
    def fulfilled(self) -> bool | None:
        """What the referee says; None: not judged."""
        referee = self.report.get("referee")
        success: bool | None = None if referee is None else referee["success"]
        return success

    @property
    def holds(self) -> bool | None:
        """Whether the referee sees all that was asked for, however the run ended; None: not judged."""
        return (self.report.get("referee") or {}).get("holds")

    @property
    def achieved(self) -> bool:
        """The tree says so, and no referee denies it."""
        return self.claimed and self.fulfilled is not False

    @property
    def standing(self) -> Standing:
        """The claim against the verdict."""
        if self.claimed:
            return _CLAIMED[self.fulfilled]
        if self.report["outcome"] in _NO_CLAIM:
            return _NO_CLAIM[self.report["outcome"]]
        return Standing.FULFILLED_YET_FAILED if self.holds else Standing.FAILED

    @property
    def digest(self) -> str:
        """Equal for equal results, wherever and however fast they came."""
        text = json.dumps([same_everywhere(self.report), dict(self.steps_s)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def same_everywhere(report: Mapping[str, Any]) -> Mapping[str, Any]:
    """The report without wall times and paths, which differ from machine to machine."""
    left = {name: value for name, value in report.items() if name not in _OF_THE_MACHINE}
    work = {name: count for name, count in report.get("work", {}).items() if name not in _COUNTERS_OF_THE_MACHINE}
    return {**left, "work": work}
