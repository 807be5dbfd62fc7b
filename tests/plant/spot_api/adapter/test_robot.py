"""The adapter against the server, in lock-step.

drive              as asked, until its end or 0.6 s
expired, NaN       refused
lease taken        refused, lease_holder() names the other until it returns it
E-stop             a fault
no answer          old readings: drive refused, later a fault
"""

import math
import sys
from dataclasses import replace
from pathlib import Path

import grpc
import numpy as np
import pytest
from bosdyn.api import manipulation_api_pb2, robot_command_pb2, robot_state_pb2

sys.path.insert(0, str(Path(__file__).parents[1]))
from lock_step import LockStep

from plant.robots.spot.kind import spot_capabilities
from plant.spot_api.adapter import connection
from plant.spot_api.adapter.connection import Address, Connection
from skills.files.errors import InputError
from skills.robot import ArmTrajectory, CommandCause, CommandState, LeaseError
from skills.testing.blocks import Block
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot


class Silent(grpc.RpcError):
    """Call that fails with a code."""

    def __init__(self, code):
        self._code = code

    def code(self):
        return self._code

    def details(self):
        return "cut"


def scripted():
    clock = VirtualClock()
    return ScriptedRobot(clock, capabilities=spot_capabilities(), blocks=[Block(3.0, -1.5, 3.2, 1.5)]), clock


@pytest.fixture
def step(credentials):
    made = LockStep(scripted, credentials)
    yield made
    made.close()


@pytest.fixture
def standing(step):
    step.stand_up()
    step.lease = step.robot.acquire_lease("test")
    return step


def pose(step):
    return step.robot.odometry().pose


def test_readings_are_those_of_the_robot_behind_the_server(step):
    step.advance(0.2)
    ours, theirs = step.robot, step.served
    assert ours.odometry().X_OB.IsNearlyEqualTo(theirs.odometry().X_OB, 1e-6)
    assert ours.joints().position_rad == pytest.approx(theirs.joints().position_rad)
    assert ours.battery().charge == pytest.approx(theirs.battery().charge)
    assert ours.faults() == ()
    assert ours.imu() is None


def test_a_scan_has_the_ranges_of_the_lidar(step):
    step.advance(0.2)
    ours, theirs = step.robot.scan(), step.served.scan()
    points, expected = ours.points_B(), theirs.points_B()
    assert np.min(points[np.abs(points[:, 1]) < 0.2][:, 0]) == pytest.approx(
        np.min(expected[np.abs(expected[:, 1]) < 0.2][:, 0]), abs=0.02
    )
    assert ours.X_BL.IsNearlyEqualTo(theirs.X_BL, 1e-6)


@pytest.mark.parametrize("source", ["hand", "frontleft"])
def test_a_picture_has_colour_depth_and_frames(step, source):
    ours = step.robot.image(source)
    assert ours.depth_m.shape == (ours.depth_intrinsics.height, ours.depth_intrinsics.width)
    assert ours.grey.shape == (ours.intrinsics.height, ours.intrinsics.width)
    assert (ours.colour is not None) is (source == "hand")
    assert ours.frames.pose(ours.camera_frame).translation()[2] > 0.0


def test_an_unknown_camera_is_an_error(step):
    with pytest.raises(ValueError, match="periscope"):
        step.robot.image("periscope")


def test_a_drive_ends_at_its_time(standing):
    command = standing.robot.drive(0.5, 0.0, 0.0, until_s=standing.now() + 0.4, lease=standing.lease)
    assert standing.done(command)
    assert standing.robot.command_status(command).state is CommandState.DONE
    standing.advance(0.3)
    x_m = pose(standing).x_m
    assert x_m == pytest.approx(0.18, abs=0.04)
    standing.advance(0.5)
    assert pose(standing).x_m == pytest.approx(x_m, abs=1e-6)


def test_a_drive_that_nobody_renews_stops_after_six_tenths_of_a_second(standing):
    standing.robot.drive(0.5, 0.0, 0.0, until_s=standing.now() + 60.0, lease=standing.lease)
    standing.advance(2.0)
    assert pose(standing).x_m == pytest.approx(0.28, abs=0.04)


def test_no_drive_is_faster_than_the_adapter_allows(standing):
    standing.robot.drive(1.6, 0.0, 0.0, until_s=standing.now() + 0.5, lease=standing.lease)
    standing.advance(1.0)
    assert pose(standing).x_m == pytest.approx(0.35, abs=0.07)


