"""How often the route of a request changes the module, from `--say` to the robot."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

MOST_TO_THE_FIRST_TICK = 32
MOST_TO_THE_GRIPPER = 42


def hops(*words: str) -> int:
    command = [sys.executable, "-m", "tests.executive.cli.hops", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return int(json.loads(done.stdout.splitlines()[-1])["hops"])


@pytest.mark.nightly
@pytest.mark.mission
def test_a_sentence_comes_to_its_first_tick_within_the_budget_of_hops(tmp_path: Path) -> None:
    assert 10 < hops(str(tmp_path)) <= MOST_TO_THE_FIRST_TICK


@pytest.mark.nightly
@pytest.mark.mission
def test_a_sentence_comes_to_a_command_of_the_gripper_within_the_budget_of_hops(tmp_path: Path) -> None:
    assert 10 < hops(str(tmp_path), "--to-gripper") <= MOST_TO_THE_GRIPPER
