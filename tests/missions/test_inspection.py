"""Pictures that a mission asks for, taken in the plant and judged by the truth."""

import json
from pathlib import Path

import cv2
import pytest

from executive.app.prepare.from_request import prepare
from executive.app.runs.one_run import run_request
from executive.mission.request import Request
from executive.mission.scenario import Scenario
from executive.record.history import read_events
from skills.robot import Pose2D

pytestmark = pytest.mark.mission

ROUND = """\
name: round
knowledge:
  places:
    window: {pose: {x: 9.8, y: 6.9, yaw: 1.57}, shows: [9.8, 8.3, 0.8]}
    socket: {pose: {x: 9.8, y: 6.9, yaw: 1.57}, shows: [9.8, 8.3, 0.4]}
steps:
  - picture: {of: window, camera: hand}
  - picture: {of: socket, camera: back}
  - picture: {of: coke}
"""


def test_the_pictures_show_what_they_are_of(tmp_path):
    (tmp_path / "round.yaml").write_text(ROUND, encoding="utf-8")
    start = Pose2D(9.8, 6.6, 3.14)
    request = Request(file=tmp_path / "round.yaml", seed=1, out=tmp_path / "out", record=False, start=start)
    report = run_request(prepare(request)).report
    assert report.achieved, (report.message, report.referee.why)
    assert report.referee.why == (
        "The picture shows the window. The picture shows the socket. The picture shows the coke."
    )
    assert [(each.question, each.answer) for each in report.answers] == [
        ("A picture of the window", "taken"),
        ("A picture of the socket", "taken"),
        ("A picture of the coke", "taken"),
    ]
    assert [each.picture for each in report.answers] == [0, 1, 2]
    facts = json.loads((tmp_path / "out" / "pictures" / "pictures.json").read_text(encoding="utf-8"))
    shapes = [cv2.imread(str(tmp_path / "out" / "pictures" / each["file"])).shape[:2] for each in facts]
    assert shapes == [(480, 640), (240, 320), (480, 640)]
    assert [each["camera"] for each in facts] == ["hand", "back", "hand"]
    assert 0.0 < facts[0]["stamp_s"] < facts[1]["stamp_s"] < report.sim_time_s


JUMPS_S = 9.0


@pytest.fixture(scope="module")
def astray(tmp_path_factory):
    """Odometry jumps on the way while the LiDAR gives no scans: the robot does not stand where it believes to be."""
    folder = tmp_path_factory.mktemp("astray")
    (folder / "round.yaml").write_text(ROUND.partition("  - picture: {of: coke}")[0], encoding="utf-8")
    faults = Scenario(("lidar is missing 7 s at 8 s", f"odometry jumps -0.9 m at {JUMPS_S} s"))
    request = Request(file=folder / "round.yaml", seed=1, out=folder / "out", record=False, scenario=faults)
    return run_request(prepare(request)).report


@pytest.mark.nightly
def test_no_picture_is_claimed_while_no_scan_confirms_where_the_robot_stands(astray):
    assert not astray.false_claim, (astray.message, astray.referee.why)
    assert astray.achieved or astray.cause == "POSTCONDITION", astray.message


@pytest.mark.nightly
def test_the_log_shows_how_far_a_jump_of_odometry_takes_the_estimate_from_the_truth(astray):
    log = Path(astray.log)
    errors_m = [(each.stamp_s, each.data["error_m"]) for each in read_events(log) if each.topic == "truth"]
    before = [error_m for t_s, error_m in errors_m if t_s < JUMPS_S]
    assert len(before) > 10 and max(before) < 0.1
    assert max(error_m for _, error_m in errors_m) > 0.7
    assert "Position error" in log.with_name("report.html").read_text(encoding="utf-8")
