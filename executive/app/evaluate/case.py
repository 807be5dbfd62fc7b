"""One run of an evaluation as plain data, the same on every machine, and what came of it."""

from __future__ import annotations

import enum
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Final

from executive.app.report import RunReport
from executive.mission.request import Request

FALSE_CLAIM: Final = "FALSE CLAIM"
_ID_LETTERS: Final = 16
_OF_THE_MACHINE: Final = ("wall_time_s", "real_time_factor", "log")
_COUNTERS_OF_THE_MACHINE: Final = ("bytes_logged",)


@dataclass(frozen=True)
class RunSpec:
    """A request, what people call its `mission`, and in words what is varied, by dimension.

    `files` has the texts of the request's files and of all that they use, by path, so that a machine that has none of
    them can run it. A run with a `folder` leaves all its files there, else only one that is to be looked at leaves any.
    """

    request: Request
    mission: str
    varied: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    folder: str = ""

    @cached_property
    def id(self) -> str:
        """The hash of its content: equal for equal runs, wherever the files lie."""
        content = json.loads(replace(self.request, out=Path()).to_json())
        for name in {"file", "stack"} & content.keys():
            content[name] = self.files.get(content[name], content[name])
        content["scenario_files"] = [self.files.get(str(path), str(path)) for path in self.request.scenario_files]
        text = json.dumps({**content, "files": sorted(self.files.values())}, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:_ID_LETTERS]

    @property
    def variation_words(self) -> str:
        """The variation on one line."""
        return ", ".join(f"{name} {value}" for name, value in self.varied.items())


@dataclass(frozen=True)
class Evaluation:
    """All runs of an evaluation; `name` is that of its scenario file, or says what is drawn."""

    name: str
    runs: Sequence[RunSpec]

    @cached_property
    def digest(self) -> str:
        """Equal for evaluations of the same runs."""
        return hashlib.sha256("".join(run.id for run in self.runs).encode()).hexdigest()[:_ID_LETTERS]


class Standing(enum.Enum):
    """The claim of a run against the referee's verdict in words, and as the head of a column; the gravest first."""

    FULFILLED = "claimed and fulfilled", "fulfilled"
    FALSE_CLAIM = "claimed, not fulfilled: FALSE CLAIM", "false claims"
    NOT_JUDGED = "claimed, not judged", "not judged"
    FAILED = "failed and said so", "failed"
    FULFILLED_YET_FAILED = "failed, though fulfilled", "failed, yet fulfilled"
    REFUSED = "refused", "refused"
    BROKEN = "broken by an error", "broken"

    def __init__(self, words: str, column: str) -> None:
        self.words, self.column = words, column


_CLAIMED: Final = {True: Standing.FULFILLED, False: Standing.FALSE_CLAIM, None: Standing.NOT_JUDGED}
_NO_CLAIM: Final = {"refused": Standing.REFUSED, "error": Standing.BROKEN}


@dataclass(frozen=True)
class Evidence:
    """Evidence of a failure: the timeline as (s, about, text), pictures as caption and JPEG file, other files."""

    timeline: tuple[tuple[float, str, str], ...] = ()
    pictures: tuple[tuple[str, bytes], ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Case:
    """A run, its report, and what a page shows of it.

    `steps_s` tells how long each skill ran, on the robot's clock. `spent_s` is the wall's time from the beginning of
    the work on it to its end, `worker` where it ran.
    """

    run: RunSpec
    report: RunReport
    steps_s: Mapping[str, float] = field(default_factory=dict)
    evidence: Evidence = Evidence()
    spent_s: float = 0.0
    worker: str = ""

    @cached_property
    def standing(self) -> Standing:
        """The claim against the verdict."""
        if self.report.claimed:
            return _CLAIMED[self.report.seen.success]
        if self.report.outcome in _NO_CLAIM:
            return _NO_CLAIM[self.report.outcome]
        return Standing.FULFILLED_YET_FAILED if self.report.seen.holds else Standing.FAILED

    @property
    def cause(self) -> str:
        """Why it is no success; empty where it is one."""
        if self.report.achieved:
            return ""
        return FALSE_CLAIM if self.report.false_claim else self.report.cause or "ERROR"

    @property
    def failure_cause(self) -> str:
        """The cause that a run which failed gives; empty for all others."""
        failed = self.standing in (Standing.FAILED, Standing.FULFILLED_YET_FAILED)
        return self.report.cause or "" if failed else ""

    @property
    def label(self) -> str:
        """The claim against the verdict, with the cause of a failure."""
        return self.standing.words + (f" ({self.failure_cause})" if self.failure_cause else "")

    @property
    def why(self) -> str:
        """The sentence that goes with the cause, or says why it was not judged."""
        return self.report.seen.why if self.report.claimed else self.report.message

    @property
    def asked(self) -> str:
        """The sentence, else the name of the mission."""
        return self.run.request.sentence or self.run.mission

    @property
    def digest(self) -> str:
        """Equal for equal results, wherever and however fast they came: wall times and paths are left out."""
        report = {name: value for name, value in self.report.to_json().items() if name not in _OF_THE_MACHINE}
        report["work"] = {name: count for name, count in report["work"].items() if name not in _COUNTERS_OF_THE_MACHINE}
        text = json.dumps([report, dict(self.steps_s)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:_ID_LETTERS]
