"""Kills a mission at random moments of its robot's clock and takes it up; counts how often that ends right.

Run it by hand, it takes a while: `python tests/benchmarks/kill_and_resume.py --moments 30`. The moments come from a
seed; the process that runs the mission is killed with SIGKILL when its plant has come to the moment. With `--two` two
robots have a part each, at the same time.
"""

from __future__ import annotations

import argparse
import json
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from executive.record.history import read_events
from executive.store.resuming import is_from_before
from plant.diagram import TIME_STEP_S
from plant.snapshot_file import SnapshotError, read_snapshot

FETCH = ("Hey Alice, can you fetch me a drink from the kitchen", 50.0)
TIDY = ("Hey Alice, take a drink from the kitchen to the sideboard", 60.0)
MISSIONS = (FETCH, TIDY)
TWO = ("Alice, take a beer from the kitchen to the coffee table, and Bob, go to the office", 70.0)
ROBOTS = "alice=spot,bob=fetch"


@dataclass(frozen=True)
class Trial:
    """One kill: at which moment (s) of which mission, and what came of it."""

    number: int
    sentence: str
    moment_s: float
    seed: int
    right: bool
    lifts: int
    wall_s: float
    message: str


def trial(number: int, sentence: str, moment_s: float, seed: int, out: Path, robots: str | None = None) -> Trial:
    """Run, kill, resume; a mission that has ended before the moment is killed at an earlier one.

    Raises FileExistsError when `out` is there already, since what lies in it would be taken for this run's.
    """
    out.mkdir(parents=True)
    begun = time.perf_counter()
    command = [sys.executable, "-m", "executive.cli"]
    asked = ["run", "--say", sentence, "--seed", str(seed), "--out", str(out), "--no-record", "--quiet", "--json"]
    asked += [] if robots is None else ["--robots", robots]
    with (out / "first.txt").open("wb") as told:
        process = subprocess.Popen([*command, *asked], stdout=told, stderr=subprocess.STDOUT)
        killed = kill_at(process, out / ".errand" / "missions.plant", moment_s)
    if not killed:
        return trial(number, sentence, 0.7 * moment_s, seed, out / "earlier", robots)
    again = [*command, "resume", "--out", str(out), "--quiet", "--json"]
    ended = subprocess.run(again, capture_output=True, text=True, check=False)
    text = ended.stdout + ended.stderr
    (out / "second.txt").write_text(text)
    report = _report(text)
    lifts = sum(" lifted the " in line and line.startswith("  ") for line in text.splitlines())
    every = list(report.get("robots", {}).values()) or [report]
    right = all(each.get("outcome") == "success" and each["referee"]["success"] for each in every)
    right = right and (robots is not None or lifts == 1)  # of several robots the lifts are not told
    message = f"{report.get('message', 'no report')} / {report.get('referee', {}).get('why', '')}"
    wall_s = time.perf_counter() - begun
    return Trial(number, sentence, moment_s, seed, right and not _done_twice(out), lifts, wall_s, message)


def kill_at(process: subprocess.Popen[bytes], plant: Path, moment_s: float) -> bool:
    """Kill the process when its plant's clock has come to the moment; False when it ended before."""
    while process.poll() is None:
        try:
            now_s = read_snapshot(plant).values["engine"]["steps"] * TIME_STEP_S
        except SnapshotError:
            now_s = 0.0
        if now_s >= moment_s:
            process.send_signal(signal.SIGKILL)
            process.wait()
            return True
        time.sleep(0.01)
    return False


def _report(text: str) -> dict[str, Any]:
    lines = [line for line in text.splitlines() if line.startswith("{")]
    return dict(json.loads(lines[-1])) if lines else {}


def _done_twice(out: Path) -> bool:
    """Whether both logs tell that one leaf which changes the world did its work to the end."""
    done: list[tuple[str, str]] = []
    for log in sorted(out.glob("log*.mcap")):
        for event in read_events(log):
            told = event.data
            work = event.topic == "transitions" and told["to"] == "SUCCESS" and not is_from_before(told["message"])
            if work and told["node"].rsplit("/", 1)[-1] in ("grasp", "place"):
                done.append((told["robot"], told["node"].rsplit("/", 1)[-1]))
    return len(done) > len(set(done))


def main() -> None:
    """All trials, and a table of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--moments", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--two", action="store_true", help="two robots, with a part each")
    parser.add_argument("--out", type=Path, default=None)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    folder = options.out or Path(tempfile.mkdtemp(prefix="errand-kills-"))
    right = 0
    for number in range(1, options.moments + 1):
        sentence, length_s = TWO if options.two else MISSIONS[number % len(MISSIONS)]
        moment_s = float(rng.uniform(0.2, length_s))
        if number < options.first:
            continue
        done = trial(number, sentence, moment_s, number, folder / f"{number:02d}", ROBOTS if options.two else None)
        right += done.right
        verdict = "right" if done.right else "WRONG"
        line = f"{number:3d}  killed at {done.moment_s:5.1f} s  {verdict}  {done.lifts} lifts  {done.wall_s:5.1f} s"
        sys.stdout.write(f"{line}  {sentence[-30:]}: {done.message}\n")
        sys.stdout.flush()
    sys.stdout.write(f"{right} of {options.moments - options.first + 1} right\n")


if __name__ == "__main__":
    main()
