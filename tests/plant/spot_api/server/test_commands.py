"""Motion commands of the SDK, and the answer to each that cannot be done.

motors off            not powered on         frame unknown         unknown frame
clock not synchronised  no time sync         part not simulated    unsupported
end time past         expired                NaN                   invalid request
end time an hour on   too distant            lease taken           the robot stops
"""

import math
import time

import bosdyn.client.robot_command as rc
import numpy as np
import pytest
from bosdyn.api import (
    arm_command_pb2,
    basic_command_pb2,
    geometry_pb2,
    gripper_command_pb2,
    mobility_command_pb2,
    power_pb2,
    robot_command_pb2,
    synchronized_command_pb2,
)
from bosdyn.client.exceptions import InvalidRequestError
from bosdyn.client.frame_helpers import get_a_tform_b, get_odom_tform_body
from bosdyn.client.math_helpers import SE3Pose
from bosdyn.client.robot_command import RobotCommandBuilder as Build
from bosdyn.geometry import EulerZXY

from plant.spot_api.messages import timestamp
from plant.spot_api.server.arm import smooth
from plant.spot_api.server.computer import Pace

PACE = Pace.CLIENT
Progress = basic_command_pb2.RobotCommandFeedbackStatus


def wait_until(true, seconds=5.0):
    """Waits until a condition holds; returns whether it did in time."""
    until = time.monotonic() + seconds
    while not true() and time.monotonic() < until:
        time.sleep(0.02)
    return true()


def sent(spot, command, ahead_s=5.0):
    return spot.commands.robot_command(command, end_time_secs=time.time() + ahead_s)


def base_feedback(spot, command_id):
    return spot.commands.robot_command_feedback(command_id).feedback.synchronized_feedback.mobility_command_feedback


def test_a_velocity_is_driven_until_its_end(spot):
    command = sent(spot, Build.synchro_velocity_command(0.5, 0.0, 0.0), ahead_s=1.0)
    assert wait_until(lambda: base_feedback(spot, command).status == Progress.STATUS_COMMAND_TIMED_OUT)
    time.sleep(0.2)
    x_m = get_odom_tform_body(spot.tree).x
    assert x_m == pytest.approx(0.5, abs=0.08)
    time.sleep(0.2)
    assert get_odom_tform_body(spot.tree).x == pytest.approx(x_m, abs=0.01)


def test_a_pose_is_driven_to(spot):
    command = sent(spot, Build.synchro_se2_trajectory_point_command(0.4, 0.2, 0.5, "odom"))
    assert rc.block_for_trajectory_cmd(spot.commands, command, timeout_sec=5.0, feedback_interval_secs=0.05)
    body = get_odom_tform_body(spot.tree)
    assert (body.x, body.y, body.rot.to_yaw()) == pytest.approx((0.4, 0.2, 0.5), abs=0.04)


def test_a_pose_in_the_body_frame_stays_where_it_was(spot):
    command = Build.synchro_trajectory_command_in_body_frame(0.3, 0.0, 0.0, spot.tree)
    assert rc.block_for_trajectory_cmd(spot.commands, sent(spot, command), timeout_sec=5.0, feedback_interval_secs=0.05)
    assert get_odom_tform_body(spot.tree).x == pytest.approx(0.3, abs=0.04)


def test_a_later_command_overrides_an_earlier_one(spot):
    first = sent(spot, Build.synchro_velocity_command(0.2, 0.0, 0.0))
    sent(spot, Build.stop_command())
    assert wait_until(lambda: base_feedback(spot, first).status == Progress.STATUS_COMMAND_OVERRIDDEN)
    x_m = get_odom_tform_body(spot.tree).x
    time.sleep(0.2)
    assert get_odom_tform_body(spot.tree).x == pytest.approx(x_m, abs=0.005)


def test_the_body_stands_at_the_height_and_pitch_asked_for(spot):
    rc.blocking_stand(
        spot.commands,
        timeout_sec=5.0,
        update_frequency=20.0,
        params=Build.mobility_params(body_height=-0.05, footprint_R_body=EulerZXY(pitch=0.2)),
    )
    assert spot.served.scripted.height_m == pytest.approx(0.47, abs=0.01)
    assert spot.served.scripted.pitch_rad == pytest.approx(0.2, abs=0.02)


