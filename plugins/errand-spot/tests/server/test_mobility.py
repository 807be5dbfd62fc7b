"""Motions of the base by a plant that is late, and their feedback before they begin."""

import time

import numpy as np
import pytest
from bosdyn.api import basic_command_pb2
from bosdyn.api.spot.robot_command_pb2 import MobilityParams

from errand_spot.server.mobility import Sit, Trajectory, Velocity
from errand_spot.server.server import Options, SpotServer
from plant.robots.spot.kind import spot_capabilities
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot


def velocity(end_s, _snapshot):
    request = basic_command_pb2.SE2VelocityCommand.Request(se2_frame_name="body")
    request.velocity.linear.x = 0.5
    return Velocity(request, MobilityParams(), end_s)


def trajectory(end_s, snapshot):
    request = basic_command_pb2.SE2TrajectoryCommand.Request(se2_frame_name="odom")
    request.trajectory.points.add().pose.position.x = 5.0
    return Trajectory(request, MobilityParams(), end_s, snapshot)


@pytest.mark.parametrize("motion_of", [velocity, trajectory])
def test_a_plant_that_is_late_does_not_drive_past_the_end(credentials, motion_of):
    clock = VirtualClock()
    robot = ScriptedRobot(clock, capabilities=spot_capabilities())
    computer = SpotServer(robot, clock, None, credentials, Options({})).computer
    computer.stand(0.52, 0.0)
    for _ in range(40):
        computer.step()
    computer.move({"mobility": motion_of(computer.now_s() + 0.5, computer.snapshot)})
    computer.step()
    assert robot.velocity[0] > 0.0
    time.sleep(0.6)  # nobody steps the plant
    for _ in range(8):
        computer.step()
    assert not np.any(robot.velocity)


def test_a_motion_is_in_progress_before_the_robot_begins_it(credentials):
    clock = VirtualClock()
    robot = ScriptedRobot(clock, capabilities=spot_capabilities())
    computer = SpotServer(robot, clock, None, credentials, Options({})).computer
    assert Sit().feedback.sit_feedback.status == basic_command_pb2.SitCommand.Feedback.STATUS_IN_PROGRESS
    walk = trajectory(9.0, computer.snapshot).feedback.se2_trajectory_feedback
    assert (walk.status, walk.final_goal_status) == (walk.STATUS_IN_PROGRESS, walk.FINAL_GOAL_STATUS_IN_PROGRESS)
