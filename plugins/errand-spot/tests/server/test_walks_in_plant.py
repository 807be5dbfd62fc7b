"""Walks towards the coffee table of the flat, 0.45 m high, which stands between the LiDAR's beams near the robot."""

import math
from unittest import mock

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")

from bosdyn.api import basic_command_pb2
from bosdyn.client.robot_command import RobotCommandBuilder as Build

from skills.robot import Pose2D
from tests.benchmarks.spot_client import SpotClient

pytestmark = pytest.mark.mission
Walk = basic_command_pb2.SE2TrajectoryCommand.Feedback


@pytest.fixture
def _patches_end():
    yield
    mock.patch.stopall()


# start in the world -> goal from there, ahead, backwards or aside
@pytest.mark.usefixtures("_patches_end")
@pytest.mark.parametrize(
    ("start", "goal"),
    [
        (Pose2D(9.55, 3.6, -0.5 * math.pi), (3.0, 0.0)),
        pytest.param(Pose2D(9.3, 3.3, 0.5 * math.pi), (-3.0, 0.0), marks=pytest.mark.nightly),
        pytest.param(Pose2D(9.3, 3.3, 0.0), (0.0, -3.0), marks=pytest.mark.nightly),
    ],
)
def test_a_walk_stops_before_a_low_table_and_stays_blocked(start, goal, tmp_path):
    client, told_later = SpotClient(start, 3, tmp_path), set()
    told = client.command(Build.synchro_se2_trajectory_point_command(*goal, 0.0, "odom"))

    def feedback():
        return told().mobility_command_feedback.se2_trajectory_feedback

    assert client.until(lambda: feedback().final_goal_status == Walk.FINAL_GOAL_STATUS_BLOCKED, 8.0)
    client.until(lambda: told_later.add(feedback().final_goal_status), 2.0)
    assert told_later == {Walk.FINAL_GOAL_STATUS_BLOCKED}
    assert not client.truth.referee.collisions
