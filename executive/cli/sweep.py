"""Many seeds: each in a process of its own, several at a time, so that one that dies takes no other along."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from executive.app.report import VERDICTS, RefereeReport, RunReport
from executive.mission.request import Request
from executive.mission.scenario import NO_SCENARIO, Scenario
from executive.words.slug import slug
from skills.files.errors import InputError

COUNTS: Final = ("successes", "referee_successes", "false_claims")
Found = tuple[str, Sequence[RunReport]]
"""A condition's name, and its reports."""


def conditions(asked: Request, *, each: bool) -> list[tuple[str, Request]]:
    """The request under each condition by name: with all its faults and scenarios, or without, and with `each` alone.

    Raises InputError: there are none to try alone.
    """
    if not each:
        return [("", asked)]
    scenario = asked.scenario
    plain = replace(asked, scenario=NO_SCENARIO, scenario_files=())
    alone = [(words, replace(plain, scenario=Scenario((words,)))) for words in scenario.faults]
    alone += [(str(path), replace(plain, scenario_files=(path,))) for path in asked.scenario_files]
    if scenario.random:
        alone.append((f"{scenario.random} random faults", replace(plain, scenario=Scenario(random=scenario.random))))
    if not alone:
        raise InputError("there is no fault to try alone", hint="give some by --fault, --random-faults or --scenario")
    return [("no fault", plain), *alone]


def folders(out: Path, names: Sequence[str]) -> list[Path]:
    """Where the logs under each condition go: a folder of its own in `out`, where there are several."""
    if len(names) == 1:
        return [out]
    return [out / f"{number}-{slug(name)}" for number, name in enumerate(names)]


def sweep(
    arguments: Sequence[str], seeds: Sequence[int], *, jobs: int, out: Path, done: Callable[[RunReport], None]
) -> tuple[RunReport, ...]:
    """Run `errand run ARGUMENTS` for each seed, unchecked; `done` is called as each ends. In the order of the seeds."""
    with ThreadPoolExecutor(max_workers=jobs) as pool:
        futures = {pool.submit(_run_one, tuple(arguments), seed, out / f"seed-{seed:03d}"): seed for seed in seeds}
        try:
            reports = {futures[future]: _told(future.result(), done) for future in as_completed(futures)}
        except KeyboardInterrupt:
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    return tuple(reports[seed] for seed in seeds)


def _told(report: RunReport, done: Callable[[RunReport], None]) -> RunReport:
    done(report)
    return report


def _run_one(arguments: tuple[str, ...], seed: int, out: Path) -> RunReport:
    own = ("--seed", str(seed), "--out", str(out), "--json", "--quiet", "--no-record", "--anyway")
    command = [sys.executable, "-m", "executive.cli", "run", *arguments, *own]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    last = ended.stdout.strip().rpartition("\n")[2]
    try:
        return RunReport.from_json(json.loads(last))
    except (ValueError, KeyError, TypeError):
        return _died(seed, out, ended.returncode, ended.stderr)


def _died(seed: int, out: Path, status: int, errors: str) -> RunReport:
    """The report of a process that gave none."""
    why = errors.strip().rpartition("\n")[2] or "it said nothing"
    return RunReport(
        outcome="error",
        cause="ERROR",
        message=f"the process ended with status {status}: {why}",
        referee=RefereeReport(False, "the run gave no report", 0, 0),
        commands=(),
        world="",
        seed=seed,
        sim_time_s=0.0,
        wall_time_s=0.0,
        real_time_factor=0.0,
        ticks=0,
        log=str(out / "log.mcap"),
    )


def totals(reports: Sequence[RunReport]) -> dict[str, Any]:
    """The sweep as JSON values: all runs, and the counts."""
    return {
        "runs": [report.to_json() for report in reports],
        "successes": sum(report.claimed for report in reports),
        "referee_successes": sum(report.seen.success is True for report in reports),
        "false_claims": sum(report.false_claim for report in reports),
    }


def condition_totals(found: Sequence[Found]) -> list[dict[str, Any]]:
    """For each condition its name, how many runs, and the counts."""
    return [
        {"condition": name, "runs": len(reports), **{key: totals(reports)[key] for key in COUNTS}}
        for name, reports in found
    ]


def condition_rows(found: Sequence[Found]) -> Iterator[tuple[str, ...]]:
    """The table of conditions, one row for each."""
    for each in condition_totals(found):
        yield tuple(str(each[key]) for key in ("condition", "runs", *COUNTS))


def rows(reports: Sequence[RunReport]) -> Iterator[tuple[str, ...]]:
    """The table of a sweep, one row for each run."""
    for report in reports:
        yield (
            str(report.seed),
            report.outcome,
            VERDICTS[report.seen.success],
            str(report.seen.collisions),
            str(report.seen.drops),
            f"{report.sim_time_s:.1f}",
            f"{report.real_time_factor:.1f}",
            report.message if report.seen.success else f"{report.message} / {report.seen.why}",
        )
