"""A queue done by two robots in the plant."""

import json

import pytest
from typer.testing import CliRunner

from executive.cli import entry

pytestmark = pytest.mark.mission


def errand(*arguments):
    result = CliRunner().invoke(entry.app, [*map(str, arguments), "--json"])
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout.splitlines()[-1])


def test_each_robot_of_a_fleet_does_a_mission_and_the_referee_saw_it(tmp_path):
    for place in ("living room", "kitchen"):
        errand("queue", "add", "--say", f"Go to the {place}", "--no-wake", "--no-record", "--out", tmp_path)
    robots = "alice=spot@8.7,4.0,1.57,bob=spot@8.4,6.5,1.57"
    missions = errand("fleet", "run", tmp_path, "--robots", robots, "--seed", 2, "--no-record")["missions"]
    assert [(each["robot"], each["outcome"]) for each in missions] == [("Alice", "success"), ("Bob", "success")]
    assert all(each["referee"]["success"] and not each["referee"]["collisions"] for each in missions)
    assert errand("fleet", "status", tmp_path)["missions"] == missions
