"""Evaluation at scale, in figures; prints JSON. Run one of:

python -m tests.benchmarks.evaluation report [--results 10000]  how long the report of so many results takes
python -m tests.benchmarks.evaluation kill [--runs 200]         a Dask worker killed by SIGKILL: lost or doubled
python -m tests.benchmarks.evaluation cluster [--runs 60]       2 workers against 1, and the overhead per mission
"""

import os
import random
import signal
import tempfile
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from executive.app.evaluate.evaluation import run_one
from executive.app.evaluate.results import Case, Evaluation, Evidence, ResultsFile, RunSpec
from executive.app.evaluate.summary import to_page
from executive.app.evaluate.workers import local_cluster
from executive.app.report.run_report import RunReport
from executive.mission.request import Request
from executive.words.goal import RefereeReport
from tests.benchmarks.harness import command

SHORT = "Hey Alice, go to the living room"


def runs_of(count):
    return tuple(RunSpec(Request(SHORT, seed=seed), SHORT, {"light": str(seed % 3)}) for seed in range(count))


def made_case(run):
    """A made result; every tenth has failed and has a timeline and a picture."""
    seed = run.request.seed
    rng, failed = random.Random(seed), seed % 10 == 0
    referee = RefereeReport(not failed, "so it is", 0, 0)
    ended = ("failure", "PLANNING", "no path") if failed else ("success", None, "done")
    report = RunReport(*ended, referee, (), "flat", seed, 60.0, 6.0, 10.0, 1200, "")
    report = replace(report, work={"plant_steps": rng.randrange(9999)})
    picture = np.random.default_rng(seed).integers(0, 255, (240, 320, 3), dtype=np.uint8)
    jpeg = cv2.imencode(".jpg", cv2.GaussianBlur(picture, (9, 9), 0), [cv2.IMWRITE_JPEG_QUALITY, 60])[1].tobytes()
    lines = tuple((float(t), "alice/go", "RUNNING: on the way") for t in range(40))
    evidence = Evidence(lines, (("hand camera", jpeg),)) if failed else Evidence()
    return Case(run, report, {"navigate": 40.0, "detect": rng.uniform(1, 9)}, evidence, 1.0, "here:1")


def report(results: int = 10_000):
    with tempfile.TemporaryDirectory() as folder:
        file, html, runs = Path(folder) / "r.sqlite", Path(folder) / "report.html", runs_of(results)
        with ResultsFile(file, create=True) as kept:
            kept.begin(Evaluation("made.yaml", runs), code="1")
            for run in runs:
                kept.add(made_case(run))
        began = time.perf_counter()
        with ResultsFile(file) as kept:
            made = kept.results()
            html.write_text(to_page(made, kept.evidence, against=made.cases, other="itself"))
        failures = sum(not case.report.achieved for case in made.cases)
        took_s = round(time.perf_counter() - began, 2)
        return {"results": results, "failures": failures, "took_s": took_s, "bytes": html.stat().st_size}


def cheap(run):
    time.sleep(0.05)
    return replace(made_case(run), worker=str(os.getpid()))


def kill(runs: int = 200):
    """Kills two workers while they work, and counts what the results file holds."""
    found, landed, killed = Counter(), Counter(), []
    with (
        tempfile.TemporaryDirectory() as folder,
        local_cluster(2) as workers,
        ResultsFile(Path(folder) / "r.sqlite", create=True) as kept,
    ):
        kept.begin(Evaluation("made.yaml", runs_of(runs)), code="1")
        for finished in workers.map_items(cheap, runs_of(runs)):
            assert finished.result is not None
            found[finished.item.id] += 1
            landed[finished.item.id] += kept.add(finished.result)
            if found.total() in (runs // 4, runs // 2):
                killed.append(finished.result.worker)
                os.kill(int(finished.result.worker), signal.SIGKILL)
        lost = runs - len(kept.done_ids())
    doubled = sum(number > 1 for number in (*found.values(), *landed.values()))
    return {"runs": runs, "killed": len(killed), "lost": lost, "doubled": doubled}


def cluster(runs: int = 60):
    """Times the same runs by one worker and by two, each warmed by two missions."""
    walls, overheads, digests = {}, {}, {}
    for number in (1, 2):
        with local_cluster(number) as workers:
            list(workers.map_items(run_one, runs_of(2 * number)))
            began = time.perf_counter()
            cases = [one.result for one in workers.map_items(run_one, runs_of(runs)) if one.result is not None]
            walls[number] = round(time.perf_counter() - began, 1)
        digests[number] = {case.run.id: case.digest for case in cases}
        overheads[number] = round(number * walls[number] / sum(case.spent_s for case in cases) - 1.0, 4)
    equal, faster = digests[1] == digests[2], round(walls[1] / walls[2], 2)
    return {"runs": runs, "wall_s": walls, "overhead": overheads, "times_faster": faster, "equal_results": equal}


if __name__ == "__main__":
    command(report, kill, cluster)
