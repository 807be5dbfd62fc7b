"""Summarises results: success by mission, world, robot and variation, causes, times; compares two results."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from scipy.stats import binomtest, fisher_exact

from executive.app.evaluate.case import RunSpec
from executive.app.evaluate.outcome import RunOutcome, Standing
from executive.app.report import RunReport

__all__ = [
    "COLUMNS",
    "GROUP_HEAD",
    "STANDING_HEAD",
    "Case",
    "Comparison",
    "Group",
    "Rate",
    "StandingRow",
    "TimeRow",
    "causes_of",
    "compared",
    "fisher",
    "group_rows",
    "groups_of",
    "label_of",
    "mcnemar",
    "standing_rows",
    "standing_texts",
    "time_rows",
    "to_look_at",
]

FALSE_CLAIM: Final = "FALSE CLAIM"
PLAIN: Final = "as it is"
COLUMNS: Final[Mapping[Standing, str]] = {
    Standing.FULFILLED: "fulfilled",
    Standing.FALSE_CLAIM: "false claims",
    Standing.NOT_JUDGED: "not judged",
    Standing.FAILED: "failed",
    Standing.FULFILLED_YET_FAILED: "failed, yet fulfilled",
    Standing.REFUSED: "refused",
    Standing.BROKEN: "broken",
}
"""The standings as heads of columns."""


@dataclass(frozen=True)
class Case:
    """A run and what came of it."""

    run: RunSpec
    outcome: RunOutcome

    @property
    def report(self) -> RunReport:
        """The report of the run."""
        return self.outcome.report

    @property
    def cause(self) -> str:
        """Why it is no success; empty where it is one."""
        if self.report.achieved:
            return ""
        return FALSE_CLAIM if self.report.false_claim else self.report.cause or "ERROR"

    @property
    def why(self) -> str:
        """The sentence that goes with the cause, or says why it was not judged."""
        return self.report.seen.why if self.report.claimed else self.report.message

    @property
    def label(self) -> str:
        """The claim against the verdict, with the cause of a failure."""
        cause = self.failure_cause
        return self.outcome.standing.value + (f" ({cause})" if cause else "")

    @property
    def failure_cause(self) -> str:
        """The cause that a run which failed gives; empty for all others."""
        failed = self.outcome.standing in (Standing.FAILED, Standing.FULFILLED_YET_FAILED)
        return self.report.cause or "" if failed else ""

    @property
    def asked(self) -> str:
        """The sentence, else the name of the mission."""
        return self.run.request.sentence or self.run.mission


@dataclass(frozen=True)
class Group:
    """Runs that have something in common."""

    dimension: str
    name: str
    runs: int
    achieved: int
    fulfilled: int
    claimed: int
    standings: Mapping[Standing, int]

    @property
    def rate(self) -> Rate:
        """The rate of success."""
        return Rate(self.achieved, self.runs)

    @property
    def counts(self) -> Mapping[str, int]:
        """The counts by their keys in JSON."""
        return {
            "successes": self.claimed,
            "referee_successes": self.fulfilled,
            "false_claims": self.standings[Standing.FALSE_CLAIM],
        }


def groups_of(cases: Sequence[Case]) -> Sequence[Group]:
    """All runs, then those of each mission, world, robot and value that is varied, where there are several."""
    keyed: dict[tuple[str, str], list[Case]] = {("all", "all runs"): list(cases)}
    for case in cases:
        for key in _keys(case):
            keyed.setdefault(key, []).append(case)
    several = Counter(dimension for dimension, _ in keyed)
    groups = (_group(*key, found) for key, found in keyed.items() if key[0] == "all" or several[key[0]] > 1)
    order = {name: number for number, name in enumerate(dict.fromkeys(dimension for dimension, _ in keyed))}
    return sorted(groups, key=lambda group: order[group.dimension])


def _keys(case: Case) -> Iterator[tuple[str, str]]:
    yield "mission", case.run.mission
    yield "world", case.report.world or case.run.request.world or ""
    yield "robots", case.run.robot_words
    yield from case.run.varied.items()
    if len(case.run.varied) > 1:
        yield "variation", case.run.variation_words


def label_of(dimension: str, name: str) -> str:
    """A group's dimension and name in words."""
    return name if dimension == "all" else f"{dimension}: {name}"


