"""The adapter against the server, in lock-step."""

import math
import time
from contextlib import closing
from dataclasses import replace
from functools import partial

import grpc
import numpy as np
import pytest
from bosdyn.api import gripper_camera_param_pb2, image_pb2, manipulation_api_pb2, robot_command_pb2, robot_state_pb2
from bosdyn.api.spot import robot_command_pb2 as spot_command_pb2
from call_faults import Fault
from lock_step import FailedCall, LockStep, scripted

from errand_spot.adapter import connection
from errand_spot.adapter.connection import Address, Connection
from errand_spot.adapter.readings import picture
from errand_spot.adapter.robot import ApiRobot
from plant.robots.spot.kind import spot_capabilities
from skills.inputs.errors import InputError
from skills.robot import ArmTrajectory, CommandCause, CommandState, FrameTree, LeaseError, NoImageError
from skills.testing.blocks import Block
from tests.tables import table

COMMANDS, TIME = "bosdyn.api.RobotCommandService", "bosdyn.api.TimeSyncService"
STATE = "bosdyn.api.RobotStateService/GetRobotState"
NUMBERED = robot_command_pb2.RobotCommandResponse(robot_command_id=7)
READY_RAD = [0.0, -0.9, 1.8, 0.0, -0.9, 0.0]


def pose(step):
    return step.robot.odometry().pose


def test_readings_are_those_of_the_robot_behind_the_server(step):
    step.advance(0.2)
    ours, theirs = step.robot, step.served
    assert ours.odometry().X_OB.IsNearlyEqualTo(theirs.odometry().X_OB, 1e-6)
    assert ours.joints().position_rad == pytest.approx(theirs.joints().position_rad)
    assert (ours.battery().charge, ours.faults()) == (pytest.approx(theirs.battery().charge), ())
    assert ours.imu() is None


def test_a_scan_has_the_ranges_of_the_lidar(step):
    step.advance(0.2)
    scans = step.robot.scan(), step.served.scan()
    ours_m, theirs_m = (np.min(p[np.abs(p[:, 1]) < 0.2][:, 0]) for p in (scan.points_B() for scan in scans))
    assert ours_m == pytest.approx(theirs_m, abs=0.02)
    assert scans[0].X_BL.IsNearlyEqualTo(scans[1].X_BL, 1e-6)


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
    command = standing.drive(0.5, 0.4)
    assert standing.done(command) and standing.status(command).state is CommandState.DONE
    standing.advance(0.3)
    x_m = pose(standing).x_m
    standing.advance(0.5)
    assert (x_m, pose(standing).x_m) == (pytest.approx(0.18, abs=0.04), pytest.approx(x_m, abs=1e-6))


# speed, end -> how far it goes: 0.6 s when nobody renews the drive, and at 0.8 m/s at most
def test_a_drive_that_nobody_renews_stops_after_six_tenths_of_a_second(standing):
    standing.drive(0.5, 60.0)
    standing.advance(2.0)
    assert pose(standing).x_m == pytest.approx(0.28, abs=0.04)


def test_no_drive_is_faster_than_the_adapter_allows(standing):
    standing.drive(1.6, 0.5)
    standing.advance(1.0)
    assert pose(standing).x_m == pytest.approx(0.35, abs=0.07)


def test_a_drive_keeps_the_posture_asked_for(standing):
    assert standing.done(standing.robot.stand(0.46, 0.1, **standing.until_in(5.0)))
    standing.drive(0.2, 0.3)
    standing.advance(0.5)
    assert standing.served.height_m == pytest.approx(0.46, abs=0.01)


def test_a_posture_that_was_refused_is_not_kept(standing, monkeypatch):
    refused = robot_command_pb2.RobotCommandResponse.STATUS_BEHAVIOR_FAULT
    answer = robot_command_pb2.RobotCommandResponse(status=refused)
    with monkeypatch.context() as patch:
        patch.setattr(standing.connection._stubs["robot-command"], "RobotCommand", lambda _, timeout: answer)
        low = standing.robot.stand(0.46, 0.1, **standing.until_in(5.0))
    assert standing.status(low).cause is CommandCause.FAULT
    standing.drive(0.2, 0.3)
    standing.advance(0.5)
    assert standing.served.height_m == pytest.approx(0.52, abs=0.01)


