"""The outcome of one run of an evaluation."""

from __future__ import annotations

import enum
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from executive.app.report import RunReport

__all__ = ["Evidence", "RunOutcome", "Standing", "same_everywhere"]

_OF_THE_MACHINE: Final = ("wall_time_s", "real_time_factor", "log")
_COUNTERS_OF_THE_MACHINE: Final = ("bytes_logged",)


class Standing(enum.Enum):
    """The claim of a run against the referee's verdict, in words."""

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
    """Evidence of a failure: the timeline as (s, about, text), pictures as caption and JPEG file, other files."""

    timeline: tuple[tuple[float, str, str], ...] = ()
    pictures: tuple[tuple[str, bytes], ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class RunOutcome:
    """The report of a run, and what a page shows of it.

    `steps_s` tells how long each skill ran, on the robot's clock. `spent_s` is the wall's time from the beginning of
    the work on it to its end, `worker` where it ran.
    """

    run_id: str
    report: RunReport
    steps_s: Mapping[str, float] = field(default_factory=dict)
    evidence: Evidence = Evidence()
    spent_s: float = 0.0
    worker: str = ""

    @property
    def standing(self) -> Standing:
        """The claim against the verdict."""
        if self.report.claimed:
            return _CLAIMED[self.report.seen.success]
        if self.report.outcome in _NO_CLAIM:
            return _NO_CLAIM[self.report.outcome]
        return Standing.FULFILLED_YET_FAILED if self.report.seen.holds else Standing.FAILED

    @property
    def digest(self) -> str:
        """Equal for equal results, wherever and however fast they came."""
        text = json.dumps([same_everywhere(self.report.to_json()), dict(self.steps_s)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def same_everywhere(report: Mapping[str, Any]) -> Mapping[str, Any]:
    """The report without wall times and paths, which differ from machine to machine."""
    left = {name: value for name, value in report.items() if name not in _OF_THE_MACHINE}
    work = {name: count for name, count in report.get("work", {}).items() if name not in _COUNTERS_OF_THE_MACHINE}
    return {**left, "work": work}