def test_a_drive_keeps_the_posture_asked_for(standing):
    low = standing.robot.stand(0.46, 0.1, until_s=standing.now() + 5.0, lease=standing.lease)
    assert standing.done(low)
    standing.robot.drive(0.2, 0.0, 0.0, until_s=standing.now() + 0.3, lease=standing.lease)
    standing.advance(0.5)
    assert standing.served.height_m == pytest.approx(0.46, abs=0.01)


def test_a_posture_that_was_refused_is_not_kept(standing, monkeypatch):
    refused = robot_command_pb2.RobotCommandResponse.STATUS_BEHAVIOR_FAULT
    answer = robot_command_pb2.RobotCommandResponse(status=refused)
    with monkeypatch.context() as patch:
        service = standing.connection._stubs["robot-command"]
        patch.setattr(service, "RobotCommand", lambda _, timeout: answer)
        low = standing.robot.stand(0.46, 0.1, until_s=standing.now() + 5.0, lease=standing.lease)
    assert standing.robot.command_status(low).cause is CommandCause.FAULT
    standing.robot.drive(0.2, 0.0, 0.0, until_s=standing.now() + 0.3, lease=standing.lease)
    standing.advance(0.5)
    assert standing.served.height_m == pytest.approx(0.52, abs=0.01)


class Gripped:
    """Manipulation service that hears carry states; the first `silent` calls are not answered."""

    def __init__(self, silent=0, code=grpc.StatusCode.UNAVAILABLE):
        self.silent, self.code, self.heard = silent, code, []

    def OverrideGrasp(self, request, timeout):
        self.silent -= 1
        if self.silent >= 0:
            raise Silent(self.code)
        self.heard.append(request.carry_state_override.override_request)
        return manipulation_api_pb2.ApiGraspOverrideResponse()


State = robot_state_pb2.ManipulatorState


@pytest.mark.parametrize("silent", [0, 3])
def test_the_robot_hears_what_it_carries_as_soon_as_it_answers(standing, silent):
    standing.connection._stubs["manipulation"] = service = Gripped(silent)
    standing.robot.carry(True, lease=standing.lease)
    standing.until(lambda: service.heard, 0.5)
    standing.robot.carry(False, lease=standing.lease)
    assert service.heard == [State.CARRY_STATE_CARRIABLE, State.CARRY_STATE_NOT_CARRIABLE]


def test_a_robot_that_cannot_carry_is_told_once(standing):
    standing.connection._stubs["manipulation"] = service = Gripped(9, grpc.StatusCode.UNIMPLEMENTED)
    standing.robot.carry(True, lease=standing.lease)
    standing.advance(0.3)
    assert (service.silent, service.heard) == (8, [])


def test_only_the_holder_of_the_lease_says_what_is_carried(standing):
    standing.connection._stubs["manipulation"] = service = Gripped()
    standing.robot.carry(True, lease=replace(standing.lease, number=0))
    assert service.heard == []


@pytest.mark.parametrize(
    ("velocity", "ahead_s", "reason", "cause"),
    [
        ((math.nan, 0.0, 0.0), 1.0, "not finite", CommandCause.INVALID),
        ((0.1, 0.0, 0.0), -1.0, "expires", CommandCause.LATE),
    ],
)
def test_a_drive_that_cannot_be_is_refused(standing, velocity, ahead_s, reason, cause):
    command = standing.robot.drive(*velocity, until_s=standing.now() + ahead_s, lease=standing.lease)
    status = standing.robot.command_status(command)
    assert (status.state, reason in status.reason, status.cause) == (CommandState.REFUSED, True, cause)


def test_a_drive_without_power_has_that_cause(step):
    lease = step.robot.acquire_lease("test")
    command = step.robot.drive(0.1, 0.0, 0.0, until_s=step.now() + 0.5, lease=lease)
    assert step.robot.command_status(command).cause is CommandCause.UNPOWERED


def test_a_drive_may_last_as_long_as_the_capabilities_say(standing):
    assert standing.robot.capabilities().drive_expiry_s == 0.6


def test_a_lease_has_the_epoch_of_the_robot(standing):
    assert standing.lease.epoch == standing.connection.lease.epoch != ""


def test_the_arm_follows_a_trajectory(standing):
    now = standing.served.q_rad
    trajectory = ArmTrajectory(np.array([0.0, 1.5]), np.array([now, [0.0, -0.9, 1.8, 0.0, -0.9, 0.0]]))
    command = standing.robot.move_arm(trajectory, until_s=standing.now() + 8.0, lease=standing.lease)
    assert standing.done(command)
    assert standing.robot.command_status(command).state is CommandState.DONE
    assert standing.served.q_rad[2] == pytest.approx(1.8, abs=0.04)


