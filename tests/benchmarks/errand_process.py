"""Runs of the command `errand` in processes of their own, one of which may be killed at a moment of its plant."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

from plant.diagram import TIME_STEP_S
from plant.snapshot_file import SnapshotError, read_snapshot

ROOT = Path(__file__).parents[2]


def errand(*words):
    """Command line of `errand` with some arguments."""
    return [sys.executable, "-m", "executive.cli", *map(str, words)]


def run_errand(*words):
    return subprocess.run(errand(*words), cwd=ROOT, capture_output=True, text=True, check=False)


def report_of(text):
    """Report that `errand --json` prints last; empty without one."""
    lines = [line for line in text.splitlines() if line.startswith("{")]
    return dict(json.loads(lines[-1])) if lines else {}


def kill_at(process, out, moment_s):
    """Kills a run when its plant's clock has come to the moment; False when the run ended before."""
    while process.poll() is None:
        try:
            now_s = read_snapshot(out / ".errand" / "missions.plant").values["engine"]["steps"] * TIME_STEP_S
        except SnapshotError:
            now_s = 0.0
        if now_s >= moment_s:
            process.send_signal(signal.SIGKILL)
            process.wait()
            return True
        time.sleep(0.01)
    return False
