"""Twelve runs of fixed seeds, kept and compared: whether a change of the code changes what robots do.

    python -m tests.benchmarks.equal_logs keep FOLDER [--only fetch,resume] [--jobs 2]
    python -m tests.benchmarks.equal_logs compare FOLDER [--only fetch,resume] [--jobs 2]

`keep` writes FOLDER/NAME.json.xz for each run: exit code, result, and what its logs tell but for pictures and wall
time.
`compare` does the runs again, prints `equal` or the first differences of each, and ends with 1 where one differs.
"""

import hashlib
import json
import lzma
import shlex
import subprocess
import tempfile
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from itertools import zip_longest
from pathlib import Path
from typing import Literal

from executive.record.history import read_events
from tests.benchmarks.errand_process import ROOT, errand, kill_at, run_errand
from tests.benchmarks.harness import command, tell

MOST_DIFFERENCES = 5
RESUMED_AT_S = 50.0
VOLATILE = frozenset({"versions", "wall_time_s", "real_time_factor", "bytes_logged", "log", "report", "page"})
"""What a result or a message tells that is not the same in two equal runs."""
LEFT_OUT = frozenset({"wall", "map"})
"""Topics of wall time, and of what stands in the world's files anyway."""
TOLD_WHOLE = frozenset({"transitions", "answer", "speech", "run", "taskChannel", "missions"})
"""Topics whose messages are kept, so that a difference can be shown; of all others a digest is."""

QUEUED = ("go to the office", "take a coke to the desk", "go to the bedroom", "go to the hall")
"""Sentences in the queue of the run `fleet`; the run `resume` is killed once and resumed."""
CASES = {
    "fetch": "run --say 'fetch me a coke' --seed 1",
    "deliver": "run missions/deliver.yaml --seed 2",
    "decisions": "run --seed 3 --say "
    "'if there is a beer in the kitchen, take it to the coffee table, otherwise go to the office'",
    "together": "run missions/speak_while_driving.yaml --seed 4",
    "ask": "run missions/tea_or_coffee.yaml --seed 5 --answer coffee --answer two",
    "two_robots": "run missions/two_robots.yaml --seed 6",
    "fleet": "fleet run {out} --robots alice=spot,carol=spot,bob=fetch,dave=fetch --seed 7",
    "shop": "run --say 'bring me a beer' --seed 8 --world shop",
    "lab": "run --say 'go to the storage' --seed 9 --world lab",
    "resume": "run --say 'fetch me a drink from the kitchen' --seed 10",
    "fault": "run --say 'fetch me a coke' --seed 11 --fault 'camera.hand: dropout 5 s at 20 s'",
    "question": "run --say 'is there a beer in the kitchen?' --seed 12",
}


def run_case(name, out):
    """Runs a case in an empty folder; returns its exit code, result and events."""
    for sentence in QUEUED if name == "fleet" else ():
        ended = run_errand("queue", "add", "--store", out / "missions.sqlite", "--say", sentence)
        if ended.returncode != 0:
            raise RuntimeError(ended.stderr)
    fixed = ("--quiet", "--json", "--no-record")
    run = (*(word.format(out=out) for word in shlex.split(CASES[name])), *fixed, "--out", out)
    if name != "resume":
        ended = run_errand(*run)
    else:
        process = subprocess.Popen(errand(*run), cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        if not kill_at(process, out, RESUMED_AT_S):
            raise RuntimeError(f"it was over before {RESUMED_AT_S} s")
        ended = run_errand("resume", "--out", out, *fixed[:2])
    return {
        "exit": ended.returncode,
        "result": steady(json.loads(ended.stdout.splitlines()[-1])) if ended.stdout.strip() else ended.stderr,
        "logs": [list(lines(read_events(log), str(log.parent))) for log in sorted(out.rglob("log*.mcap"))],
    }


def steady(value):
    """What a result or message tells, without what differs between two equal runs."""
    if isinstance(value, Mapping):
        return {key: steady(each) for key, each in value.items() if key not in VOLATILE}
    return [steady(each) for each in value] if isinstance(value, list) else value


def lines(events, out):
    """A line for each event: its moment (s), its topic, and what it tells or a digest of that."""
    for event in events:
        if event.topic not in LEFT_OUT and event.data.get("format") not in ("jpeg", "png"):
            told = json.dumps(steady(event.data), sort_keys=True, ensure_ascii=False).replace(out, "OUT")
            kept = told if event.topic in TOLD_WHOLE else hashlib.sha256(told.encode()).hexdigest()[:12]
            yield f"{event.stamp_s:.3f} {event.topic} {kept}"


def differences(before, now):
    """What differs between a run as it was kept and as it is, in lines of the form `- before`, `+ now`."""
    for key in ("exit", "result"):
        if before[key] != now[key]:
            yield f"{key}\n  - {before[key]}\n  + {now[key]}"
    if len(before["logs"]) != len(now["logs"]):
        yield f"{len(before['logs'])} logs\n  + {len(now['logs'])}"
    for number, (old, new) in enumerate(zip(before["logs"], now["logs"], strict=False)):
        for line, (mine, other) in enumerate(zip_longest(old, new, fillvalue="(nothing)"), start=1):
            if mine != other:
                yield f"log {number}, event {line} of {len(old)} and {len(new)}\n  - {mine}\n  + {other}"


def keep(folder, name):
    folder.mkdir(parents=True, exist_ok=True)
    found = _timed(name)
    (folder / f"{name}.json.xz").write_bytes(lzma.compress(json.dumps(found).encode()))
    return f"{name}: exit {found['exit']}, {sum(map(len, found['logs']))} events"


def compare(folder, name):
    before = json.loads(lzma.decompress((folder / f"{name}.json.xz").read_bytes()))
    found = list(differences(before, _timed(name)))
    if not found:
        return f"{name}: equal, {sum(map(len, before['logs']))} events"
    return "\n".join([f"{name}: {len(found)} differences", *found[:MOST_DIFFERENCES]])


def _timed(name):
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="errand-equal-") as folder:
        found = run_case(name, Path(folder))
    tell(f"{name}: {time.perf_counter() - begun:.0f} s")
    return found


def main(what: Literal["keep", "compare"], folder: Path, only: tuple[str, ...] = tuple(CASES), jobs: int = 1):
    """Keeps or compares runs; returns 1 when one differs."""
    work = keep if what == "keep" else compare
    all_equal = True
    with ThreadPoolExecutor(jobs) as threads:
        for line in threads.map(lambda name: work(folder, name), only):
            print(line, flush=True)
            all_equal = all_equal and "differences" not in line.partition("\n")[0]
    return 0 if all_equal else 1


if __name__ == "__main__":
    command(main)