class Gripped:
    """Manipulation service that hears carry states; the first `silent` calls are not answered."""

    def __init__(self, silent=0, code=grpc.StatusCode.UNAVAILABLE):
        self.silent, self.code, self.heard = silent, code, []

    def OverrideGrasp(self, request, timeout):
        self.silent -= 1
        if self.silent >= 0:
            raise FailedCall(self.code)
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
    ("vx", "ahead_s", "reason", "cause"),
    [(math.nan, 1.0, "not finite", CommandCause.INVALID), (0.1, -1.0, "expires", CommandCause.LATE)],
)
def test_a_drive_that_cannot_be_is_refused(standing, vx, ahead_s, reason, cause):
    status = standing.status(standing.drive(vx, ahead_s))
    assert (status.state, reason in status.reason, status.cause) == (CommandState.REFUSED, True, cause)


def test_a_drive_without_power_has_that_cause(step):
    step.lease = step.robot.acquire_lease("test")
    assert step.status(step.drive(0.1, 0.5)).cause is CommandCause.UNPOWERED


def test_a_drive_may_last_as_long_as_the_capabilities_say(standing):
    assert standing.robot.capabilities().drive_expiry_s == 0.6


def test_a_lease_has_the_epoch_of_the_robot(standing):
    assert standing.lease.epoch == standing.connection.lease.epoch != ""


def move_arm(standing, lasts_s, ahead_s=8.0):
    """Begins to move the arm to its ready posture."""
    path = ArmTrajectory(np.array([0.0, lasts_s]), np.array([standing.served.q_rad, READY_RAD]))
    return standing.robot.move_arm(path, **standing.until_in(ahead_s))


def stays(standing, after_s=0.2, off_rad=1e-3):
    """Whether the arm stays where it is after a while."""
    standing.advance(after_s)
    q_rad = standing.served.q_rad.copy()
    standing.advance(1.0)
    return bool(np.abs(standing.served.q_rad - q_rad).max() < off_rad)


def test_the_arm_follows_a_trajectory_and_holds_there(standing):
    assert standing.ends(move_arm(standing, 1.5)).state is CommandState.DONE
    assert standing.served.q_rad == pytest.approx(READY_RAD, abs=0.04) and stays(standing)


def test_a_command_that_is_not_done_in_time_is_stopped(standing):
    assert "expired" in standing.ends(move_arm(standing, 3.0, ahead_s=0.3)).reason and stays(standing)


def test_the_gripper_goes_to_an_opening(standing):
    assert standing.done(standing.robot.set_gripper(0.8, 40.0, **standing.until_in(5.0)))
    assert standing.robot.gripper().opening == pytest.approx(0.8, abs=0.05)


def test_an_arm_that_leaves_its_path_is_stopped(standing, monkeypatch):
    """Something turns a joint of the arm by 0.2 rad while it moves."""
    command = move_arm(standing, 3.0)
    standing.advance(0.5)
    assert standing.status(command).state is CommandState.RUNNING
    joints = type(standing.served).joints

    def pushed(robot):
        read = joints(robot)
        return replace(read, position_rad={**read.position_rad, "arm_sh0": read.position_rad["arm_sh0"] + 0.2})

    monkeypatch.setattr(type(standing.served), "joints", pushed)
    standing.advance(0.05)
    status = standing.robot.command_status(command)
    assert (status.state, status.cause) == (CommandState.STOPPED, CommandCause.BLOCKED)
    assert "0.20 rad off its path" in status.reason and stays(standing, 0.0, off_rad=0.21)


@pytest.mark.parametrize(
    ("code", "cause"),
    [(grpc.StatusCode.UNAVAILABLE, CommandCause.NO_ANSWER), (grpc.StatusCode.INTERNAL, CommandCause.FAULT)],
)
def test_an_arm_without_feedback_is_stopped(standing, code, cause):
    command = move_arm(standing, 3.0)
    with standing.server.faults.fault(f"{COMMANDS}/RobotCommandFeedback", Fault(code=code)):
        standing.advance(0.1)
        standing.advance(0.1)
    status = standing.robot.command_status(command)
    assert (status.state, status.cause) == (CommandState.STOPPED, cause) and stays(standing, 0.1)


