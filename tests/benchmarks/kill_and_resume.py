"""Kills a mission at random moments of its robot's clock and resumes it; counts how often that ends right.

    python -m tests.benchmarks.kill_and_resume [--moments 30] [--seed 1] [--two] [--jobs 1] [--out FOLDER]

The moments come from the seed; the process that runs the mission is killed with SIGKILL when its plant has come to the
moment. With `--two` two robots have a part each, at the same time. Prints JSON.
"""

import subprocess
import time

import numpy as np

from executive.record.history import read_events
from tests.benchmarks.errand_process import ROOT, errand, kill_at, report_of, run_errand
from tests.benchmarks.harness import benchmark, totals

MISSIONS = (
    ("Hey Alice, can you fetch me a drink from the kitchen", 50.0),
    ("Hey Alice, take a drink from the kitchen to the sideboard", 60.0),
)
TWO = ("Alice, take a beer from the kitchen to the coffee table, and Bob, go to the office", 70.0)


def cases(moments: int = 30, seed: int = 1, two: bool = False):
    """Numbers and moments, with the sentences and the robots of each."""
    rng = np.random.default_rng(seed)
    for number in range(1, moments + 1):
        sentence, length_s = TWO if two else MISSIONS[number % len(MISSIONS)]
        yield number, round(float(rng.uniform(0.2, length_s)), 3), sentence, "alice=spot,bob=fetch" if two else ""


def run_case(number, moment_s, sentence, robots, folder):
    """Runs, kills and resumes a mission; one that has ended before the moment is killed at an earlier one."""
    begun = time.perf_counter()
    asked = ["run", "--say", sentence, "--seed", number, "--out", folder, "--no-record", "--quiet", "--json"]
    with (folder / "first.txt").open("wb") as told:
        command = errand(*asked, *(["--robots", robots] if robots else []))
        process = subprocess.Popen(command, cwd=ROOT, stdout=told, stderr=subprocess.STDOUT)
        killed = kill_at(process, folder, moment_s)
    if not killed:
        (folder / "earlier").mkdir()
        return run_case(number, 0.7 * moment_s, sentence, robots, folder / "earlier")
    ended = run_errand("resume", "--out", folder, "--quiet", "--json")
    text = ended.stdout + ended.stderr
    (folder / "second.txt").write_text(text)
    report = report_of(text)
    lifts = sum(" lifted the " in line and line.startswith("  ") for line in text.splitlines())
    every = list(report.get("robots", {}).values()) or [report]
    right = all(each.get("outcome") == "success" and each["referee"]["success"] for each in every)
    right = right and (bool(robots) or lifts == 1)  # of several robots the lifts are not told
    message = f"{report.get('message', 'no report')} / {report.get('referee', {}).get('why', '')}"
    wall_s = round(time.perf_counter() - begun, 1)
    right = right and not done_twice(folder)
    told = {"moment_s": moment_s, "lifts": lifts, "wall_s": wall_s, "message": message}
    return {"number": number, "right": right, **told}


def done_twice(folder):
    """True if the logs tell that a leaf which changes the world did its work to the end more than once."""
    done = []
    for log in sorted(folder.glob("log*.mcap")):
        for event in read_events(log):
            told = event.data
            work = event.topic == "transitions" and told["to"] == "SUCCESS" and not told.get("restored", False)
            if work and told["node"].rsplit("/", 1)[-1] in ("grasp", "place"):
                done.append((told["robot"], told["node"].rsplit("/", 1)[-1]))
    return len(done) > len(set(done))


def summary(trials):
    return {"trials": len(trials), **totals(trials, "right"), "wrong": [e.number for e in trials if not e.right]}


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
