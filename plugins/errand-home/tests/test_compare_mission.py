"""In the plant, the robot says what is the heaviest object on a surface, and the page judges it by the masses."""

import pytest

from skills.robot import Pose2D
from tests.missions.flat_mission import FlatMission

pytestmark = pytest.mark.mission


def test_the_robot_says_which_object_is_the_heaviest():
    command = "Take [Nothing] to [dresser] and do [compare] to [heaviest object]"
    mission = FlatMission((command,), world="home", seed=4, start=Pose2D(2.85, 1.48, -1.57), visuals=True)
    result, verdict = mission.run()
    assert (result.outcome.value, verdict.success) == ("success", True), (result, verdict)
