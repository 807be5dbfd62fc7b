"""Fetch brings objects to surfaces without a touch of furniture or a drop, by the referee's verdict."""

import pytest

from executive.words.robot_config import RobotConfig
from tests.benchmarks.plant_mission import PlantMission

pytestmark = pytest.mark.mission


@pytest.mark.parametrize(
    ("seed", "sentence"),
    [
        (78, "bring the coke to the office and come back"),
        pytest.param(80, "put the wrench on the kitchen counter", marks=pytest.mark.nightly),
    ],
)
def test_fetch_brings_an_object_to_a_surface_and_hits_nothing(tmp_path, seed, sentence):
    robots = (RobotConfig("bob", "fetch"),)
    mission = PlantMission(tmp_path, seed, sentence=sentence, world="flat", robots=robots, require_wake=False)
    ended = mission.end(sentence)
    assert ended.fulfilled, (ended.message, ended.why)
    assert (ended.collisions, ended.drops) == (0, 0), ended.events
