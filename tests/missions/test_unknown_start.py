"""A mission that starts where the robot was not told to be."""

from pathlib import Path

import pytest

from executive.app.prepare.from_request import prepare
from executive.app.runs.one_run import run_request
from executive.mission.request import Request

MISSION = Path(__file__).parents[2] / "missions" / "go_to_pose.yaml"

pytestmark = pytest.mark.mission


@pytest.mark.parametrize("localiser", ["scan_matching", pytest.param("monte_carlo", marks=pytest.mark.nightly)])
def test_it_finds_out_where_it_is_and_then_does_the_mission(localiser, tmp_path):
    stack = tmp_path / "stack.yaml"
    stack.write_text(f"localiser: {{use: {localiser}}}\n", encoding="utf-8")
    request = Request(file=MISSION, seed=3, out=tmp_path, record=False, stack=stack, start="unknown")
    report = run_request(prepare(request)).report
    assert report.achieved, (report.message, report.referee.why)
    assert report.referee.collisions == 0