def test_nothing_moves_by_clocks_that_were_synchronised_long_ago(standing):
    with standing.server.faults.fault(f"{TIME}/TimeSyncUpdate", Fault(code=grpc.StatusCode.INTERNAL)):
        for _ in range(32):
            standing.advance(1.0)
        trajectory = ArmTrajectory(np.array([0.5]), np.array([READY_RAD]))
        until, robot = standing.until_in(1.0), standing.robot
        refused = [robot.drive(0.2, 0.0, 0.0, **until), robot.stand(0.5, 0.0, **until)]
        refused += [robot.move_arm(trajectory, **until), robot.set_gripper(0.5, 20.0, **until)]
        assert all("clocks" in standing.status(command).reason for command in refused)
    standing.advance(0.1)
    assert standing.status(standing.drive(0.2)).state is CommandState.RUNNING


def test_the_robots_clock_is_measured_again_when_it_jumps(standing):
    standing.server.computer._started_s += 100.0
    with standing.server.faults.fault(f"{TIME}/TimeSyncUpdate", Fault(code=grpc.StatusCode.INTERNAL)):
        standing.robot.poll()
        standing.robot_time_s = lambda: standing.server.computer.now_s() - 100.0
        standing.robot.poll()
        assert "clocks" in standing.status(standing.drive(0.2)).reason
    del standing.robot_time_s
    standing.advance(0.1)
    assert standing.status(standing.drive(0.2)).state is CommandState.RUNNING


def test_the_height_is_that_over_the_feet_and_a_robot_off_its_feet_is_not_driven(standing):
    z_m = standing.robot.odometry().X_OB.translation()[2]
    lifted = Fault(fields={"robot_state.foot_state.contact": robot_state_pb2.FootState.CONTACT_LOST})
    with standing.server.faults.fault(STATE, lifted):
        standing.advance(0.1)
        assert "no foot is on the floor, so the height is unknown" in standing.robot.faults()
        assert standing.robot.odometry().X_OB.translation()[2] == pytest.approx(z_m)
        assert standing.status(standing.drive(0.2)).cause is CommandCause.FAULT
    sunk = Fault(fields={"robot_state.foot_state.foot_position_rt_body.z": -0.4})
    with standing.server.faults.fault(STATE, sunk):
        standing.advance(0.1)
        assert standing.robot.odometry().X_OB.translation()[2] == pytest.approx(0.4)


@pytest.mark.parametrize(("severity", "counts"), [("INFO", False), ("WARN", False), ("CRITICAL", True)])
def test_only_severe_faults_count(step, severity, counts):
    step.served.present_faults = ("hot",)
    number = robot_state_pb2.SystemFault.Severity.Value(f"SEVERITY_{severity}")
    fault = Fault(fields={"robot_state.system_fault_state.faults.severity": number})
    with step.server.faults.fault(STATE, fault):
        step.advance(0.1)
    assert ("hot" in step.robot.faults()) is counts


@pytest.mark.parametrize(*table(__file__, "pictures", ({"image_responses.shot.image.data": b"x"}, "cannot be decoded")))
def test_a_picture_that_cannot_be_used_is_no_picture(step, fields, said):
    fault = step.server.faults.fault("bosdyn.api.ImageService/GetImage", Fault(fields=fields))
    with fault, pytest.raises(NoImageError, match=said):
        step.robot.image("hand")


def test_intrinsics_and_frames_are_those_of_each_picture(step):
    before = step.robot.image("hand")
    moved = {"source.pinhole.intrinsics.focal_length.x": 500.0, "shot.frame_name_image_sensor": "frontleft"}
    fault = Fault(fields={f"image_responses.{name}": value for name, value in moved.items()})
    with step.server.faults.fault("bosdyn.api.ImageService/GetImage", fault):
        picture = step.robot.image("hand")
    assert (before.intrinsics.fx != 500.0, picture.intrinsics.fx) == (True, 500.0)
    other = step.robot.image("frontleft")
    assert picture.frames.pose("hand_camera").IsNearlyEqualTo(other.frames.pose("frontleft_camera"), 1e-6)


