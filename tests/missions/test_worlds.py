"""A far room in each of the larger worlds: through aisles and doors, through narrow corridors and a door of 0.75 m."""

import pytest

from executive.app.prepare.from_request import prepare
from executive.app.runs.one_run import run_request
from executive.mission.request import Request

pytestmark = [pytest.mark.mission, pytest.mark.nightly]


@pytest.mark.parametrize(("world", "room"), [("shop", "office"), ("lab", "server room")])
def test_the_robot_goes_to_a_far_room_and_touches_nothing(world, room, tmp_path):
    request = Request(sentence=f"go to the {room}", world=world, seed=1, out=tmp_path, record=False)
    report = run_request(prepare(request)).report
    assert report.achieved, (report.message, report.referee.why)
    assert report.referee.success, report.referee.why
    assert report.referee.collisions == 0
