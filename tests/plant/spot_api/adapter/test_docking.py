"""Docking through the adapter, in lock-step with the server. The dock is where the robot begins."""

from dataclasses import replace

import pytest

from plant.spot_api.server.docking import DOCK_ID
from skills.robot import CommandCause, CommandState, Pose2D


@pytest.fixture
def step(powered):
    powered.server.computer.dock_O = Pose2D(0.0, 0.0, 0.0)
    powered.advance(1.0)  # it has sat down
    return powered


def dock(step, station=DOCK_ID):
    return step.robot.dock(station, until_s=step.now() + 30.0, lease=step.lease)


def undock(step):
    return step.robot.undock(until_s=step.now() + 30.0, lease=step.lease)


def status(step, command):
    """Waits for the end of a command."""
    assert step.until(lambda: step.robot.command_status(command).state is not CommandState.RUNNING, 40.0)
    return step.robot.command_status(command)


def test_the_robot_leaves_its_dock_and_returns_to_it(step):
    assert step.robot.capabilities().docks
    assert step.connection.docked()
    assert status(step, undock(step)).state is CommandState.DONE
    assert not step.connection.docked()
    assert step.robot.odometry().pose.x_m > 0.7
    assert status(step, dock(step)).state is CommandState.DONE
    assert step.connection.docked()


def test_a_robot_that_stands_on_no_dock_does_not_undock(step):
    status(step, undock(step))
    again = status(step, undock(step))
    assert (again.state, again.cause) == (CommandState.REFUSED, CommandCause.INVALID)
    assert "no dock" in again.reason


def test_an_unknown_dock_is_refused_with_its_cause(step):
    status(step, undock(step))
    refused = status(step, dock(step, station=7))
    assert (refused.state, refused.cause) == (CommandState.REFUSED, CommandCause.BLOCKED)


def test_stop_ends_the_undocking(step):
    command = undock(step)
    step.advance(1.0)
    step.robot.stop(lease=step.lease, only=command)
    assert step.robot.command_status(command).cause is CommandCause.STOPPED
    step.advance(1.0)
    x_m = step.robot.odometry().pose.x_m
    step.advance(1.0)
    assert step.robot.odometry().pose.x_m == pytest.approx(x_m, abs=0.01)


def test_a_drive_replaces_the_undocking(step):
    command = undock(step)
    step.advance(1.5)
    step.robot.drive(0.1, 0.0, 0.0, until_s=step.now() + 0.5, lease=step.lease)
    assert "replaced" in step.robot.command_status(command).reason


def test_undocking_needs_the_lease(step):
    step.lease = replace(step.lease, number=0)
    assert status(step, undock(step)).cause is CommandCause.NO_LEASE
