"""Durations of all tests of a run: a table at its end, and with `--durations-file` the whole list as JSON."""

from __future__ import annotations

import json
import resource
import time
from collections import defaultdict
from pathlib import Path

PHASES = ("setup", "call", "teardown")
SHOWN = 15


def add_option(parser):
    parser.addoption("--durations-file", type=Path, help="writes the seconds of every test as JSON, and shows a table")


class Durations:
    """Plugin of the process that reports: sums up the phases of each test, wherever it ran."""

    def __init__(self, file: Path) -> None:
        self.file, self.began_s = file, time.monotonic()
        self.seconds: dict[str, dict[str, float]] = defaultdict(lambda: dict.fromkeys(PHASES, 0.0))
        self.collected_s = 0.0

    def pytest_collection_finish(self):
        self.collected_s = time.monotonic() - self.began_s

    def pytest_xdist_node_collection_finished(self):
        self.pytest_collection_finish()

    def pytest_runtest_logreport(self, report):
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
        line(
            f"collection {measured['collection_s']:.0f} s; in all {measured['wall_s']:.0f} s, CPU {measured['cpu_s']:.0f} s"
        )

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


def rows(seconds):
    found = [{"name": name, "seconds": sum(phases.values()), **phases} for name, phases in seconds.items()]
    return sorted(found, key=lambda row: -row["seconds"])