def test_the_arm_goes_to_its_named_positions(spot):
    for build, position in ((Build.arm_ready_command, 1.8), (Build.arm_stow_command, 3.06)):
        rc.block_until_arm_arrives(spot.commands, spot.commands.robot_command(build()), timeout_sec=8.0)
        assert spot.served.scripted.q_rad[2] == pytest.approx(position, abs=0.05)


def test_the_hand_goes_to_a_pose(spot):
    command = Build.arm_pose_command(0.75, 0.1, 0.3, 1.0, 0.0, 0.0, 0.0, "body", 1.0)
    assert rc.block_until_arm_arrives(spot.commands, spot.commands.robot_command(command), timeout_sec=8.0)
    hand = get_a_tform_b(spot.tree, "body", "hand")
    assert (hand.x, hand.y, hand.z) == pytest.approx((0.75, 0.1, 0.3), abs=0.01)


def test_a_pose_out_of_reach_is_stalled_and_moves_nothing(spot):
    before = spot.served.scripted.q_rad.copy()
    command = spot.commands.robot_command(Build.arm_pose_command(2.0, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0, "body", 1.0))
    stalled = arm_command_pb2.ArmCartesianCommand.Feedback.STATUS_TRAJECTORY_STALLED

    def status():
        found = spot.commands.robot_command_feedback(command).feedback.synchronized_feedback
        return found.arm_command_feedback.arm_cartesian_feedback.status

    assert wait_until(lambda: status() == stalled)
    assert spot.served.scripted.q_rad == pytest.approx(before, abs=1e-6)


def test_joints_pass_their_postures_at_the_times_asked_for(spot):
    rc.block_until_arm_arrives(spot.commands, spot.commands.robot_command(Build.arm_ready_command()), timeout_sec=8.0)
    ready = [0.0, -0.9, 1.8, 0.0, -0.9, 0.0]
    postures = [[0.2 * k, *ready[1:]] for k in (1, 2, 3)]
    began = time.monotonic()
    command = Build.arm_joint_move_helper(joint_positions=postures, times=[0.5, 1.0, 1.5])
    assert rc.block_until_arm_arrives(spot.commands, spot.commands.robot_command(command), timeout_sec=8.0)
    assert spot.served.scripted.q_rad[0] == pytest.approx(0.6, abs=0.04)
    assert 1.3 < time.monotonic() - began < 2.5


def test_the_gripper_opens_by_a_share(spot):
    spot.commands.robot_command(Build.claw_gripper_open_fraction_command(0.5))
    assert wait_until(lambda: abs(spot.states.get_robot_state().manipulator_state.gripper_open_percentage - 50.0) < 4.0)


def test_arm_and_base_move_together_and_report_apart(spot):
    command = Build.build_synchro_command(Build.arm_ready_command(), Build.synchro_velocity_command(0.2, 0.0, 0.0))
    found = spot.commands.robot_command_feedback(sent(spot, command, 1.0)).feedback.synchronized_feedback
    assert found.HasField("arm_command_feedback")
    assert found.HasField("mobility_command_feedback")
    assert not found.HasField("gripper_command_feedback")


def test_safe_power_off_sits_and_switches_the_motors_off(spot):
    spot.robot.power_off(cut_immediately=False, timeout_sec=10, update_frequency=20.0)
    assert not spot.robot.is_powered_on()
    assert spot.served.scripted.height_m < 0.3
    with pytest.raises(rc.NotPoweredOnError):
        sent(spot, Build.synchro_velocity_command(0.1, 0.0, 0.0))


def test_a_taken_lease_stops_the_robot_and_ends_the_earlier_one(spot):
    sent(spot, Build.synchro_velocity_command(0.3, 0.0, 0.0))
    spot.served.login().ensure_client("lease").take("body")
    assert wait_until(lambda: not any(spot.served.scripted.velocity))
    with pytest.raises(rc.ResponseError):
        sent(spot, Build.synchro_velocity_command(0.1, 0.0, 0.0))


def test_an_estop_cuts_the_motors(spot):
    estop = spot.served.server.computer.estop
    estop._held["tablet"].level = 1
    assert wait_until(lambda: not spot.robot.is_powered_on())


def raw(spot, request, *, clock=None):
    """Sends a mobility request past the builders of the SDK."""
    command = robot_command_pb2.RobotCommand(
        synchronized_command=synchronized_command_pb2.SynchronizedCommand.Request(mobility_command=request)
    )
    lease = spot.robot.lease_wallet.get_lease("body").create_newer().lease_proto
    message = robot_command_pb2.RobotCommandRequest(
        lease=spot.robot.lease_wallet.advance("body").lease_proto if lease else None,
        command=command,
        clock_identifier=clock or spot.robot.time_sync.endpoint.clock_identifier,
    )
    message.header.client_name = "test"
    return spot.commands._stub.RobotCommand(message)