@pytest.mark.parametrize(
    ("wanted", "depth"), [({}, "frontleft_depth_in_visual_frame"), ({"visual": False}, "frontleft_depth")]
)
def test_depth_with_a_picture_is_that_of_its_pose(step, monkeypatch, wanted, depth):
    asked = []
    service = step.connection._stubs["image"]
    take = service.GetImage
    monkeypatch.setattr(service, "GetImage", lambda request, timeout: asked.append(request) or take(request))
    step.robot.image("frontleft", **wanted)
    assert [each.image_source_name for each in asked[0].image_requests][-1] == depth


def test_the_most_that_a_camera_measures_is_no_depth():
    raw = np.array([[0, 65535, 1500]], dtype=np.uint16)
    answer = image_pb2.ImageResponse(status=image_pb2.ImageResponse.STATUS_OK)
    answer.source.cols, answer.source.rows, answer.source.depth_scale = 3, 1, 1000.0
    answer.source.pinhole.intrinsics.focal_length.x = answer.source.pinhole.intrinsics.focal_length.y = 1.0
    image = answer.shot.image
    image.rows, image.cols, image.data = 1, 3, raw.tobytes()
    image.format, image.pixel_format = image_pb2.Image.FORMAT_RAW, image_pb2.Image.PIXEL_FORMAT_DEPTH_U16
    made = picture("hand", "hand_camera", [answer], 0.0, FrameTree({}), coloured=True)
    assert made.depth_m.tolist() == [[0.0, 0.0, 1.5]]


def test_the_focus_of_the_hand_is_fixed(step):
    step.robot.sensors.fix_focus()
    request = gripper_camera_param_pb2.GripperCameraGetParamRequest()
    params = step.connection.call("gripper-camera-param", "GetParams", request).params
    assert (params.HasField("focus_auto"), params.focus_auto.value) == (True, False)


def test_without_a_lidar_the_depth_cameras_make_the_scan(credentials):
    blind = replace(spot_capabilities(), lidar_height_m=None)
    build = partial(scripted, capabilities=blind, blocks=[Block(1.9, -1.5, 2.1, 1.5)])
    with closing(LockStep(build, credentials)) as step:
        step.advance(0.1)
        points = step.robot.scan().points_B()
        ahead = points[(np.abs(points[:, 1]) < 0.2) & (points[:, 2] > -0.3)]
        assert ahead[:, 0].min() == pytest.approx(1.9, abs=0.05)
        assert np.linalg.norm(points, axis=1).max() < 4.5 and "no LiDAR" in step.robot.sensors.notes[0]
        first = step.robot.scan()
        step.advance(0.5)
        assert step.robot.scan().stamp_s > first.stamp_s


def test_the_robots_own_avoidance_is_on_with_the_padding_asked_for(standing, monkeypatch):
    sent = []
    robot = ApiRobot("Alice", standing.connection, standing, spot_capabilities(), padding_m=0.15)
    lease = robot.acquire_lease("test")
    monkeypatch.setattr(standing.connection, "command", lambda command: sent.append(command) or NUMBERED)
    robot.drive(3.0, -4.0, 2.0, until_s=standing.now() + 1.0, lease=lease)
    request = sent[0].synchronized_command.mobility_command
    params = spot_command_pb2.MobilityParams()
    request.params.Unpack(params)
    given = request.se2_velocity_request.velocity
    assert (given.linear.x, given.linear.y, given.angular) == pytest.approx((0.48, -0.64, 1.0))
    most, least = params.vel_limit.max_vel, params.vel_limit.min_vel
    assert (most.linear.x, most.angular, least.linear.y, least.angular) == pytest.approx((0.8, 1.0, -0.8, -1.0))
    assert params.obstacle_params.obstacle_avoidance_padding == pytest.approx(0.15)
    assert not params.obstacle_params.disable_vision_body_obstacle_avoidance