def _group(dimension: str, name: str, cases: Iterable[Case]) -> Group:
    found = list(cases)
    return Group(
        dimension,
        name or PLAIN,
        len(found),
        sum(case.report.achieved for case in found),
        sum(case.report.seen.success is True for case in found),
        sum(case.report.claimed for case in found),
        Counter(case.outcome.standing for case in found),
    )


def totals_of(cases: Sequence[Case]) -> Mapping[str, int]:
    """The counts of all runs."""
    return _group("all", "", cases).counts


GROUP_HEAD: Final = ("", "runs", "success", "95 %", *(COLUMNS[standing] for standing in Standing))
"""The head of the table of groups."""


def group_rows(groups: Iterable[Group]) -> Iterator[tuple[str, ...]]:
    """The table of groups as text."""
    for group in groups:
        low, high = group.rate.interval()
        name = label_of(group.dimension, group.name)
        success = f"{group.achieved} ({group.rate.value:.1%})"
        counts = (str(group.standings[standing]) for standing in Standing)
        yield name, str(group.runs), success, f"{low:.1%} to {high:.1%}", *counts


@dataclass(frozen=True)
class StandingRow:
    """A claim against a verdict: how many runs of all, and their causes with their numbers."""

    standing: Standing
    rate: Rate
    causes: Sequence[tuple[str, int]]


def standing_rows(cases: Sequence[Case]) -> Sequence[StandingRow]:
    """The table of claims against verdicts; all runs but those of its first row are to be looked at."""
    found = defaultdict[Standing, list[Case]](list)
    for case in cases:
        found[case.outcome.standing].append(case)
    return [
        StandingRow(standing, Rate(len(found[standing]), len(cases)), _counted_causes(found[standing]))
        for standing in Standing
    ]


def _counted_causes(cases: Iterable[Case]) -> Sequence[tuple[str, int]]:
    return Counter(case.failure_cause for case in cases if case.failure_cause).most_common()


STANDING_HEAD: Final = ("claim against verdict", "runs", "share", "95 %", "causes")
"""The head of the table of claims against verdicts."""


def standing_texts(cases: Sequence[Case]) -> Iterator[tuple[str, ...]]:
    """The table of claims against verdicts as text."""
    for row in standing_rows(cases):
        low, high = row.rate.interval()
        causes = ", ".join(f"{cause} {number}" for cause, number in row.causes)
        share, interval = f"{row.rate.value:.1%}", f"{low:.1%} to {high:.1%}"
        yield row.standing.value, str(row.rate.successes), share, interval, causes


def to_look_at(cases: Iterable[Case]) -> Sequence[Case]:
    """The runs that are not claimed and fulfilled, the gravest first."""
    order = {standing: number for number, standing in enumerate(Standing)}
    found = [case for case in cases if case.outcome.standing is not Standing.FULFILLED]
    return sorted(found, key=lambda case: order[case.outcome.standing])


@dataclass(frozen=True)
class CauseRow:
    """A cause, how often, and its most frequent sentences with their numbers."""

    cause: str
    runs: int
    sentences: Sequence[tuple[str, int]]


def causes_of(cases: Iterable[Case], *, most: int = 5) -> Sequence[CauseRow]:
    """The causes of what failed, the most frequent first."""
    why = defaultdict[str, Counter[str]](Counter)
    for case in cases:
        if case.cause:
            why[case.cause][case.why] += 1
    rows = [CauseRow(cause, found.total(), found.most_common(most)) for cause, found in why.items()]
    return sorted(rows, key=lambda row: (-row.runs, row.cause))


@dataclass(frozen=True)
class TimeRow:
    """A skill: in how many runs it ran, how long in all (s, on the robot's clock), and its share of all runs' time."""

    skill: str
    runs: int
    total_s: float
    share: float


