"""Evaluation at scale, in figures. Run one of:

python -m tests.benchmarks.evaluation report [--results 10000]     how long the report of so many results takes
python -m tests.benchmarks.evaluation kill [--runs 200]            a Dask worker killed by SIGKILL: lost or doubled
python -m tests.benchmarks.evaluation cluster [--runs 60]          2 workers against 1, and the overhead per mission
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import tempfile
import time
from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from executive.app.evaluate.evaluation import run_one
from executive.app.evaluate.results import Case, Evaluation, Evidence, ResultsFile, RunSpec
from executive.app.evaluate.summary import to_page
from executive.app.evaluate.workers import local_cluster
from executive.app.report import RunReport
from executive.cli.evaluate_command import command_of
from executive.mission.request import Request
from executive.words.goal import RefereeReport

SHORT = "Hey Alice, go to the living room"


def runs_of(count: int) -> tuple[RunSpec, ...]:
    return tuple(RunSpec(Request(SHORT, seed=seed), SHORT, {"light": str(seed % 3)}) for seed in range(count))


def made_case(run: RunSpec) -> Case:
    """A made result; every tenth has failed and has a timeline and a picture."""
    rng = random.Random(run.request.seed)
    failed = run.request.seed % 10 == 0
    referee = RefereeReport(not failed, "so it is", 0, 0)
    ended = ("failure", "PLANNING", "no path") if failed else ("success", None, "done")
    report = RunReport(*ended, referee, (), "flat", run.request.seed, 60.0, 6.0, 10.0, 1200, "")
    report = replace(report, work={"plant_steps": rng.randrange(9999)})
    picture = np.random.default_rng(run.request.seed).integers(0, 255, (240, 320, 3), dtype=np.uint8)
    jpeg = cv2.imencode(".jpg", cv2.GaussianBlur(picture, (9, 9), 0), [cv2.IMWRITE_JPEG_QUALITY, 60])[1].tobytes()
    lines = tuple((float(t), "alice/go", "RUNNING: on the way") for t in range(40))
    evidence = Evidence(lines, (("hand camera", jpeg),)) if failed else Evidence()
    return Case(run, report, {"navigate": 40.0, "detect": rng.uniform(1, 9)}, evidence, 1.0, "here:1")


def report(count: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path, runs = Path(folder) / "r.sqlite", runs_of(count)
        with ResultsFile(path, create=True) as kept:
            kept.begin(Evaluation("made.yaml", runs), code="1")
            for run in runs:
                kept.add(made_case(run))
        began = time.perf_counter()
        with ResultsFile(path) as kept:
            made = kept.results()
            html = Path(folder) / "report.html"
            html.write_text(to_page(made, kept.evidence, command_of, against=made.cases, other="itself"))
        failed = sum(not case.report.achieved for case in made.cases)
        print(f"{count} results ({failed} failures): {time.perf_counter() - began:.2f} s, {html.stat().st_size} bytes")


def cheap(run: RunSpec) -> Case:
    """A run that takes 0.05 s and tells in which process."""
    time.sleep(0.05)
    return replace(made_case(run), worker=str(os.getpid()))


def kill(count: int) -> None:
    """Kill two workers while they work, and count what the results file holds."""
    found, landed, killed = Counter[str](), Counter[str](), list[str]()
    with tempfile.TemporaryDirectory() as folder, local_cluster(2) as workers:
        runs = runs_of(count)
        with ResultsFile(Path(folder) / "r.sqlite", create=True) as kept:
            kept.begin(Evaluation("made.yaml", runs), code="1")
            for finished in workers.map_items(cheap, runs):
                assert finished.result is not None
                found[finished.item.id] += 1
                landed[finished.item.id] += kept.add(finished.result)
                if found.total() in (count // 4, count // 2):
                    killed.append(finished.result.worker)
                    os.kill(int(finished.result.worker), signal.SIGKILL)
            lost = count - len(kept.done_ids())
            doubled = sum(number > 1 for number in (*found.values(), *landed.values()))
    print(f"{count} runs, workers killed {len(killed)}: lost {lost}, doubled {doubled}")


def cluster(count: int) -> None:
    """The same runs by one worker and by two, each warmed by two missions."""
    walls, digests = {}, {}
    for number in (1, 2):
        with local_cluster(number) as workers:
            list(workers.map_items(run_one, runs_of(2 * number)))
            began = time.perf_counter()
            cases = [one.result for one in workers.map_items(run_one, runs_of(count)) if one.result is not None]
            walls[number] = time.perf_counter() - began
            digests[number] = {case.run.id: case.digest for case in cases}
            spent = sum(case.spent_s for case in cases)
            overhead = number * walls[number] / spent - 1.0
            print(f"{number} workers: {walls[number]:.1f} s for {len(cases)} runs, dispatch {overhead:.2%}")
    print(f"2 against 1: {walls[1] / walls[2]:.2f} x; equal results: {digests[1] == digests[2]}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("report", "kill", "cluster"))
    parser.add_argument("--results", type=int, default=10_000)
    parser.add_argument("--runs", type=int)
    options = parser.parse_args()
    chosen = {
        "report": partial(report, options.results),
        "kill": partial(kill, options.runs or 200),
        "cluster": partial(cluster, options.runs or 60),
    }
    chosen[options.what]()


if __name__ == "__main__":
    main()
