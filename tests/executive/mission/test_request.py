"""Requests: the robot's start, and a form for any folder."""

from pathlib import Path

import pytest

from executive.mission.request import Request, parse_start
from executive.words.robot_config import RobotConfig
from skills.inputs.errors import InputError
from skills.robot import Pose2D


def test_a_start_is_a_pose_or_unknown():
    assert (parse_start("1.25 -3 0.1"), parse_start("unknown")) == (Pose2D(1.25, -3.0, 0.1), "unknown")


def test_from_anywhere_the_stacks_of_robots_are_found(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    robots = (RobotConfig("Alice", "spot", stack=Path("own.yaml")), RobotConfig("Bob", "fetch"))
    found = Request("go", robots=robots).from_anywhere().robots
    assert found == (RobotConfig("Alice", "spot", stack=tmp_path / "own.yaml"), RobotConfig("Bob", "fetch"))


@pytest.mark.parametrize("text", ["", "nowhere", "1 2", "1 2 3 4", "1 2 nan", "1 2 x"])
def test_invalid_start_is_refused_with_a_hint(text):
    with pytest.raises(InputError, match="--start") as error:
        parse_start(text)
    assert error.value.hint
