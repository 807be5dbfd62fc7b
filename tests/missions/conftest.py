"""One fetch as a user runs it, with recording and without: several tests read what it leaves."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

SENTENCE = "Hey Alice, can you fetch me a drink from the kitchen"


def fetch(out: Path, *arguments: str) -> tuple[dict, list[str]]:
    """The report, and the lines that people read."""
    command = [sys.executable, "-m", "executive.cli", "run", "--say", SENTENCE, "--seed", "1", "--json"]
    done = subprocess.run([*command, "--out", str(out), *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1]), done.stderr.splitlines()


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """A run with recording: its folder, its report and what it printed."""
    out = tmp_path_factory.mktemp("recorded")
    return out, *fetch(out)


@pytest.fixture(scope="session")
def repeated(tmp_path_factory):
    """The same run without recording, in a process of its own: its folder and its report."""
    out = tmp_path_factory.mktemp("repeated")
    return out, fetch(out, "--no-record", "--quiet")[0]
