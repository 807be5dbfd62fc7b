"""How often the route of a request changes the module, from `--say` to the robot."""

import subprocess
import sys

import pytest

from tests.executive.cli.calls import json_of


@pytest.mark.nightly
@pytest.mark.mission
@pytest.mark.parametrize(("words", "most"), [((), 32), (("--to-gripper",), 48)])  # a routine hands on to others
def test_a_sentence_comes_to_its_first_tick_and_to_the_gripper_within_a_budget_of_hops(tmp_path, words, most):
    command = [sys.executable, "-m", "tests.executive.cli.hops", str(tmp_path), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert 10 < json_of(done)["hops"] <= most
