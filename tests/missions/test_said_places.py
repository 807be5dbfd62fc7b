"""In the plant, claim and referee know the place that was said, of people and of objects."""

import pytest

from tests.benchmarks.plant_mission import PlantMission

pytestmark = pytest.mark.mission


def test_a_person_who_is_not_at_the_said_place_is_not_met_elsewhere(tmp_path):
    end = PlantMission(tmp_path, 0, sentence="meet Robin in the kitchen").end("met")  # who is in the living room
    assert (end.claimed, end.fulfilled, end.cause) == (False, False, "POSTCONDITION"), end.why
    assert end.message.startswith("Robin is not in the kitchen: nobody is seen in the kitchen")


@pytest.mark.nightly
def test_an_object_is_taken_from_elsewhere_than_the_place_that_was_left_out(tmp_path):
    end = PlantMission(tmp_path, 43017, sentence="bring me a cube, not the one on the workbench").end("taken")
    assert (end.claimed, end.fulfilled) == (True, True), end.why
    assert "lifted from the tool trolley" in end.why