def time_rows(cases: Sequence[Case]) -> Sequence[TimeRow]:
    """Where the time goes, the most first; the rest is what no skill took."""
    total_s = sum(case.report.sim_time_s for case in cases)
    spent, runs = Counter[str](), Counter[str]()
    for case in cases:
        for skill, seconds in case.outcome.steps_s.items():
            spent[skill] += seconds  # type: ignore[assignment]
            runs[skill] += 1
    return [
        TimeRow(skill, runs[skill], seconds, seconds / max(total_s, 1e-9)) for skill, seconds in spent.most_common()
    ]


def mean_work(cases: Sequence[Case]) -> Sequence[tuple[str, float]]:
    """The mean of each work counter, by name."""
    work = Counter[str]()
    for case in cases:
        work.update(case.report.work)
    return [(name, count / max(1, len(cases))) for name, count in sorted(work.items())]


@dataclass(frozen=True)
class Comparison:
    """Two results, `first` the new and `second` the other: success of each, and how likely chance alone is (p).

    Of runs with one id in both, `only_first` and `only_second` succeeded in one of them alone (McNemar); where there is
    none, all runs of each are compared (Fisher).
    """

    dimension: str
    name: str
    paired: bool
    first: Rate
    second: Rate
    only_first: int
    only_second: int
    p: float


def compared(first: Sequence[Case], second: Sequence[Case]) -> Sequence[Comparison]:
    """Two results compared: in all, and by what the groups are by where both have it."""
    other = {case.outcome.run_id: case for case in second}
    pairs = [(case, other[case.outcome.run_id]) for case in first if case.outcome.run_id in other]
    keys = [(group.dimension, group.name) for group in groups_of(first)]
    return [found for key in keys if (found := _compared(key, first, second, pairs)) is not None]


def _compared(
    key: tuple[str, str], first: Sequence[Case], second: Sequence[Case], pairs: Sequence[tuple[Case, Case]]
) -> Comparison | None:
    if pairs:
        mine = [(one, two) for one, two in pairs if _is_in(one, key)]
        only_first = sum(one.report.achieved and not two.report.achieved for one, two in mine)
        only_second = sum(two.report.achieved and not one.report.achieved for one, two in mine)
        rates = (_rate(one for one, _ in mine), _rate(two for _, two in mine))
        return Comparison(*key, True, *rates, only_first, only_second, mcnemar(only_first, only_second))
    rates = (_rate(case for case in first if _is_in(case, key)), _rate(case for case in second if _is_in(case, key)))
    if not rates[1].total:
        return None
    return Comparison(*key, False, *rates, 0, 0, fisher(*rates))


def _is_in(case: Case, key: tuple[str, str]) -> bool:
    return key[0] == "all" or key in {(dimension, name or PLAIN) for dimension, name in _keys(case)}


def _rate(cases: Iterable[Case]) -> Rate:
    found = [case.report.achieved for case in cases]
    return Rate(sum(found), len(found))


CONFIDENCE = 0.95


@dataclass(frozen=True)
class Rate:
    """A number of successes out of a total."""

    successes: int
    total: int

    @property
    def value(self) -> float:
        """The share, 0 where there was none."""
        return self.successes / self.total if self.total else 0.0

    def interval(self) -> tuple[float, float]:
        """Wilson's score interval, 95 %; (0, 1) where there was none (Wilson 1927)."""
        if not self.total:
            return 0.0, 1.0
        found = binomtest(self.successes, self.total).proportion_ci(CONFIDENCE, method="wilson")
        return float(found.low), float(found.high)


def mcnemar(only_first: int, only_second: int) -> float:
    """The exact two-sided p of McNemar's test for pairs of which only one succeeded; 1 where there are none."""
    discordant = only_first + only_second
    return 1.0 if discordant == 0 else float(binomtest(only_first, discordant, 0.5).pvalue)


def fisher(first: Rate, second: Rate) -> float:
    """The two-sided p of Fisher's exact test that two rates are one."""
    table = [[rate.successes, rate.total - rate.successes] for rate in (first, second)]
    return float(fisher_exact(table).pvalue)
