"""Docking through the adapter, in lock-step with the server. The dock is where the robot begins."""

from dataclasses import replace

import pytest

from errand_spot.server.docking import DOCK_ID
from skills.robot import CommandCause, CommandState, Pose2D


@pytest.fixture
def step(powered):
    powered.server.computer.dock_O = Pose2D(0.0, 0.0, 0.0)
    powered.advance(1.0)  # it has sat down
    return powered


def dock(step, station=DOCK_ID):
    return step.robot.dock(station, **step.until_in(30.0))


def undock(step):
    return step.robot.undock(**step.until_in(30.0))


def test_the_robot_leaves_its_dock_and_returns_to_it(step):
    assert (step.robot.capabilities().docks, step.connection.docked()) == (True, True)
    assert (step.ends(undock(step)).state, step.connection.docked()) == (CommandState.DONE, False)
    assert step.robot.odometry().pose.x_m > 0.7
    assert (step.ends(dock(step)).state, step.connection.docked()) == (CommandState.DONE, True)


@pytest.mark.parametrize(
    ("command", "cause", "reason"),
    [(undock, CommandCause.INVALID, "no dock"), (lambda step: dock(step, station=7), CommandCause.BLOCKED, "")],
    ids=["undocks again", "to an unknown dock"],
)
def test_a_robot_that_stands_on_no_dock_does_not_undock_or_dock_elsewhere(step, command, cause, reason):
    step.ends(undock(step))
    refused = step.ends(command(step))
    assert (refused.state, refused.cause, reason in refused.reason) == (CommandState.REFUSED, cause, True)


def test_stop_ends_the_undocking(step):
    command = undock(step)
    step.advance(1.0)
    step.robot.stop(lease=step.lease, only=command)
    assert step.status(command).cause is CommandCause.STOPPED
    step.advance(1.0)
    x_m = step.robot.odometry().pose.x_m
    step.advance(1.0)
    assert step.robot.odometry().pose.x_m == pytest.approx(x_m, abs=0.01)


def test_a_drive_replaces_the_undocking(step):
    command = undock(step)
    step.advance(1.5)
    step.drive(0.1, 0.5)
    assert "replaced" in step.status(command).reason


def test_undocking_needs_the_lease(step):
    step.lease = replace(step.lease, number=0)
    assert step.ends(undock(step)).cause is CommandCause.NO_LEASE
