"""Fetch brings objects to surfaces without a touch of furniture or a drop, by the referee's verdict."""

import pytest

from executive.words.robot_config import RobotConfig
from skills.robot import Pose2D
from tests.benchmarks.plant_mission import PlantMission

pytestmark = pytest.mark.mission


@pytest.mark.parametrize(
    ("seed", "sentence", "start"),
    [
        (78, "put the coke on the kitchen table", Pose2D(9.0, 5.9, 1.57)),
        pytest.param(78, "bring the coke to the office and come back", None, marks=pytest.mark.nightly),
        pytest.param(80, "put the wrench on the kitchen counter", None, marks=pytest.mark.nightly),
    ],
)
def test_fetch_brings_an_object_to_a_surface_and_hits_nothing(tmp_path, seed, sentence, start):
    robots = (RobotConfig("bob", "fetch", start),)
    mission = PlantMission(tmp_path, seed, sentence=sentence, world="flat", robots=robots, require_wake=False)
    ended = mission.end(sentence)
    assert ended.fulfilled, (ended.message, ended.why)
    assert (ended.collisions, ended.drops) == (0, 0), ended.events
