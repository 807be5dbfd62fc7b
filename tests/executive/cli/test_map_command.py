"""`errand map build`, and what it refuses."""

import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from executive.cli import entry
from executive.cli.map_command import _route_points
from skills.estimate.grid_map import load_grid_map
from skills.files.errors import InputError

KEYS = {"world", "seed", "map", "distance_m", "loop_closures", "sim_time_s", "wall_time_s", "trajectory_error_m"}


def invoke(*arguments: object):
    return CliRunner().invoke(entry.app, list(map(str, arguments)))


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> Path:
    """A world of one room, 6 x 5 m."""
    folder = tmp_path_factory.mktemp("room")
    cells = np.full((104, 124), 0, np.uint8)
    cells[2:-2, 2:-2] = 254
    cv2.imwrite(str(folder / "room.pgm"), cells)
    (folder / "room.yaml").write_text(
        "image: room.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    made = invoke("world", "from-map", folder / "room.yaml", "--out", folder / "world")
    assert made.exit_code == 0, made.output
    return folder / "world"


def test_a_map_is_built_along_a_route_goes_on_and_carries_a_mission(room, tmp_path):
    pytest.importorskip("gtsam")
    route, out = tmp_path / "route.txt", tmp_path / "map"
    route.write_text("# ahead\n0.8 0.0\n")
    built = invoke("map", "build", "--world", room, "--out", out, "--route", route, "--json")
    assert built.exit_code == 0, built.output
    result = json.loads(built.stdout.splitlines()[-1])
    assert set(result) == KEYS
    assert result["trajectory_error_m"] < 0.03 and 0.8 < result["distance_m"] < 4.0
    assert result["map"] == str(out / "scan.yaml")
    for band in ("scan", "keepout"):
        assert load_grid_map(out / f"{band}.yaml").occupied.sum() > 500
    assert cv2.imread(str(out / "map.png")) is not None
    poses = len(json.loads((out / "pose_graph.json").read_text())["poses"])

    again = invoke("map", "build", "--world", room, "--out", out, "--max-time", "2", "--json")
    assert again.exit_code in (0, 1), again.output
    assert len(json.loads((out / "pose_graph.json").read_text())["poses"]) > poses

    start = json.loads((out / "pose_graph.json").read_text())["poses"][0]
    goal = ("--set", f"x={start[0] + 0.5}", "--set", f"y={start[1]}", "--set", "yaw=0.0")
    ran = invoke(
        "run",
        "go_to_pose",
        "--world",
        room,
        "--map",
        out,
        *goal,
        "--out",
        tmp_path / "run",
        "--no-record",
        "--quiet",
        "--json",
    )
    assert ran.exit_code == 0, ran.output
    assert json.loads(ran.stdout.splitlines()[-1])["referee"]["success"]


def test_a_folder_without_a_map_is_refused(room, tmp_path):
    ran = invoke(
        "run", "go_to_pose", "--world", room, "--map", tmp_path, "--set", "x=1", "--set", "y=1", "--set", "yaw=0"
    )
    assert ran.exit_code == 2
    assert "there is no map: scan.yaml is missing" in ran.stderr


@pytest.mark.parametrize("text", ["1.0 2.0\n3 4\n", "[[1.0, 2.0], [3, 4]]", "- [1, 2]\n- [3, 4]\n", "1,2\n3,4 # end\n"])
def test_a_route_is_lines_or_a_list(tmp_path, text):
    (tmp_path / "route").write_text(text)
    assert _route_points(tmp_path / "route") == [(1.0, 2.0), (3.0, 4.0)]


@pytest.mark.parametrize("text", ["", "1 2 3\n", "here there\n", "[[1, .nan]]", "[[1, 2], 3]", "{x: 1}"])
def test_a_file_that_is_no_route_is_refused(tmp_path, text):
    (tmp_path / "route").write_text(text)
    with pytest.raises(InputError, match="it is not a route"):
        _route_points(tmp_path / "route")


def test_without_its_extra_it_says_what_to_install(room, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "gtsam", None)
    ran = invoke("map", "build", "--world", room, "--out", tmp_path / "map")
    assert ran.exit_code == 2
    assert "pip install 'spot-errand[mapping]'" in ran.stderr


def test_a_damaged_map_is_refused(room, tmp_path):
    pytest.importorskip("gtsam")
    (tmp_path / "pose_graph.json").write_text("{}")
    ran = invoke("map", "build", "--world", room, "--out", tmp_path)
    assert ran.exit_code == 2
    assert "it is no pose graph" in ran.stderr
