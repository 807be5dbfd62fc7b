"""Summarises results: success by mission, world, robot and variation, causes, times; compares two results."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any, Final, NamedTuple

from scipy.stats import binomtest, fisher_exact

from executive.app.evaluate.results import Case, Evidence, Results, Standing
from executive.app.report.run_report import DATE, title_of
from executive.mission.request_fields import command_of
from executive.view.html import render

_CONFIDENCE: Final = 0.95
MOST_PICTURE_BYTES: Final = 40_000_000
_ALL: Final = "all"
_PLAIN: Final = "as it is"


class Rate(NamedTuple):
    """Success rate: successes in a number of runs."""

    successes: int
    total: int

    @property
    def value(self) -> float:
        """Success rate as a fraction (0 to 1); 0 without runs."""
        return self.successes / self.total if self.total else 0.0

    def interval(self) -> tuple[float, float]:
        """Wilson score interval, 95 %; (0, 1) without runs (Wilson 1927)."""
        if not self.total:
            return 0.0, 1.0
        found = binomtest(self.successes, self.total).proportion_ci(_CONFIDENCE, method="wilson")
        return float(found.low), float(found.high)

    @property
    def interval_text(self) -> str:
        """95 % interval in per cent, as text."""
        low, high = self.interval()
        return f"{low:.1%} to {high:.1%}"


@dataclass(frozen=True)
class Group:
    """Cases that share a mission, a world, the robots or a varied value."""

    dimension: str
    name: str
    cases: Sequence[Case]

    @property
    def label(self) -> str:
        """Dimension and value in words."""
        return label_of(self.dimension, self.name)

    @cached_property
    def rate(self) -> Rate:
        """Success rate of the cases."""
        return Rate(sum(case.report.achieved for case in self.cases), len(self.cases))

    @cached_property
    def standings(self) -> Mapping[Standing, int]:
        """Number of cases with each standing."""
        return Counter(case.standing for case in self.cases)

    def to_json(self) -> dict[str, Any]:
        """Returns the group's counts as JSON values."""
        rate = {"runs": self.rate.total, "achieved": self.rate.successes, "interval": self.rate.interval()}
        return {"dimension": self.dimension, "name": self.name, **rate, **totals_of(self.cases)}


def label_of(dimension: str, name: str) -> str:
    """Returns a dimension and a name in words."""
    return name if dimension == _ALL else f"{dimension}: {name}"


def totals_of(cases: Sequence[Case]) -> Mapping[str, int]:
    """Returns the number of claimed successes, of confirmed successes and of false claims, by JSON key."""
    return {
        "successes": sum(case.report.claimed for case in cases),
        "referee_successes": sum(case.report.seen.success is True for case in cases),
        "false_claims": sum(case.standing is Standing.FALSE_CLAIM for case in cases),
    }


def groups_of(cases: Sequence[Case]) -> Sequence[Group]:
    """Returns the group of all runs, then a group for each mission, world, robot and varied value among several."""
    keyed = _keyed(cases)
    several = Counter(dimension for dimension, _ in keyed)
    order = list(several)
    groups = (Group(*key, found) for key, found in keyed.items() if key[0] == _ALL or several[key[0]] > 1)
    return sorted(groups, key=lambda group: order.index(group.dimension))


def _keyed(cases: Sequence[Case]) -> dict[tuple[str, str], list[Case]]:
    """Groups the cases by dimension and value."""
    keyed: dict[tuple[str, str], list[Case]] = {(_ALL, "all runs"): list(cases)}
    for case in cases:
        run, world = case.run, case.report.world or case.run.request.world or ""
        keys = {"mission": run.mission, "world": world, "robots": ",".join(map(str, run.request.robots)), **run.varied}
        keys |= {"variation": run.variation_words} if len(run.varied) > 1 else {}
        for dimension, name in keys.items():
            keyed.setdefault((dimension, name or _PLAIN), []).append(case)
    return keyed


@dataclass(frozen=True)
class StandingRow:
    """Row of the table of claims against verdicts: fraction of all runs, and how often each failure cause occurred."""

    standing: Standing
    rate: Rate
    causes: Mapping[str, int]


def standing_rows(cases: Sequence[Case]) -> Sequence[StandingRow]:
    """Returns the table of claims against verdicts, with a row for each standing."""
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


def cases_to_inspect(cases: Iterable[Case]) -> Sequence[Case]:
    """Returns the cases that need inspection, the gravest first: all but successes that the referee confirms."""
    order = list(Standing)
    found = [case for case in cases if case.standing is not Standing.FULFILLED]
    return sorted(found, key=lambda case: order.index(case.standing))


@dataclass(frozen=True)
class CauseRow:
    """Cause of failures: number of runs that failed for it, and how often each of its commonest messages occurred."""

    cause: str
    runs: int
    messages: Mapping[str, int]


