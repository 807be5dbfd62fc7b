"""`errand map build`, and what it refuses."""

import json
import sys

import cv2
import pytest

from errand_make.maps.map_drive import route_points
from skills.grid_map import load_grid_map
from skills.inputs.errors import InputError
from tests.executive.cli.calls import done, errand, json_of, refusal, write_room

KEYS = {"world", "seed", "map", "distance_m", "loop_closures", "sim_time_s", "wall_time_s", "trajectory_error_m"}


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A world of one room, 6 x 5 m."""
    folder = tmp_path_factory.mktemp("room")
    write_room(folder, yaw=0.0)
    done("world", "from-map", folder / "room.yaml", "--out", folder / "world")
    return folder / "world"


def test_a_map_is_built_along_a_route_goes_on_and_carries_a_mission(room, tmp_path):
    pytest.importorskip("gtsam")
    route, out = tmp_path / "route.txt", tmp_path / "map"
    route.write_text("# ahead\n0.8 0.0\n")
    built = done("map", "build", "--world", room, "--out", out, "--route", route, "--json")
    result = json_of(built)
    assert set(result) == KEYS
    assert result["trajectory_error_m"] < 0.03 and 0.8 < result["distance_m"] < 4.0
    assert result["map"] == str(out / "scan.yaml")
    for band in ("scan", "keepout"):
        assert load_grid_map(out / f"{band}.yaml").occupied.sum() > 500
    assert cv2.imread(str(out / "map.png")) is not None
    poses = len(json.loads((out / "pose_graph.json").read_text())["poses"])

    again = errand("map", "build", "--world", room, "--out", out, "--max-time", "2", "--json")
    assert again.exit_code in (0, 1), again.output
    assert len(json.loads((out / "pose_graph.json").read_text())["poses"]) > poses

    start = json.loads((out / "pose_graph.json").read_text())["poses"][0]
    goal = ("--set", f"x={start[0] + 0.5}", "--set", f"y={start[1]}", "--set", "yaw=0.0")
    where = ("--world", room, "--map", out, "--out", tmp_path / "run")
    ran = done("run", "go_to_pose", *where, *goal, "--no-record", "--quiet", "--json")
    assert json_of(ran)["referee"]["success"]


@pytest.mark.parametrize("text", ["1.0 2.0\n3 4\n", "[[1.0, 2.0], [3, 4]]", "- [1, 2]\n- [3, 4]\n", "1,2\n3,4 # end\n"])
def test_a_route_is_lines_or_a_list(tmp_path, text):
    (tmp_path / "route").write_text(text)
    assert route_points(tmp_path / "route") == [(1.0, 2.0), (3.0, 4.0)]


@pytest.mark.parametrize("text", ["", "1 2 3\n", "here there\n", "[[1, .nan]]", "[[1, 2], 3]", "{x: 1}"])
def test_a_file_that_is_no_route_is_refused(tmp_path, text):
    (tmp_path / "route").write_text(text)
    with pytest.raises(InputError, match="it is not a route"):
        route_points(tmp_path / "route")


def test_without_its_extra_it_says_what_to_install(room, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "gtsam", None)
    assert "pip install 'errand-make[mapping]'" in refusal("map", "build", "--world", room, "--out", tmp_path / "map")


def test_a_damaged_map_is_refused(room, tmp_path):
    pytest.importorskip("gtsam")
    (tmp_path / "pose_graph.json").write_text("{}")
    assert "it is no pose graph" in refusal("map", "build", "--world", room, "--out", tmp_path)
