"""Mission files that come with the project, run as they stand in the plant."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.cli.check_command import Checker
from executive.cli.requests import prepare
from executive.cli.simulated import run_simulated
from executive.mission.request import Request

MISSIONS = Path(__file__).parents[2] / "missions"

pytestmark = pytest.mark.mission


@pytest.mark.parametrize(("name", "seed"), [("go_to_pose", 1), ("patrol", 2), ("tidy_table", 3), ("two_drinks", 2)])
def test_it_is_achieved_and_takes_about_as_long_as_estimated(name, seed, tmp_path):
    file = MISSIONS / f"{name}.yaml"
    report = run_simulated(prepare(Request(file=file, seed=seed, out=tmp_path, record=False))).report
    assert report.achieved, (report.message, report.referee.why)
    assert report.referee.collisions == 0
    if "skipped" not in report.message:
        assert 0.6 < report.sim_time_s / Checker().check(file).estimate.duration_s < 1.6
