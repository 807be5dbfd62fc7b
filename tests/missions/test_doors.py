"""Whether a door is open, looked at in the plant from where the compiler sends the robot."""

from __future__ import annotations

import pytest

from executive.app.mission_run import run_request
from executive.app.prepare import prepare
from executive.mission.request import Request
from skills.robot import Pose2D

pytestmark = pytest.mark.mission

LOOK = """
name: look at the kitchen door
steps:
  - check: {door: [kitchen, hall]}
"""


@pytest.mark.nightly
def test_a_door_that_is_open_is_found_so(tmp_path):
    (tmp_path / "look.yaml").write_text(LOOK)
    report = run_request(prepare(Request(file=tmp_path / "look.yaml", seed=1, out=tmp_path, record=False))).report
    assert "the door between hall and kitchen is open" in report.message, report.message
    assert report.referee.collisions == 0


def test_a_door_that_bars_the_way_to_where_it_is_looked_at_is_found_closed(tmp_path):
    (tmp_path / "look.yaml").write_text(LOOK.replace("kitchen", "bathroom"))
    (tmp_path / "closed.yaml").write_text("events:\n  - {door: [hall, bathroom], opens: 900}\n")
    request = Request(
        file=tmp_path / "look.yaml",
        scenario_files=(tmp_path / "closed.yaml",),
        start=Pose2D(5.2, 6.35, 1.57),
        out=tmp_path,
        record=False,
    )
    report = run_request(prepare(request)).report
    assert "the door between hall and bathroom is closed" in report.message, report.message
    assert report.referee.collisions == 0
