"""`errand world`, and `errand run` in what it makes."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from executive.cli import entry
from executive.cli.options import join_start

MAP = """image: room.pgm
resolution: 0.05
origin: [2.0, -1.0, {yaw}]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def invoke(*arguments: object):
    return CliRunner().invoke(entry.app, list(map(str, arguments)))


@pytest.fixture
def map_file(tmp_path: Path) -> Path:
    """A room of 6 x 5 m, turned."""
    room = np.full((104, 124), 0, np.uint8)
    room[2:-2, 2:-2] = 254
    cv2.imwrite(str(tmp_path / "room.pgm"), room)
    path = tmp_path / "room.yaml"
    path.write_text(MAP.format(yaw=0.3))
    return path


def test_a_goal_is_reached_in_a_world_made_of_a_map(map_file, tmp_path):
    made = invoke("world", "from-map", map_file, "--out", tmp_path / "hall")
    assert made.exit_code == 0, made.output
    assert ": 1 room, 0 doors, start at" in made.stdout
    shown = invoke("world", "show", tmp_path / "hall", "--out", tmp_path / "hall.png")
    assert shown.exit_code == 0, shown.output
    assert cv2.imread(str(tmp_path / "hall.png")).shape[1] == 1400
    goal = ("--set", "x=4.6", "--set", "y=1.6", "--set", "yaw=0.3", "--start", 3.6, 1.6, 0.3)
    out = ("--out", tmp_path / "out", "--no-record", "--quiet", "--json")
    ran = invoke("run", "go_to_pose", "--world", tmp_path / "hall", *goal, *out)
    assert ran.exit_code == 0, ran.output
    report = json.loads(ran.stdout.splitlines()[-1])
    assert report["referee"]["success"] and report["referee"]["collisions"] == 0
    assert report["sim_time_s"] < 8.0  # from the start that was given, a metre away


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("--start", 2.0, -1.0, 0.0), "room.yaml: the start (2, -1, 0) touches a wall"),
        (("--start", "here"), "--start here: a pose has 3 numbers, not 1"),
        (("--out", "{tmp}"), "it exists already"),
    ],
)
def test_bad_input_is_refused_in_one_line_with_status_2(map_file, tmp_path, arguments, why):
    given = [str(each).replace("{tmp}", str(tmp_path)) for each in arguments]
    result = invoke("world", "from-map", map_file, "--out", tmp_path / "hall", *given)
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert why in line
    assert not (tmp_path / "hall").exists()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('{"cylinders": [[1, 2', "c.json:1: damaged JSON"),
        ('{"pillars": []}', "cylinders: is missing"),
        ('{"cylinders": [[0, 0, -1, 1]]}', "cylinders.0.2: "),
        ('{"cylinders": []}', "cylinders: "),
        ('{"cylinders": [[0, 0, 1, 1], [9e3, 0, 1, 1]]}', "leave far ones out"),
    ],
)
def test_damaged_cylinders_are_refused(tmp_path, text, why):
    (tmp_path / "c.json").write_text(text)
    result = invoke("world", "from-cylinders", tmp_path / "c.json", "--out", tmp_path / "w")
    assert result.exit_code == 2
    assert "c.json" in result.stderr and why in result.stderr


def test_a_start_in_a_wall_of_the_flat_is_refused():
    result = invoke("run", "go_to_pose", "--start", 0.0, 0.0, 0.0)
    assert result.exit_code == 2
    assert "at the start (0, 0, 0) the robot stands in an obstacle" in result.stderr


@pytest.mark.parametrize(("setting", "why"), [("z=1", "has no parameter 'z'"), ("x", "is not NAME=VALUE")])
def test_a_value_that_the_file_does_not_take_is_refused(setting, why):
    result = invoke("run", "go_to_pose", "--set", setting)
    assert result.exit_code == 2
    assert why in result.stderr


def test_three_numbers_after_start_are_one_value():
    assert join_start(["run", "--start", "1", "-2", "0.5", "m.yaml"]) == ["run", "--start=1 -2 0.5", "m.yaml"]
    assert join_start(["run", "--start", "unknown", "m.yaml"]) == ["run", "--start", "unknown", "m.yaml"]