@pytest.mark.parametrize("seconds", [math.nan, 1.0])
def test_numbers_that_are_not_finite_are_refused(standing, seconds):
    robot, until, bad = standing.robot, standing.until_in(seconds), math.nan if seconds == 1.0 else 0.1
    commands = [robot.drive(bad, 0.0, 0.0, **until), robot.stand(0.5, bad, **until)]
    commands += [robot.set_gripper(bad, 20.0, **until)]
    assert {standing.status(command).cause for command in commands} == {CommandCause.INVALID}


def test_stop_ends_the_drive_and_not_the_gripper(standing):
    drive = standing.drive(0.5, 0.6)
    standing.advance(0.1)
    stop = standing.robot.stop(lease=standing.lease)
    assert standing.status(drive).state is CommandState.STOPPED
    assert standing.status(stop).state is not CommandState.REFUSED
    x_m = pose(standing).x_m
    standing.advance(0.5)
    assert pose(standing).x_m == pytest.approx(x_m, abs=0.02)


def test_a_later_command_replaces_an_earlier_one(standing):
    first = standing.drive(0.2, 0.5)
    standing.drive(0.0, 0.5, wz=0.2)
    assert "replaced" in standing.status(first).reason


def test_a_taken_lease_refuses_commands_and_says_who_took_it(standing, credentials):
    other = Connection(Address("127.0.0.1", standing.server.port, credentials.certificate), "user", "right")
    other.acquire(take=True)
    status = standing.status(standing.drive(0.2, 0.5))
    assert (status.state, status.cause) == (CommandState.REFUSED, CommandCause.NO_LEASE)
    assert "errand" in status.reason and standing.robot.lease_holder().holder == "errand"
    other.give_back()
    assert standing.until(lambda: standing.robot.lease_holder() is None)


def test_a_lease_that_another_holds_is_not_acquired(step, credentials):
    Connection(Address("127.0.0.1", step.server.port, credentials.certificate), "user", "right").acquire()
    with pytest.raises(LeaseError, match="held by errand"):
        step.robot.acquire_lease("test")
    assert step.robot.take_lease("test") == step.robot.lease_holder()


def test_a_pressed_estop_is_a_fault(standing):
    standing.server.computer.estop._held["tablet"].level = 1
    standing.advance(0.2)
    assert "the E-stop is pressed" in standing.robot.faults()


def test_a_robot_that_does_not_answer_is_not_driven_and_becomes_a_fault(standing, monkeypatch):
    def silent(*_, **__):
        raise FailedCall(grpc.StatusCode.UNAVAILABLE)

    monkeypatch.setattr(standing.connection._stubs["robot-state"], "GetRobotState", silent)
    standing.advance(1.0)
    status = standing.status(standing.drive(0.2, 0.5))
    assert ("old" in status.reason, status.cause) == (True, CommandCause.NO_ANSWER)
    standing.advance(3.0)
    assert any("has not answered" in fault for fault in standing.robot.faults())


def test_a_wrong_password_is_one_error(step, credentials):
    with pytest.raises(InputError, match="refuses user 'user'"):
        Connection(Address("127.0.0.1", step.server.port, credentials.certificate), "user", "wrong")


def test_a_robot_that_is_not_there_is_one_error(monkeypatch, credentials):
    monkeypatch.setattr(connection, "SLOW_S", 0.5)
    with pytest.raises(InputError, match=r"spot://127\.0\.0\.1:9: the robot does not answer"):
        Connection(Address("127.0.0.1", 9, credentials.certificate), "user", "right")


@pytest.mark.parametrize("fault", [Fault(answer_s=math.inf), Fault(code=grpc.StatusCode.UNAVAILABLE)])
def test_a_lidar_that_does_not_answer_stops_neither_heartbeat_nor_drive(standing, fault):
    standing.advance(0.3)
    standing.robot.heartbeat._beat_s = -math.inf
    with standing.server.faults.fault("bosdyn.api.PointCloudService/GetPointCloud", fault):
        standing.advance(0.3)
        assert standing.robot.heartbeat._beat_s > 0.0
        command = standing.drive(0.2, 0.3)
        standing.advance(0.1)
        assert standing.status(command).state is CommandState.RUNNING
        begun_s = time.monotonic()
        standing.advance(0.1)  # it is not asked again at once
        assert time.monotonic() - begun_s < 0.4