def velocity(end_s, frame="body", x=0.1):
    return mobility_command_pb2.MobilityCommand.Request(
        se2_velocity_request=basic_command_pb2.SE2VelocityCommand.Request(
            end_time=timestamp(end_s),
            se2_frame_name=frame,
            velocity=geometry_pb2.SE2Velocity(linear=geometry_pb2.Vec2(x=x)),
        )
    )


Status = robot_command_pb2.RobotCommandResponse


@pytest.mark.parametrize(
    ("request_of", "clock", "status", "said"),
    [
        (lambda now: velocity(now - 1.0), None, Status.STATUS_EXPIRED, "1.0"),
        (lambda now: velocity(now + 3600.0), None, Status.STATUS_TOO_DISTANT, "at most 600 s"),
        (lambda now: velocity(now + 1.0, frame="moon"), None, Status.STATUS_UNKNOWN_FRAME, "moon"),
        (lambda now: velocity(now + 1.0, x=math.nan), None, Status.STATUS_INVALID_REQUEST, "linear.x is nan"),
        (lambda now: velocity(now + 1.0), "unknown clock", Status.STATUS_NO_TIMESYNC, "clock"),
        (lambda now: mobility_command_pb2.MobilityCommand.Request(), None, Status.STATUS_UNSUPPORTED, "no command"),
    ],
    ids=["expired", "too distant", "frame", "NaN", "clock", "empty"],
)
def test_a_command_that_cannot_be_done_says_why_and_moves_nothing(spot, request_of, clock, status, said):
    answer = raw(spot, request_of(time.time()), clock=clock)
    assert answer.status == status
    assert said in answer.message
    time.sleep(0.1)
    assert not any(spot.served.scripted.velocity)


def test_feedback_of_an_unknown_command_is_an_invalid_request(spot):
    with pytest.raises(InvalidRequestError):
        spot.commands.robot_command_feedback(4711)


def test_the_camera_looks_at_a_point(spot):
    target = SE3Pose(2.0, 0.5, 0.0, EulerZXY().to_quaternion())
    command = Build.arm_gaze_command(target.x, target.y, target.z, "odom")
    assert rc.block_until_arm_arrives(spot.commands, spot.commands.robot_command(command), timeout_sec=8.0)
    hand_target = get_a_tform_b(spot.tree, "hand", "odom") * target
    assert math.atan2(math.hypot(hand_target.y, hand_target.z), hand_target.x) < 0.1


def arm_feedback(spot, command_id):
    return spot.commands.robot_command_feedback(command_id).feedback.synchronized_feedback.arm_command_feedback


def test_an_arm_that_refuses_is_stalled_and_not_complete(spot):
    spot.served.scripted.refuse_because["move_arm"] = "a fault"
    command = spot.commands.robot_command(Build.arm_ready_command())
    stalled = arm_command_pb2.NamedArmPositionsCommand.Feedback.STATUS_STALLED_HOLDING_ITEM
    assert wait_until(lambda: arm_feedback(spot, command).named_arm_position_feedback.status == stalled)


def test_a_robot_that_does_not_stand_up_is_not_standing(spot):
    spot.served.scripted.refuse_because["stand"] = "a fault"
    command = spot.commands.robot_command(Build.synchro_stand_command(body_height=-0.1))
    time.sleep(1.3)
    standing = basic_command_pb2.StandCommand.Feedback.STATUS_IS_STANDING
    assert base_feedback(spot, command).stand_feedback.status != standing


def test_a_gripper_that_refuses_applies_no_force(spot):
    spot.served.scripted.refuse_because["set_gripper"] = "a fault"
    command = spot.commands.robot_command(Build.claw_gripper_open_command())
    time.sleep(0.3)
    found = spot.commands.robot_command_feedback(command).feedback.synchronized_feedback.gripper_command_feedback
    assert found.claw_gripper_feedback.status == gripper_command_pb2.ClawGripperCommand.Feedback.STATUS_UNKNOWN


