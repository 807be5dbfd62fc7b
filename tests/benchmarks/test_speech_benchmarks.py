"""What speech costs and how much of it is right, with the synthetic voices of this machine; see speech/score.py."""

import json
import subprocess
import sys

import pytest

pytest.importorskip("faster_whisper")

from tests.benchmarks.errand_process import ROOT
from tests.benchmarks.speech.score import NO_VOICE

MEASURE = ["-m", "tests.benchmarks.speech.score", "--sentences", "60", "--chatter", "100", "--seed", "5", "--json"]
LEAST = {"clear": 0.92, "noisy": 0.80}
MOST = {
    "wake_missed_clear": 0.03,
    "wake_false": 0.01,
    "loading_s": 6.0,  # parser and recogniser
    "time_per_second_of_sound": 0.3,
    "peak_memory_mb": 1200,
}


def test_sentences_become_their_commands_in_time(benchmark):
    command = {"args": [sys.executable, *MEASURE], "cwd": ROOT, "capture_output": True, "text": True, "timeout": 1800}
    ended = benchmark.pedantic(subprocess.run, kwargs=command, rounds=1)
    if ended.returncode == NO_VOICE:
        pytest.skip(ended.stderr.strip())
    assert ended.returncode == 0, ended.stderr
    result = json.loads(ended.stdout.splitlines()[-1])
    assert all(result["commands_right"][group] >= least for group, least in LEAST.items()), result
    assert all(result[name] <= most for name, most in MOST.items()), result
