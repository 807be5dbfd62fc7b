"""In the plant, a robot counts people who stand so near that its pictures show only their legs."""

import pytest

from executive.words.mission import Route
from tests.benchmarks.plant_mission import PlantMission

pytestmark = pytest.mark.mission

NEAR_W = {"Robin": (7.6, 7.5), "Noor": (9.2, 7.5)}
"""Two people 1 m ahead, left and right of the pose in the kitchen from which the robot looks."""


def test_two_people_before_the_robot_are_counted(tmp_path):
    def stand_in_kitchen(prepared):
        routes = {name: Route(waypoints=(at_W,), start=0.0) for name, at_W in NEAR_W.items()}
        return prepared.world.without_people().with_routes(routes)

    asked = "how many people are in the kitchen"
    end = PlantMission(tmp_path, 9442, change=stand_in_kitchen, sentence=asked).end("asked")
    assert (end.fulfilled, end.message) == (True, "there are two people in the kitchen"), end.why
