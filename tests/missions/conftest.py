"""One fetch with recording, and its beginning in a process of its own: several tests read what they leave."""

import json
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from executive.cli.entry import app

SAID, IN_KITCHEN = "Hey Alice, can you fetch me a drink from the kitchen", ("9.2", "6.6", "0")
FETCH = ("run", "--say", SAID, "--seed", "1", "--json", "--start", *IN_KITCHEN)
REPEATED_S = 24.0
"""The grasp has begun."""


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """A run with recording: its folder, its report and the lines that people read."""
    out = tmp_path_factory.mktemp("recorded")
    done = CliRunner().invoke(app, [*FETCH, "--out", str(out)])
    assert done.exit_code == 0, done.output
    return out, json.loads(done.stdout.splitlines()[-1]), done.stderr.splitlines()


@pytest.fixture(scope="session")
def repeated(tmp_path_factory):
    """The folder of the beginning of the same run, without recording, as a user starts it."""
    out = tmp_path_factory.mktemp("repeated")
    options = ["--out", str(out), "--no-record", "--quiet", "--time-limit", str(REPEATED_S)]
    command = [sys.executable, "-m", "executive.cli", *FETCH, *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0, done.stderr
    return out
