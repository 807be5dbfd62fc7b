"""In the plant, a robot whose cameras or detector miss somebody does not say that nobody is in a room."""

import pytest

from executive.mission.scenario import Scenario
from executive.words.mission import Route
from tests.benchmarks.plant_mission import PlantMission

pytestmark = pytest.mark.mission

HALL_W = (1.6, 4.6)


def stands_in_hall(prepared):
    return prepared.world.without_people().with_routes({"Robin": Route(waypoints=(HALL_W,), start=0.0)})


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
    options = {"sentence": "is anybody in the hall", "scenario": Scenario((fault,))}
    end = PlantMission(tmp_path, 9441, change=stands_in_hall, **options).end("asked")
    assert (end.claimed, end.cause) == (False, "EXECUTION"), end.message
    assert "no answer for the hall: " in end.message and says in end.message


def test_somebody_whom_the_detector_misses_is_not_denied(tmp_path):
    """Scans show a body as tall as a person; no picture's detection reaches the score that the stack asks for."""

    stack = tmp_path / "stack.yaml"
    stack.write_text("skills: {find_people: {least_score: 1.0, viewpoints: 2}}\n")
    options = {"sentence": "is nobody in the hall", "stack": stack}
    end = PlantMission(tmp_path, 9442, change=stands_in_hall, **options).end("asked")
    assert (end.claimed, end.cause) == (False, "EXECUTION"), end.message
    assert "may be a person" in end.message
