"""Each measure of `smallest_cases.yaml` runs its smallest case to its end, and its figures are as stated there."""

import json
import math
import os
import shlex
import subprocess
import sys

import pytest

from tests.benchmarks.errand_process import ROOT
from tests.benchmarks.speech.score import NO_VOICE
from tests.benchmarks.structured_sentences import TABLES, measured
from tests.tables import yaml_beside

LIMIT_S = 600.0
NEEDED = {"spot_": "bosdyn.client", "speech.": "faster_whisper", "evaluation kill": "distributed"}
"""Packages without which some measures are skipped."""
SMALLEST = yaml_beside(__file__, "smallest_cases.yaml")
"""Conditions on the figures of measures, by their commands."""


def output_of(words):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = {"cwd": ROOT, "env": environment, "capture_output": True, "text": True, "timeout": LIMIT_S}
    command = [sys.executable, "-m", *shlex.split(f"tests.benchmarks.{words}")]
    ended = subprocess.run(command, check=False, **process)
    if ended.returncode == NO_VOICE:
        pytest.skip(ended.stderr.strip())
    assert ended.returncode == 0, ended.stderr[-2000:]
    return ended.stdout


@pytest.fixture
def barn(tmp_path):
    """A narrow world in BARN's form: a free way of 4 m between two walls of cylinders."""
    cylinders = [(x, 0.15 * step, 0.075, 1.0) for x in (-1.2, 1.2) for step in range(40)]
    facts = {"world": 7, "start": [0.0, 1.0, math.pi / 2], "goal": [0.0, 5.0], "optimal_path_len": 4.0}
    (tmp_path / "barn").mkdir()
    (tmp_path / "barn" / "world_7.json").write_text(json.dumps({**facts, "cylinders": cylinders}))
    return tmp_path / "barn"


@pytest.mark.nightly
@pytest.mark.parametrize("words", SMALLEST)
def test_a_measure_runs_its_smallest_case(words, barn, tmp_path):
    for beginning, package in NEEDED.items():
        if words.startswith(beginning):
            pytest.importorskip(package)
    for command in words.format(barn=barn, out=tmp_path / "out").split(" && "):
        figures = json.loads(output_of(f"{command} --json").splitlines()[-1])
    named = figures if isinstance(figures, dict) else {"figures": figures}
    assert eval(SMALLEST[words], {"len": len, "min": min}, named), figures


@pytest.mark.nightly
def test_a_run_is_equal_to_the_same_run_stored(tmp_path):
    output_of(f"equal_logs keep {tmp_path} --only ask")
    assert output_of(f"equal_logs compare {tmp_path} --only ask").startswith("ask: equal")


@pytest.mark.parametrize(
    "table",
    [pytest.param(t, marks=[pytest.mark.nightly] * t.stem.startswith("structured"), id=t.stem) for t in TABLES],
)
def test_sentences_of_a_table_are_right_or_refused(table):
    score = measured(table)
    assert (score.right >= 0.97 * score.sentences, score.wrongly_accepted) == (True, []), score
