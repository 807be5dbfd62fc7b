"""Summarises results: success by mission, world, robot and variation, causes, times; compares two results."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final, NamedTuple

from scipy.stats import binomtest, fisher_exact

from executive.app.evaluate.results import Case, Evaluated, Evidence, RunSpec, Standing
from executive.view.html import render

_CONFIDENCE: Final = 0.95
MOST_PICTURE_BYTES: Final = 40_000_000
_ALL: Final = "all"
_PLAIN: Final = "as it is"


class Rate(NamedTuple):
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
        found = binomtest(self.successes, self.total).proportion_ci(_CONFIDENCE, method="wilson")
        return float(found.low), float(found.high)

    @property
    def interval_text(self) -> str:
        """The interval in per cent."""
        low, high = self.interval()
        return f"{low:.1%} to {high:.1%}"


@dataclass(frozen=True)
class Group:
    """Cases that have something in common: the mission, the world, the robots or what is varied."""

    dimension: str
    name: str
    cases: Sequence[Case]

    @property
    def label(self) -> str:
        """Dimension and name of the group, in words."""
        return label_of(self.dimension, self.name)

    @cached_property
    def rate(self) -> Rate:
        """The rate of success."""
        return Rate(sum(case.report.achieved for case in self.cases), len(self.cases))

    @cached_property
    def standings(self) -> Mapping[Standing, int]:
        """How many cases have each standing."""
        return Counter(case.standing for case in self.cases)

    def to_json(self) -> dict[str, Any]:
        """Its counts as JSON values."""
        rate = {"runs": self.rate.total, "achieved": self.rate.successes, "interval": self.rate.interval()}
        return {"dimension": self.dimension, "name": self.name, **rate, **totals_of(self.cases)}


def label_of(dimension: str, name: str) -> str:
    """A dimension and a name in words."""
    return name if dimension == _ALL else f"{dimension}: {name}"


def totals_of(cases: Sequence[Case]) -> Mapping[str, int]:
    """The counts of claims and verdicts, by their keys in JSON."""
    return {
        "successes": sum(case.report.claimed for case in cases),
        "referee_successes": sum(case.report.seen.success is True for case in cases),
        "false_claims": sum(case.standing is Standing.FALSE_CLAIM for case in cases),
    }


def groups_of(cases: Sequence[Case]) -> Sequence[Group]:
    """All runs, then those of each mission, world, robot and value that is varied, where there are several."""
    keyed = _keyed(cases)
    several = Counter(dimension for dimension, _ in keyed)
    order = list(several)
    groups = (Group(*key, found) for key, found in keyed.items() if key[0] == _ALL or several[key[0]] > 1)
    return sorted(groups, key=lambda group: order.index(group.dimension))


def _keyed(cases: Sequence[Case]) -> dict[tuple[str, str], list[Case]]:
    """The cases by dimension and name."""
    keyed: dict[tuple[str, str], list[Case]] = {(_ALL, "all runs"): list(cases)}
    for case in cases:
        for dimension, name in _keys(case):
            keyed.setdefault((dimension, name or _PLAIN), []).append(case)
    return keyed


def _keys(case: Case) -> Iterator[tuple[str, str]]:
    yield "mission", case.run.mission
    yield "world", case.report.world or case.run.request.world or ""
    yield "robots", ",".join(map(str, case.run.request.robots))
    yield from case.run.varied.items()
    if len(case.run.varied) > 1:
        yield "variation", case.run.variation_words


@dataclass(frozen=True)
class StandingRow:
    """A claim against a verdict: how many runs of all, and their causes with their numbers."""

    standing: Standing
    rate: Rate
    causes: Mapping[str, int]


def standing_rows(cases: Sequence[Case]) -> Sequence[StandingRow]:
    """The table of claims against verdicts; all runs but those of its first row are to be looked at."""
    found: dict[Standing, list[Case]] = {standing: [] for standing in Standing}
    for case in cases:
        found[case.standing].append(case)
    return [
        StandingRow(
            standing,
            Rate(len(own), len(cases)),
            dict(Counter(case.failure_cause for case in own if case.failure_cause).most_common()),
        )
        for standing, own in found.items()
    ]


def to_look_at(cases: Iterable[Case]) -> Sequence[Case]:
    """The runs that are not claimed and fulfilled, the gravest first."""
    order = list(Standing)
    found = [case for case in cases if case.standing is not Standing.FULFILLED]
    return sorted(found, key=lambda case: order.index(case.standing))


@dataclass(frozen=True)
class CauseRow:
    """A cause, how often, and its most frequent messages with their numbers."""

    cause: str
    runs: int
    messages: Mapping[str, int]


def causes_of(cases: Iterable[Case], *, most: int = 5) -> Sequence[CauseRow]:
    """The causes of what failed, the most frequent first."""
    why = defaultdict[str, Counter[str]](Counter)
    for case in cases:
        if case.cause:
            why[case.cause][case.why] += 1
    rows = [CauseRow(cause, found.total(), dict(found.most_common(most))) for cause, found in why.items()]
    return sorted(rows, key=lambda row: (-row.runs, row.cause))


@dataclass(frozen=True)
class TimeRow:
    """A skill: in how many runs it ran, how long in all (s, on the robot's clock), and its share of all runs' time."""

    skill: str
    runs: int
    sim_s: float
    share: float


def time_rows(cases: Sequence[Case]) -> Sequence[TimeRow]:
    """Where the time goes, the most first; the rest is what no skill took."""
    total_s = max(sum(case.report.sim_time_s for case in cases), 1e-9)
    spent = defaultdict[str, list[float]](list)
    for case in cases:
        for skill, seconds in case.steps_s.items():
            spent[skill].append(seconds)
    rows = [TimeRow(skill, len(each), sum(each), sum(each) / total_s) for skill, each in spent.items()]
    return sorted(rows, key=lambda row: -row.sim_s)


@dataclass(frozen=True)
class Comparison:
    """Two results, those `here` and those `there`: success of each, and how likely chance alone is (p).

    Of runs with one id in both, `only_here` and `only_there` succeeded in one of them alone (McNemar); where there is
    none, all runs of each are compared (Fisher).
    """

    dimension: str
    name: str
    paired: bool
    here: Rate
    there: Rate
    only_here: int
    only_there: int
    p: float


def comparisons_of(here: Sequence[Case], there: Sequence[Case]) -> Sequence[Comparison]:
    """Two results compared: in all, and by what the groups are by where both have it."""
    twins, others, found = {case.run.id: case for case in there}, _keyed(there), list[Comparison]()
    paired = any(case.run.id in twins for case in here)
    for group in groups_of(here):
        key = group.dimension, group.name
        if paired:
            own = [case for case in group.cases if case.run.id in twins]
            pairs = Counter((case.report.achieved, twins[case.run.id].report.achieved) for case in own)
            alone = pairs[True, False], pairs[False, True]
            first, second = (Rate(pairs[True, True] + only, len(own)) for only in alone)
            found.append(Comparison(*key, True, first, second, *alone, mcnemar(*alone)))
        elif key in others:
            rate = Group(*key, others[key]).rate
            found.append(Comparison(*key, False, group.rate, rate, 0, 0, fisher(group.rate, rate)))
    return found


def mcnemar(only_first: int, only_second: int) -> float:
    """The exact two-sided p of McNemar's test for pairs of which only one succeeded; 1 where there are none."""
    discordant = only_first + only_second
    return 1.0 if discordant == 0 else float(binomtest(only_first, discordant, 0.5).pvalue)


def fisher(first: Rate, second: Rate) -> float:
    """The two-sided p of Fisher's exact test that two rates are one."""
    table = [[rate.successes, rate.total - rate.successes] for rate in (first, second)]
    return float(fisher_exact(table).pvalue)


CommandOf = Callable[[RunSpec], str]
"""The command line that repeats a run alone."""


def standings_json(found: Evaluated, command_of: CommandOf) -> dict[str, Any]:
    """Claims against verdicts as JSON values: the counts, and each run that is to be looked at."""
    return {
        "standings": {
            row.standing.words: {"runs": row.rate.successes, "interval": row.rate.interval(), "causes": row.causes}
            for row in standing_rows(found.cases)
        },
        "to_look_at": [
            {
                "id": case.run.id,
                "standing": case.standing.words,
                "world": case.report.world,
                "seed": case.run.request.seed,
                "mission": case.run.mission,
                "asked": case.asked,
                "cause": case.report.cause,
                "why": case.why,
                "log": None if (folder := found.log_folder(case)) is None else str(folder),
                "command": command_of(case.run),
            }
            for case in to_look_at(found.cases)
        ],
    }


def summary_json(found: Evaluated, command_of: CommandOf, against: Sequence[Case] | None = None) -> dict[str, Any]:
    """All that the results say as JSON values, compared with the cases of another file where these are given."""
    cases = found.cases
    comparisons = {} if against is None else {"against": [asdict(each) for each in comparisons_of(cases, against)]}
    return {
        "scenario": found.about["scenario"],
        "runs": len(cases),
        **totals_of(cases),
        "groups": [group.to_json() for group in groups_of(cases)],
        "causes": [asdict(row) for row in causes_of(cases)],
        "skills": {row.skill: {"runs": row.runs, "sim_s": row.sim_s, "share": row.share} for row in time_rows(cases)},
        **comparisons,
        **standings_json(found, command_of),
    }


def to_page(
    found: Evaluated,
    evidence: Callable[[str], Evidence],
    command_of: CommandOf,
    *,
    against: Sequence[Case] | None = None,
    other: str = "",
) -> str:
    """The results as one HTML file that needs nothing else.

    `evidence` finds that of a run by its id; `against` are the cases of another results file, `other` its name.
    """
    cases, about = found.cases, found.about
    return render(
        "evaluation.html",
        title=Path(about["scenario"]).stem.replace("_", " "),
        facts=(
            ("scenario", about["scenario"]),
            ("runs with a result", f"{len(cases)} of {about['runs']}" if "runs" in about else str(len(cases))),
            ("version", about["code"]),
            ("missions per hour", about.get("missions_per_hour", "?")),
        ),
        groups=groups_of(cases),
        standings=standing_rows(cases),
        other=other,
        comparisons=None if against is None else comparisons_of(cases, against),
        causes=causes_of(cases),
        times=time_rows(cases),
        work=_mean_work(cases),
        to_look_at=[(*each, _repeats(found, each[0], command_of)) for each in _with_evidence(cases, evidence)],
    )


def _repeats(found: Evaluated, case: Case, command_of: CommandOf) -> Sequence[str]:
    """The commands that repeat a run, and print its log where that is on this machine."""
    folder = found.log_folder(case)
    return (command_of(case.run), *([] if folder is None else [f"errand log {folder / 'log.mcap'}"]))


def _with_evidence(cases: Sequence[Case], find: Callable[[str], Evidence]) -> Iterator[tuple[Case, Evidence, bool]]:
    """Each run that is to be looked at, its evidence, and whether there is room for its pictures."""
    room = MOST_PICTURE_BYTES
    for case in to_look_at(cases):
        evidence = find(case.run.id)
        size = sum(len(jpeg) for _, jpeg in evidence.pictures)
        has_room = size <= room
        room -= size if has_room else 0
        yield case, replace(evidence, pictures=evidence.pictures if has_room else ()), has_room


def _mean_work(cases: Sequence[Case]) -> Sequence[tuple[str, float]]:
    """The mean of each work counter, by name."""
    work = Counter[str]()
    for case in cases:
        work.update(case.report.work)
    return [(name, count / max(1, len(cases))) for name, count in sorted(work.items())]
