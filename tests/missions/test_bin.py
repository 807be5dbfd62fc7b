"""Objects are thrown into a bin, by the referee's verdict."""

import pytest

from executive.run.outcome import Outcome
from tests.missions.flat_mission import FlatMission

pytestmark = pytest.mark.mission

TAKE, THROW = (
    "Take [Nothing] to [kitchen] and do [grasp] to [coke]",
    "Take [coke] to [kitchen bin] and do [place] to [coke]",
)


def test_the_robot_throws_a_coke_into_the_bin_and_sees_it_there():
    mission = FlatMission([TAKE, THROW])
    result, verdict = mission.run()
    assert result.outcome is Outcome.SUCCESS, result.message
    assert verdict.success and "rests in the kitchen bin" in verdict.why, verdict.why
    assert (verdict.collisions, verdict.drops) == (0, 0), verdict.events
