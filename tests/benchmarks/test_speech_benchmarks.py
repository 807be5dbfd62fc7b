"""What speech costs and how much of it is right, with the synthetic voices of this machine; see speech/score.py."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("faster_whisper")

SCORE = Path(__file__).parent / "speech" / "score.py"
NO_VOICE = 3
LOADING_S, PER_SECOND_OF_SOUND, PEAK_MB = 6.0, 0.3, 1200
CLEAR, NOISY, MISSED, FALSE = 0.92, 0.80, 0.03, 0.01


@pytest.fixture(scope="module")
def result():
    run = subprocess.run(
        [sys.executable, SCORE, "--sentences", "60", "--chatter", "100", "--seed", "5", "--json"],
        capture_output=True,
        text=True,
        timeout=1800,
    )
    if run.returncode == NO_VOICE:
        pytest.skip(run.stderr.strip())
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout.splitlines()[-1])


def test_clear_sentences_become_their_commands(result):
    assert result["commands_right"]["clear"] >= CLEAR


def test_noisy_sentences_become_their_commands(result):
    assert result["commands_right"]["noisy"] >= NOISY


def test_the_wake_phrase_is_heard_where_it_is_said_and_nowhere_else(result):
    assert result["wake_missed_clear"] <= MISSED
    assert result["wake_false"] <= FALSE


def test_time_and_memory(result):
    assert result["loading_s"] <= LOADING_S  # parser and recogniser
    assert result["time_per_second_of_sound"] <= PER_SECOND_OF_SOUND
    assert result["peak_memory_mb"] <= PEAK_MB
