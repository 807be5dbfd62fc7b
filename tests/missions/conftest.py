"""One fetch as a user runs it, and its beginning without recording: several tests read what they leave."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

SENTENCE = "Hey Alice, can you fetch me a drink from the kitchen"
REPEATED_S = 40.0


def fetch(out: Path, *arguments: str, ends: bool = True) -> tuple[dict, list[str]]:
    """The report, and the lines that people read."""
    command = [sys.executable, "-m", "executive.cli", "run", "--say", SENTENCE, "--seed", "1", "--json"]
    done = subprocess.run([*command, "--out", str(out), *arguments], capture_output=True, text=True, check=False)
    assert (done.returncode == 0) is ends, done.stderr
    return json.loads(done.stdout.splitlines()[-1]), done.stderr.splitlines()


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """A run with recording: its folder, its report and what it printed."""
    out = tmp_path_factory.mktemp("recorded")
    return out, *fetch(out)


@pytest.fixture(scope="session")
def repeated(tmp_path_factory):
    """The folder of the beginning of the same run, without recording and in a process of its own: up to the grasp."""
    out = tmp_path_factory.mktemp("repeated")
    fetch(out, "--no-record", "--quiet", "--time-limit", str(REPEATED_S), ends=False)
    return out
