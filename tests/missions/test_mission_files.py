"""Mission files that come with the project, run as they stand in the plant."""

from dataclasses import replace
from pathlib import Path

import pytest

from executive.app.prepare.checker import Checker
from executive.app.prepare.from_request import prepare
from executive.app.runs.one_run import run_request
from executive.mission.request import Request
from skills.robot import Pose2D
from tests.tables import table

MISSIONS = Path(__file__).parents[2] / "missions"

pytestmark = pytest.mark.mission


NIGHTLY = pytest.mark.nightly


@pytest.mark.parametrize(
    ("name", "seed", "start"),
    [
        ("go_to_pose", 1, Pose2D(7.1, 4.5, 0.0)),
        pytest.param("patrol", 2, None, marks=NIGHTLY),
        pytest.param("tidy_table", 3, None, marks=NIGHTLY),
        pytest.param("two_drinks", 2, None, marks=NIGHTLY),
    ],
)
def test_it_is_achieved_and_takes_about_as_long_as_estimated(name, seed, start, tmp_path):
    request = Request(file=MISSIONS / f"{name}.yaml", start=start)
    report = run_request(prepare(replace(request, seed=seed, out=tmp_path, record=False))).report
    assert report.achieved, (report.message, report.referee.why)
    assert report.referee.collisions == 0
    if "skipped" not in report.message:
        assert 0.6 < report.sim_time_s / Checker().check(request).estimate.duration_s < 1.6


KEPT, NEAR = "watch_the_door", Pose2D(4.8, 4.5, 0.0)
"""The one that stands for all in `make test`: it goes, looks, counts and says what it found. It starts in the hall."""


COLUMNS, DECIDING = table(__file__, "deciding")


@pytest.mark.parametrize(COLUMNS, [pytest.param(*row, marks=[NIGHTLY] * (row[0] != KEPT)) for row in DECIDING])
def test_a_mission_decides_right_and_says_so(name, seed, said, tmp_path):
    start = {"start": NEAR} if name == KEPT else {}
    file, options = MISSIONS / f"{name}.yaml", {"out": tmp_path, "record": False, "time_of_day": "08:29", **start}
    report = run_request(prepare(Request(file=file, seed=seed, **options))).report
    assert report.outcome == "success", report.message
    assert report.referee.success, report.referee.why
    assert (report.referee.collisions, report.referee.drops) == (0, 0)
    assert said in (None, *(each.text for each in report.said[-1:]))
