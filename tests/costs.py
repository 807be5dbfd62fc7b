"""What the tests of each folder cost in things that are counted, which no machine makes slower or faster.

Each process counts what its tests do; the process that reports sums it up, prints a table, and fails the run where a
folder costs more than `costs.yaml` says. `--costs-file` writes the sums; `python -m tests.costs FILE` sets the budgets.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import threading
import time
from collections import Counter, defaultdict
from importlib import import_module
from pathlib import Path

import pytest
import yaml

from tests.durations import ROOT

BUDGETS = ROOT / "tests/costs.yaml"
COUNTED = {
    "cases": "test cases",
    "plant_s": "simulated seconds of plants",
    "pictures": "pictures and depth pictures that a plant rendered",
    "processes": "processes started, forked ones included",
    "browsers": "browsers started",
    "networks": "networks loaded by ONNX Runtime",
    "waited_s": "seconds that the main thread slept or waited in vain",
}
LONG_S = 0.05
"""Shortest sleep that counts as one on purpose; shorter ones look whether something has come about."""
MARGIN, CASES, ONCE = 1.25, 1.05, {"networks": 9, "processes": 9, "browsers": 3, "waited_s": 9}
"""A budget is what was counted times the margin, plus what each of three processes does once, in whichever folder.

Another processor rounds in another way, and a mission then takes another way, too: 14 % more plant seconds were seen.
"""


class Costs:
    """Plugin that counts what tests cost; in the process that reports it holds the sums to the budgets."""

    def __init__(self, file: Path | None, reports: bool) -> None:
        self.file, self.reports = file, reports
        self.now: Counter[str] = Counter()
        self.sums: dict[str, Counter[str]] = defaultdict(Counter)

    def count(self, module, name, what, amount=lambda *_, **__: 1):
        """Lets each call of a function of a module, or of a method of its class, add an amount to a count."""
        owner, _, name = name.rpartition(".")
        owner = getattr(module, owner) if owner else module
        function = getattr(owner, name)
        if getattr(function, "counter", None) is self:
            return

        def counting(*arguments, **options):
            found = function(*arguments, **options)
            self.now[what] += amount(found, *arguments, **options)
            return found

        counting.counter = self
        setattr(owner, name, counting)

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionstart(self):
        """Counts from here on; what a module that no test has imported yet does is counted once it is there."""
        self.count(subprocess.Popen, "__init__", "processes")
        self.count(os, "fork", "processes", lambda child: child > 0)
        self.count(time, "sleep", "waited_s", lambda _, seconds: on_purpose(seconds))
        self.count(threading.Condition, "wait", "waited_s", waited_in_vain)
        self.count_imported()

    def pytest_collection_finish(self):
        self.count_imported()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self):
        report = yield
        self.count_imported()
        if report.when == "setup":
            self.now["cases"] += 1
        report.user_properties.append(("costs", dict(self.now)))
        self.now.clear()
        return report

    def count_imported(self):
        for name, function, what, amount in IMPORTED:
            if name in sys.modules:
                self.count(import_module(name), function, what, amount)

    def pytest_runtest_logreport(self, report):
        if self.reports:
            found = [value for name, value in report.user_properties if name == "costs"]
            self.sums[folder_of(report.nodeid)].update(*found[-1:])

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session):
        if self.reports and self.exceeded() and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED
        if self.reports and self.file is not None:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            self.file.write_text(json.dumps(self.sums, indent=1))

    def pytest_terminal_summary(self, terminalreporter):
        line = terminalreporter.write_line
        line(f"{'counted':24}" + "".join(f"{what:>11}" for what in COUNTED))
        for folder, counts in sorted(self.sums.items()):
            line(f"{folder:24}" + "".join(f"{round(counts[what]):11}" for what in COUNTED))
        for folder, what, count, budget in self.exceeded():
            line(f"FAILED {folder}: {count:.0f} {COUNTED[what]}, and {BUDGETS.relative_to(ROOT)} allows {budget}")

    def exceeded(self):
        """Folders that cost more than their budgets: folder, what, count and budget."""
        budgets = yaml.safe_load(BUDGETS.read_text())
        every = [(folder, what) for folder in sorted(self.sums) for what in COUNTED]
        rows = [(folder, what, self.sums[folder][what], budgets.get(folder, {}).get(what, 0)) for folder, what in every]
        return [row for row in rows if row[2] > row[3]]


def on_purpose(seconds):
    return seconds if seconds >= LONG_S and threading.current_thread() is threading.main_thread() else 0.0


def waited_in_vain(found, _, timeout=None):
    return on_purpose(timeout or 0.0) * (not found)


IMPORTED = (
    ("plant.engine", "Engine._do_steps", "plant_s", lambda _, engine, steps, *__: steps * plant_step_s()),
    ("plant.rendering", "Scene.picture", "pictures", lambda *_, **__: 1),
    ("onnxruntime", "InferenceSession.__init__", "networks", lambda *_, **__: 1),
    ("playwright.sync_api", "BrowserType.launch", "browsers", lambda *_, **__: 1),
)
"""Modules, functions, and what their calls count; they take long to import, so not before a test does."""


def plant_step_s():
    return sys.modules["plant.engine"].TIME_STEP_S


def folder_of(nodeid):
    """The folder whose budget a test counts for: `tests/skills`, `plugins/errand-spot`, or `tests`."""
    first, second, *more = nodeid.partition("::")[0].split("/")
    return f"{first}/{second}" if more else first


def main():
    sums = json.loads(Path(sys.argv[1]).read_text())
    budgets = {
        folder: {
            what: math.ceil(counts.get(what, 0) * (CASES if what == "cases" else MARGIN)) + ONCE.get(what, 0)
            for what in COUNTED
        }
        for folder, counts in sorted(sums.items())
    }
    BUDGETS.write_text(yaml.safe_dump(budgets, sort_keys=False))


if __name__ == "__main__":
    main()
