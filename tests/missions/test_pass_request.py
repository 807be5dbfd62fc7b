"""A person who stands in the only doorway of a room is asked to let the robot pass, in the plant."""

import pytest

from executive.words.mission import Route
from executive.words.schemas import SPEECH
from skills.robot import Pose2D
from tests.benchmarks.plant_mission import PlantMission
from tests.visitors import OnMessage

pytestmark = pytest.mark.mission

DOOR_W = (5.60, 3.60)


def test_a_person_in_the_doorway_is_asked_and_makes_way(tmp_path):
    def stands_in_doorway(prepared):
        return prepared.world.without_people().with_routes({"Robin": Route(waypoints=(DOOR_W,), start=0.0)})

    options = {"sentence": "go to the office", "start": Pose2D(6.4, 4.5, 3.14), "time_limit_s": 150.0}
    mission = PlantMission(tmp_path, 0, change=stands_in_doorway, **options)
    said = []

    def hear(topic, message):
        if topic == SPEECH:
            said.append(message["text"])

    end = mission.end("door", OnMessage(hear))
    assert (end.fulfilled, end.people_hit, end.hit_by_people) == (True, 0, 0), end.message
    assert said[0] == "May I pass, please?" and "Thank you." in said
