"""In the plant, a robot whose cameras have a fault does not say that nobody is in a room."""

import pytest

from executive.mission.scenario import Scenario
from executive.words.mission import Route
from tests.benchmarks.plant_mission import PlantMission

pytestmark = pytest.mark.mission

HALL_W = (1.6, 4.6)


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        pytest.param("image returns NaN depth from 3 s", "camera gives pictures without depth", id="no depth"),
        pytest.param(
            "camera freezes from 12 s",
            "camera gives only a picture that is",
            id="old",
            marks=pytest.mark.nightly,
        ),
    ],
)
def test_somebody_in_a_room_is_not_denied_for_want_of_good_pictures(fault, says, tmp_path):
    def stands_in_hall(prepared):
        return prepared.world.without_people().with_routes({"Robin": Route(waypoints=(HALL_W,), start=0.0)})

    options = {"sentence": "is anybody in the hall", "scenario": Scenario((fault,))}
    end = PlantMission(tmp_path, 9441, change=stands_in_hall, **options).end("asked")
    assert (end.claimed, end.cause) == (False, "EXECUTION"), end.message
    assert "no answer for the hall: " in end.message and says in end.message