def causes_of(cases: Iterable[Case], *, most: int = 5) -> Sequence[CauseRow]:
    """Returns the causes of failures, the most frequent first."""
    why = defaultdict[str, Counter[str]](Counter)
    for case in cases:
        if case.cause:
            why[case.cause][case.why] += 1
    rows = [CauseRow(cause, found.total(), dict(found.most_common(most))) for cause, found in why.items()]
    return sorted(rows, key=lambda row: (-row.runs, row.cause))


@dataclass(frozen=True)
class TimeRow:
    """Run time of a skill: number of runs, total (s, on the robot's clock), and fraction of the time of all runs."""

    skill: str
    runs: int
    sim_s: float
    share: float


def time_rows(cases: Sequence[Case]) -> Sequence[TimeRow]:
    """Returns the run time of each skill, the longest first."""
    total_s = max(sum(case.report.sim_time_s for case in cases), 1e-9)
    spent = defaultdict[str, list[float]](list)
    for case in cases:
        for skill, seconds in case.steps_s.items():
            spent[skill].append(seconds)
    rows = [TimeRow(skill, len(each), sum(each), sum(each) / total_s) for skill, each in spent.items()]
    return sorted(rows, key=lambda row: -row.sim_s)


@dataclass(frozen=True)
class Comparison:
    """Comparison of the rates `here` and `there` of two results files, with the p-value.

    Runs with the same id are paired: `only_here` and `only_there` count runs that succeeded in one file only
    (McNemar's test). Without pairs, all runs of each file are compared (Fisher's test).
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
    """Compares two results: all runs, and each group that both have."""
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
    """Exact two-sided p of McNemar's test, from the pairs with one success; 1 without such pairs."""
    discordant = only_first + only_second
    return 1.0 if discordant == 0 else float(binomtest(only_first, discordant, 0.5).pvalue)


def fisher(first: Rate, second: Rate) -> float:
    """Two-sided p of Fisher's exact test for two rates."""
    table = [[rate.successes, rate.total - rate.successes] for rate in (first, second)]
    return float(fisher_exact(table).pvalue)


def standings_json(found: Results) -> dict[str, Any]:
    """Returns claims against verdicts as JSON values: the counts, and each run that failed or made a false claim."""
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
                "command": command_of(case.run.request),
            }
            for case in cases_to_inspect(found.cases)
        ],
    }


def summary_json(found: Results, against: Sequence[Case] | None = None) -> dict[str, Any]:
    """Returns the summary as JSON values, with a comparison if the cases of another file are given."""
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
        **standings_json(found),
    }


def to_page(
    found: Results, evidence: Callable[[str], Evidence], *, against: Sequence[Case] | None = None, other: str = ""
) -> str:
    """Renders the results as one HTML file that needs no other file.

    `evidence` returns a run's evidence by the run's id; `against` are the cases of another results file, named `other`.
    """
    cases, about, work = found.cases, found.about, Counter[str]()
    for case in cases:
        work.update(case.report.work)
    inspected = list[tuple[Case, Evidence, bool, Sequence[str]]]()
    for case, seen, has_pictures in _with_evidence(cases, evidence):
        folder = found.log_folder(case)
        log = [] if folder is None else [f"errand log {folder / 'log.mcap'}"]
        inspected.append((case, seen, has_pictures, (command_of(case.run.request), *log)))
    return render(
        "evaluation.html",
        title=title_of(case.run.mission for case in cases) if cases else Path(about["scenario"]).stem,
        facts=(
            ("evaluation", about["scenario"]),
            ("runs with a result", f"{len(cases)} of {about['runs']}" if "runs" in about else str(len(cases))),
            ("date", datetime.now().strftime(DATE)),
            ("version", about["code"]),
            ("missions per hour", about.get("missions_per_hour", "?")),
        ),
        groups=groups_of(cases),
        standings=standing_rows(cases),
        other=other,
        comparisons=None if against is None else comparisons_of(cases, against),
        causes=causes_of(cases),
        times=time_rows(cases),
        work=[(name, count / max(1, len(cases))) for name, count in sorted(work.items())],
        to_look_at=inspected,
    )


def _with_evidence(cases: Sequence[Case], find: Callable[[str], Evidence]) -> Iterator[tuple[Case, Evidence, bool]]:
    """Yields each case to inspect with its evidence, and whether its pictures still fit into the page's size limit."""
    left_bytes = MOST_PICTURE_BYTES
    for case in cases_to_inspect(cases):
        evidence = find(case.run.id)
        size = sum(len(jpeg) for _, jpeg in evidence.pictures)
        fits = size <= left_bytes
        left_bytes -= size if fits else 0
        yield case, replace(evidence, pictures=evidence.pictures if fits else ()), fits