def test_a_gaze_that_no_posture_has_is_stalled(spot, monkeypatch):
    monkeypatch.setattr("plant.spot_api.server.hand.solutions", lambda solver, X_BW: [])
    command = spot.commands.robot_command(Build.arm_gaze_command(2.0, 0.0, 0.5, "body"))
    stalled = arm_command_pb2.GazeCommand.Feedback.STATUS_TOOL_TRAJECTORY_STALLED
    assert wait_until(lambda: arm_feedback(spot, command).arm_gaze_feedback.status == stalled)


def test_the_hand_moves_at_a_velocity_until_its_end(spot):
    rc.block_until_arm_arrives(spot.commands, spot.commands.robot_command(Build.arm_ready_command()), timeout_sec=8.0)
    before = get_a_tform_b(spot.tree, "body", "hand")
    velocity = arm_command_pb2.ArmVelocityCommand.CartesianVelocity(frame_name="body")
    velocity.velocity_in_frame_name.z = 0.1
    command = robot_command_pb2.RobotCommand()
    command.synchronized_command.arm_command.arm_velocity_command.cartesian_velocity.CopyFrom(velocity)
    command.synchronized_command.arm_command.arm_velocity_command.angular_velocity_of_hand_rt_odom_in_hand.x = 0.2
    sent(spot, command, ahead_s=1.0)
    time.sleep(1.3)
    after = get_a_tform_b(spot.tree, "body", "hand")
    assert after.z - before.z == pytest.approx(0.1, abs=0.05)
    assert abs(after.y - before.y) < 0.03
    assert after.rot.to_roll() - before.rot.to_roll() == pytest.approx(0.2, abs=0.1)


def test_fans_run_for_their_time_or_until_a_later_command(spot):
    power = spot.robot.ensure_client("power")
    first = power.fan_power_command(percent_power=100, duration=60).command_id
    feedback = power_pb2.FanPowerCommandFeedbackResponse
    assert power.fan_power_command_feedback(first).status == feedback.STATUS_RUNNING
    second = power.fan_power_command(percent_power=50, duration=1).command_id
    assert power.fan_power_command_feedback(first).status == feedback.STATUS_OVERRIDDEN_BY_COMMAND
    assert wait_until(lambda: power.fan_power_command_feedback(second).status == feedback.STATUS_COMPLETE)


@pytest.mark.parametrize(("percent", "duration"), [(101, 5), (-1, 5), (50, -1), (50, 10_000)])
def test_fans_with_impossible_power_or_time_are_an_invalid_request(spot, percent, duration):
    with pytest.raises(InvalidRequestError):
        spot.robot.ensure_client("power").fan_power_command(percent_power=percent, duration=duration)


def sent_arm(spot, which, **request):
    """Sends a command of the arm; returns what the server says against it."""
    command = robot_command_pb2.RobotCommand()
    getattr(command.synchronized_command.arm_command, which).MergeFrom(
        type(getattr(command.synchronized_command.arm_command, which))(**request)
    )
    getattr(command.synchronized_command.arm_command, which).SetInParent()
    with pytest.raises(rc.ResponseError) as refused:
        sent(spot, command)
    return refused.value.response


@pytest.mark.parametrize(
    ("which", "request_"),
    [
        ("arm_drag_command", {}),
        ("arm_impedance_command", {"root_frame_name": "odom"}),
        ("arm_cartesian_command", {"root_frame_name": "odom", "z_axis": 1}),
    ],
)
def test_an_arm_that_holds_positions_refuses_forces(spot, which, request_):
    refused = sent_arm(spot, which, **request_)
    assert refused.status == Status.STATUS_UNSUPPORTED
    assert which in refused.message


def ready(spot):
    block(spot, spot.commands.robot_command(Build.arm_ready_command()))


def block(spot, command):
    assert rc.block_until_arm_arrives(spot.commands, command, timeout_sec=12.0)


def hand_in(spot, frame):
    hand = get_a_tform_b(spot.tree, frame, "hand")
    return hand.x, hand.y, hand.z


def test_the_body_follows_a_hand_whose_goal_is_out_of_reach(spot):
    ready(spot)
    pose = Build.arm_pose_command(1.6, 0.2, 0.8, 1.0, 0.0, 0.0, 0.0, "odom", 2.0)
    block(spot, sent(spot, Build.build_synchro_command(Build.follow_arm_command(), pose)))
    assert hand_in(spot, "odom") == pytest.approx((1.6, 0.2, 0.8), abs=0.02)
    body = get_odom_tform_body(spot.tree)
    assert (body.x, body.y) == pytest.approx((0.85, 0.2), abs=0.04)