def test_a_command_that_is_not_done_in_time_is_stopped(standing):
    now = standing.served.q_rad
    trajectory = ArmTrajectory(np.array([0.0, 3.0]), np.array([now, [0.0, -0.9, 1.8, 0.0, -0.9, 0.0]]))
    command = standing.robot.move_arm(trajectory, until_s=standing.now() + 0.3, lease=standing.lease)
    assert standing.done(command)
    assert "expired" in standing.robot.command_status(command).reason
    standing.advance(0.2)
    held = standing.served.q_rad.copy()
    standing.advance(1.0)
    assert standing.served.q_rad == pytest.approx(held, abs=1e-3)


def test_the_gripper_goes_to_an_opening(standing):
    command = standing.robot.set_gripper(0.8, 40.0, until_s=standing.now() + 5.0, lease=standing.lease)
    assert standing.done(command)
    assert standing.robot.gripper().opening == pytest.approx(0.8, abs=0.05)


def test_stop_ends_the_drive_and_not_the_gripper(standing):
    drive = standing.robot.drive(0.5, 0.0, 0.0, until_s=standing.now() + 0.6, lease=standing.lease)
    standing.advance(0.1)
    stop = standing.robot.stop(lease=standing.lease)
    assert standing.robot.command_status(drive).state is CommandState.STOPPED
    assert standing.robot.command_status(stop).state is not CommandState.REFUSED
    x_m = pose(standing).x_m
    standing.advance(0.5)
    assert pose(standing).x_m == pytest.approx(x_m, abs=0.02)


def test_a_later_command_replaces_an_earlier_one(standing):
    first = standing.robot.drive(0.2, 0.0, 0.0, until_s=standing.now() + 0.5, lease=standing.lease)
    standing.robot.drive(0.0, 0.0, 0.2, until_s=standing.now() + 0.5, lease=standing.lease)
    assert "replaced" in standing.robot.command_status(first).reason


def test_a_taken_lease_refuses_commands_and_says_who_took_it(standing, credentials):
    other = Connection(Address("127.0.0.1", standing.server.port, credentials.certificate), "user", "right")
    other.acquire(take=True)
    command = standing.robot.drive(0.2, 0.0, 0.0, until_s=standing.now() + 0.5, lease=standing.lease)
    status = standing.robot.command_status(command)
    assert status.state is CommandState.REFUSED
    assert "errand" in status.reason
    assert status.cause is CommandCause.NO_LEASE
    assert standing.robot.lease_holder().holder == "errand"
    other.give_back()
    assert standing.until(lambda: standing.robot.lease_holder() is None)


def test_a_lease_that_another_holds_is_not_acquired(step, credentials):
    other = Connection(Address("127.0.0.1", step.server.port, credentials.certificate), "user", "right")
    other.acquire()
    with pytest.raises(LeaseError, match="held by errand"):
        step.robot.acquire_lease("test")
    assert step.robot.take_lease("test") == step.robot.lease_holder()


def test_a_pressed_estop_is_a_fault(standing):
    standing.server.computer.estop._held["tablet"].level = 1
    standing.advance(0.2)
    assert "the E-stop is pressed" in standing.robot.faults()


def test_a_robot_that_does_not_answer_is_not_driven_and_becomes_a_fault(standing, monkeypatch):
    def silent(*_, **__):
        raise Silent(grpc.StatusCode.UNAVAILABLE)

    monkeypatch.setattr(standing.connection._stubs["robot-state"], "GetRobotState", silent)
    standing.advance(1.0)
    command = standing.robot.drive(0.2, 0.0, 0.0, until_s=standing.now() + 0.5, lease=standing.lease)
    status = standing.robot.command_status(command)
    assert ("old" in status.reason, status.cause) == (True, CommandCause.NO_ANSWER)
    standing.advance(3.0)
    assert any("has not answered" in fault for fault in standing.robot.faults())


@pytest.mark.parametrize(("password", "said"), [("wrong", "refuses user 'user'")])
def test_a_wrong_password_is_one_error(step, credentials, password, said):
    with pytest.raises(InputError, match=said):
        Connection(Address("127.0.0.1", step.server.port, credentials.certificate), "user", password)


def test_a_robot_that_is_not_there_is_one_error(monkeypatch, credentials):
    monkeypatch.setattr(connection, "_SLOW_S", 0.5)
    with pytest.raises(InputError, match=r"spot://127\.0\.0\.1:9: the robot does not answer"):
        Connection(Address("127.0.0.1", 9, credentials.certificate), "user", "right")
