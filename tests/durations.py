"""Durations of all tests of a run: a table at its end, and with `--durations-file` the whole list as JSON.

`python -m tests.durations` writes the slow files of that list into `tests/slow.txt`, the slowest first. A run begins
with them, so that no process is left with one at the end; `--fast` leaves them out.
"""

from __future__ import annotations

import json
import resource
import time
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FILE, SLOW = ROOT / "out/tests/durations.json", ROOT / "tests/slow.txt"
PHASES = ("setup", "call", "teardown")
SHOWN = 15
SLOW_S = 2.0
"""Duration from which a file of tests is slow, with three processes on two cores."""


def add_option(parser):
    parser.addoption("--durations-file", type=Path, help="writes the seconds of every test as JSON, and shows a table")
    parser.addoption("--fast", action="store_true", help="leaves out the files of tests/slow.txt")


class Durations:
    """Plugin of the process that reports: sums up the phases of each test, wherever it ran."""

    def __init__(self, file: Path) -> None:
        self.file, self.began_s = file, time.monotonic()
        self.seconds: dict[str, dict[str, float]] = defaultdict(lambda: dict.fromkeys(PHASES, 0.0))
        self.collected_s = 0.0

    def pytest_collection_finish(self):
        if not self.seconds:  # a worker that takes the place of one that crashed collects later
            self.collected_s = time.monotonic() - self.began_s

    def pytest_xdist_node_collection_finished(self):
        self.pytest_collection_finish()

    def pytest_runtest_logreport(self, report):
        if report.when in PHASES:  # a worker that crashed reports its test once more, without a phase
            self.seconds[report.nodeid][report.when] += report.duration

    def pytest_terminal_summary(self, terminalreporter):
        measured = self.measured()
        self.file.parent.mkdir(parents=True, exist_ok=True)
        self.file.write_text(json.dumps(measured, indent=1))
        line = terminalreporter.write_line
        for what in ("files", "tests"):
            line(f"slowest {what}:   all  setup   call  (seconds)")
            for row in measured[what][:SHOWN]:
                line(f"{row['seconds']:21.1f} {row['setup']:6.1f} {row['call']:6.1f}  {row['name']}")
        wall_s, cpu_s = measured["wall_s"], measured["cpu_s"]
        line(f"collection {measured['collection_s']:.0f} s; in all {wall_s:.0f} s, CPU {cpu_s:.0f} s")

    def measured(self):
        """Files and tests, the slowest first, and the totals."""
        files = defaultdict(lambda: dict.fromkeys(PHASES, 0.0))
        for test, phases in self.seconds.items():
            for phase, seconds in phases.items():
                files[test.partition("::")[0]][phase] += seconds
        usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        return {
            "collection_s": self.collected_s,
            "wall_s": time.monotonic() - self.began_s,
            "cpu_s": sum(each.ru_utime + each.ru_stime for each in usage),
            "files": rows(files),
            "tests": rows(self.seconds),
        }


def slowest_first(items):
    """Sorts tests by the place of their files in the list of slow ones."""
    order = {path: place for place, path in enumerate(slow_files())}
    items.sort(key=lambda item: order.get(item.path, len(order)))


def slow_files():
    return [ROOT / line for line in SLOW.read_text().splitlines()]


class Fast:
    """Plugin that collects no tests of slow files."""

    def __init__(self) -> None:
        self.slow = frozenset(slow_files())

    def pytest_ignore_collect(self, collection_path):
        return True if collection_path in self.slow else None

    def pytest_terminal_summary(self, terminalreporter):
        terminalreporter.write_line(f"left out: the {len(self.slow)} slow files of tests/slow.txt")


def rows(seconds):
    found = [{"name": name, "seconds": sum(phases.values()), **phases} for name, phases in seconds.items()]
    return sorted(found, key=lambda row: -row["seconds"])


def main():
    if not FILE.is_file():
        raise SystemExit(f"there is no {FILE.relative_to(ROOT)}: run `make test` first")
    files = json.loads(FILE.read_text())["files"]
    SLOW.write_text("".join(f"{row['name']}\n" for row in files if row["seconds"] > SLOW_S))


if __name__ == "__main__":
    main()