def test_a_body_that_follows_keeps_the_distance_asked_for(spot):
    ready(spot)
    pose = Build.arm_pose_command(1.2, 0.0, 0.8, 1.0, 0.0, 0.0, 0.0, "odom", 2.0)
    follow = robot_command_pb2.RobotCommand()
    follow.synchronized_command.mobility_command.follow_arm_request.body_offset_from_hand.x = 0.6
    block(spot, sent(spot, Build.build_synchro_command(follow, pose)))
    assert get_odom_tform_body(spot.tree).x == pytest.approx(0.6, abs=0.04)


def test_a_body_that_follows_no_goal_stays(spot):
    command = Build.build_synchro_command(Build.follow_arm_command(), Build.arm_ready_command())
    block(spot, sent(spot, command))
    assert get_odom_tform_body(spot.tree).x == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(("frame", "goal"), [("odom", (0.95, 0.1, 0.8)), ("body", (0.75, 0.1, 0.3))])
def test_the_hand_stays_in_its_frame_while_the_body_walks(spot, frame, goal):
    ready(spot)
    pose = Build.arm_pose_command(*goal, 1.0, 0.0, 0.0, 0.0, frame, 1.0)
    walk = Build.synchro_se2_trajectory_point_command(0.25, 0.0, 0.1, "odom")
    block(spot, sent(spot, Build.build_synchro_command(walk, pose)))
    time.sleep(1.5)
    assert get_odom_tform_body(spot.tree).x == pytest.approx(0.25, abs=0.04)
    assert hand_in(spot, frame) == pytest.approx(goal, abs=0.03)


def test_the_hand_keeps_its_path_below_which_the_body_walks(spot):
    ready(spot)
    goal = (0.95, 0.0, 0.8)
    block(spot, sent(spot, Build.arm_pose_command(*goal, 1.0, 0.0, 0.0, 0.0, "odom", 1.0)))
    pose = Build.arm_pose_command(*goal, 1.0, 0.0, 0.0, 0.0, "odom", 1.0)
    walk = Build.synchro_se2_trajectory_point_command(0.3, 0.0, 0.0, "odom")
    command = sent(spot, Build.build_synchro_command(walk, pose))
    off_m, until = [], time.monotonic() + 1.5
    while time.monotonic() < until:
        off_m.append(math.dist(hand_in(spot, "odom"), goal))
        time.sleep(0.02)
    block(spot, command)
    assert max(off_m) < 0.1


def test_a_slower_hand_is_slower(spot):
    ready(spot)
    x, y, z = hand_in(spot, "body")
    command = Build.arm_pose_command(x, y, z + 0.15, 1.0, 0.0, 0.0, 0.0, "body", 0.1)
    command.synchronized_command.arm_command.arm_cartesian_command.max_linear_velocity.value = 0.1
    began = time.monotonic()
    block(spot, spot.commands.robot_command(command))
    assert time.monotonic() - began > 1.4


def test_a_joint_move_that_would_be_too_fast_is_slower_and_says_so(spot):
    ready(spot)
    goal = [0.0, -0.9, 1.8, 0.0, -0.9, 1.0]
    Planned = arm_command_pb2.ArmJointMoveCommand.Feedback
    for most_rad_s, planned, least_s in (
        (0.5, Planned.PLANNER_STATUS_MODIFIED, 2.5),
        (5.0, Planned.PLANNER_STATUS_SUCCESS, 0.8),
    ):
        command = Build.arm_joint_move_helper(joint_positions=[goal], times=[1.0], max_vel=most_rad_s)
        number = spot.commands.robot_command(command)
        told = arm_feedback(spot, number).arm_joint_move_feedback
        assert told.planner_status == planned
        assert least_s < told.time_to_goal.seconds + 1e-9 * told.time_to_goal.nanos < least_s + 0.6
        block(spot, number)
        goal[5] = 0.0


def test_a_path_whose_beginning_is_too_fast_is_in_time_again_later():
    sweep = [np.array([2.0 - 0.1 * k]) for k in range(20)]
    path = smooth(np.array([0.0]), [0.05 + 0.2 * k for k in range(20)], sweep)
    speed = np.abs(np.diff(path.positions_rad[:, 0])) / np.diff(path.times_s)
    assert speed.max() < 4.0
    assert path.times_s[-1] == pytest.approx(0.05 + 0.2 * 19, abs=0.05)
