"""Motion commands of the SDK, and the answer to each that cannot be done."""

import math
import time

import bosdyn.client.robot_command as rc
import numpy as np
import pytest
from bosdyn.api import arm_command_pb2, basic_command_pb2, gripper_command_pb2, power_pb2, robot_command_pb2
from bosdyn.api.spot import robot_command_pb2 as spot_command_pb2
from bosdyn.client.exceptions import InvalidRequestError
from bosdyn.client.frame_helpers import get_a_tform_b, get_odom_tform_body
from bosdyn.client.math_helpers import Quat, SE3Pose
from bosdyn.client.robot_command import RobotCommandBuilder as Build
from bosdyn.geometry import EulerZXY

from errand_spot.messages import timestamp
from errand_spot.server.arm import smooth
from errand_spot.server.computer import Pace
from tests.tables import table

PACE, SHARED = Pace.CLIENT, True
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


def parts_feedback(spot, command_id):
    return spot.commands.robot_command_feedback(command_id).feedback.synchronized_feedback


def arm_feedback(spot, command_id):
    return parts_feedback(spot, command_id).arm_command_feedback


def block(spot, command):
    assert rc.block_until_arm_arrives(spot.commands, command, timeout_sec=12.0)


def ready(spot):
    block(spot, spot.commands.robot_command(Build.arm_ready_command()))


def hand_in(spot, frame):
    hand = get_a_tform_b(spot.tree, frame, "hand")
    return hand.x, hand.y, hand.z


def body_x_m(spot):
    return get_odom_tform_body(spot.tree).x


def pose_of_hand(x, y, z, frame, seconds=1.0):
    return Build.arm_pose_command(x, y, z, 1.0, 0.0, 0.0, 0.0, frame, seconds)


def test_a_velocity_is_driven_until_its_end(spot):
    command = sent(spot, Build.synchro_velocity_command(0.5, 0.0, 0.0), ahead_s=1.0)
    assert wait_until(lambda: base_feedback(spot, command).status == Progress.STATUS_COMMAND_TIMED_OUT)
    time.sleep(0.2)
    x_m = body_x_m(spot)
    time.sleep(0.2)
    assert (x_m, body_x_m(spot)) == (pytest.approx(0.5, abs=0.08), pytest.approx(x_m, abs=0.01))


def test_a_pose_is_driven_to(spot):
    command = sent(spot, Build.synchro_se2_trajectory_point_command(0.4, 0.2, 0.5, "odom"))
    assert rc.block_for_trajectory_cmd(spot.commands, command, timeout_sec=5.0, feedback_interval_secs=0.05)
    body = get_odom_tform_body(spot.tree)
    assert (body.x, body.y, body.rot.to_yaw()) == pytest.approx((0.4, 0.2, 0.5), abs=0.04)


def test_a_pose_in_the_body_frame_stays_where_it_was(spot):
    command = Build.synchro_trajectory_command_in_body_frame(0.3, 0.0, 0.0, spot.tree)
    assert rc.block_for_trajectory_cmd(spot.commands, sent(spot, command), timeout_sec=5.0, feedback_interval_secs=0.05)
    assert body_x_m(spot) == pytest.approx(0.3, abs=0.04)


def test_a_later_command_overrides_an_earlier_one(spot):
    first = sent(spot, Build.synchro_velocity_command(0.2, 0.0, 0.0))
    sent(spot, Build.stop_command())
    assert wait_until(lambda: base_feedback(spot, first).status == Progress.STATUS_COMMAND_OVERRIDDEN)
    x_m = body_x_m(spot)
    time.sleep(0.2)
    assert body_x_m(spot) == pytest.approx(x_m, abs=0.005)


def test_the_body_stands_at_the_height_and_pitch_asked_for(spot):
    params = Build.mobility_params(body_height=-0.05, footprint_R_body=EulerZXY(pitch=0.2))
    rc.blocking_stand(spot.commands, timeout_sec=5.0, update_frequency=20.0, params=params)
    assert spot.served.scripted.height_m == pytest.approx(0.47, abs=0.01)
    assert spot.served.scripted.pitch_rad == pytest.approx(0.2, abs=0.02)


@pytest.mark.parametrize(("build", "elbow_rad"), [(Build.arm_ready_command, 1.8), (Build.arm_stow_command, 3.06)])
def test_the_arm_goes_to_its_named_positions(spot, build, elbow_rad):
    ready(spot)
    block(spot, spot.commands.robot_command(build()))
    assert spot.served.scripted.q_rad[2] == pytest.approx(elbow_rad, abs=0.05)


def test_the_hand_goes_to_a_pose(spot):
    block(spot, spot.commands.robot_command(pose_of_hand(0.75, 0.1, 0.3, "body")))
    assert hand_in(spot, "body") == pytest.approx((0.75, 0.1, 0.3), abs=0.01)


Cartesian, Gaze = arm_command_pb2.ArmCartesianCommand.Feedback, arm_command_pb2.GazeCommand.Feedback
Named = arm_command_pb2.NamedArmPositionsCommand.Feedback
REFUSES = {"move_arm": "a fault"}
GAZE = Build.arm_gaze_command(2.0, 0.0, 0.5, "body")


# why the arm cannot move -> its feedback, which says that it is stalled
@pytest.mark.parametrize(
    ("refuses", "command", "feedback", "stalled"),
    [
        (REFUSES, Build.arm_ready_command(), "named_arm_position_feedback", Named.STATUS_STALLED_HOLDING_ITEM),
        (None, GAZE, "arm_gaze_feedback", Gaze.STATUS_TOOL_TRAJECTORY_STALLED),
    ],
    ids=["refuses", "no posture for the gaze"],
)
def test_an_arm_that_cannot_do_it_is_stalled_and_does_not_move(spot, monkeypatch, refuses, command, feedback, stalled):
    before = spot.served.scripted.q_rad.copy()
    if refuses is None:
        monkeypatch.setattr("errand_spot.server.hand.solutions", lambda solver, X_BW: [])
    spot.served.scripted.refuse_because.update(refuses or {})
    number = spot.commands.robot_command(command)
    assert wait_until(lambda: getattr(arm_feedback(spot, number), feedback).status == stalled)
    assert spot.served.scripted.q_rad == pytest.approx(before, abs=1e-6)


def test_joints_pass_their_postures_at_the_times_asked_for(spot):
    ready(spot)
    postures = [[0.2 * k, -0.9, 1.8, 0.0, -0.9, 0.0] for k in (1, 2, 3)]
    began = time.monotonic()
    command = Build.arm_joint_move_helper(joint_positions=postures, times=[0.5, 1.0, 1.5])
    block(spot, spot.commands.robot_command(command))
    assert spot.served.scripted.q_rad[0] == pytest.approx(0.6, abs=0.04)
    assert 1.3 < time.monotonic() - began < 2.5


def test_the_gripper_opens_by_a_share(spot):
    spot.commands.robot_command(Build.claw_gripper_open_fraction_command(0.5))
    assert wait_until(lambda: abs(spot.states.get_robot_state().manipulator_state.gripper_open_percentage - 50.0) < 4.0)


def test_arm_and_base_move_together_and_report_apart(spot):
    command = Build.build_synchro_command(Build.arm_ready_command(), Build.synchro_velocity_command(0.2, 0.0, 0.0))
    found = parts_feedback(spot, sent(spot, command, 1.0))
    parts = {part: found.HasField(f"{part}_command_feedback") for part in ("arm", "mobility", "gripper")}
    assert parts == {"arm": True, "mobility": True, "gripper": False}


def test_safe_power_off_sits_and_switches_the_motors_off(spot):
    spot.robot.power_off(cut_immediately=False, timeout_sec=10, update_frequency=20.0)
    assert (spot.robot.is_powered_on(), spot.served.scripted.height_m < 0.3) == (False, True)
    with pytest.raises(rc.NotPoweredOnError):
        sent(spot, Build.synchro_velocity_command(0.1, 0.0, 0.0))


def test_a_taken_lease_stops_the_robot_and_ends_the_earlier_one(spot):
    sent(spot, Build.synchro_velocity_command(0.3, 0.0, 0.0))
    spot.served.login().ensure_client("lease").take("body")
    assert wait_until(lambda: not any(spot.served.scripted.velocity))
    with pytest.raises(rc.ResponseError):
        sent(spot, Build.synchro_velocity_command(0.1, 0.0, 0.0))


def test_an_estop_cuts_the_motors(spot):
    spot.served.server.computer.estop._held["tablet"].level = 1
    assert wait_until(lambda: not spot.robot.is_powered_on())


def raw(spot, request, *, clock=None):
    """Sends a mobility request past the builders of the SDK."""
    spot.robot.lease_wallet.get_lease("body").create_newer()
    message = robot_command_pb2.RobotCommandRequest(
        lease=spot.robot.lease_wallet.advance("body").lease_proto,
        command={"synchronized_command": {"mobility_command": request}},
        clock_identifier=clock or spot.robot.time_sync.endpoint.clock_identifier,
    )
    message.header.client_name = "test"
    return spot.commands._stub.RobotCommand(message)


@pytest.mark.parametrize(*table(__file__, "refused"))
def test_a_command_that_cannot_be_done_says_why_and_moves_nothing(spot, ahead_s, change, clock, status, said):
    velocity = {"se2_frame_name": "body", "velocity": {"linear": {"x": 0.1}}, **change}
    request = ahead_s and {"se2_velocity_request": {"end_time": timestamp(time.time() + ahead_s), **velocity}}
    answer = raw(spot, request or {}, clock=clock)
    assert (Status.Status.Name(answer.status), said in answer.message) == (status, True), answer.message
    time.sleep(0.1)
    assert not any(spot.served.scripted.velocity)


Status = robot_command_pb2.RobotCommandResponse


@pytest.mark.parametrize(*table(__file__, "ranges"))
def test_a_goal_out_of_a_joints_range_is_refused_and_moves_nothing(spot, joint, angle):
    command = Build.claw_gripper_open_angle_command(angle)
    if joint != "f1x":
        command = robot_command_pb2.RobotCommand()
        points = command.synchronized_command.arm_command.arm_joint_move_command.trajectory.points
        getattr(points.add().position, joint).value = angle
    before = spot.served.scripted.q_rad.copy()
    with pytest.raises(rc.InvalidRequestError) as refused:
        spot.commands.robot_command(command)
    assert ("trajectory.point" if joint == "f1x" else f"position.{joint}") in refused.value.response.message
    time.sleep(0.3)
    assert spot.served.scripted.q_rad == pytest.approx(before, abs=1e-6)


def test_a_goal_at_the_end_of_a_joints_range_is_reached(spot):
    ready(spot)
    most = spot.served.server.computer.solver.upper_rad[5]
    command = Build.arm_joint_command(0.0, -0.9, 1.8, 0.0, -0.9, most + 0.01)
    block(spot, spot.commands.robot_command(command))
    assert spot.served.scripted.q_rad[5] == pytest.approx(most, abs=0.03)


@pytest.mark.parametrize(*table(__file__, "options"))
def test_an_option_that_the_api_lacks_is_refused(spot, path, option, said):
    command = Build.synchro_se2_trajectory_point_command(0.3, 0.0, 0.0, "odom")
    params, given = spot_command_pb2.MobilityParams(), command.synchronized_command
    for name in path.split("."):
        given = params if name == "params" else getattr(given, name)
    setattr(given, option, 99)
    command.synchronized_command.mobility_command.params.Pack(params)
    with pytest.raises(rc.InvalidRequestError) as refused:
        sent(spot, command)
    assert said in refused.value.response.message and "99" in refused.value.response.message


def test_a_velocity_changes_no_faster_than_its_slew_rate(spot):
    command = Build.synchro_velocity_command(0.6, 0.0, 0.5)
    limit = command.synchronized_command.mobility_command.se2_velocity_request.slew_rate_limit
    limit.linear.x = 0.3  # the turn has no limit
    sent(spot, command, ahead_s=3.0)
    seen = []
    for _ in range(20):
        time.sleep(0.1)
        seen.append(spot.served.scripted.velocity)
    ahead, _, turn = np.array(seen).T
    assert ahead[9] == pytest.approx(0.3, abs=0.03) and ahead[-1] == pytest.approx(0.6, abs=0.02)
    assert np.diff(ahead).max() < 0.04 and turn[4] == pytest.approx(0.5, abs=0.01)


def test_feedback_of_an_unknown_command_is_an_invalid_request(spot):
    with pytest.raises(InvalidRequestError):
        spot.commands.robot_command_feedback(4711)


def test_the_camera_looks_at_a_point(spot):
    block(spot, spot.commands.robot_command(Build.arm_gaze_command(2.0, 0.5, 0.0, "odom")))
    hand_target = get_a_tform_b(spot.tree, "hand", "odom") * SE3Pose(2.0, 0.5, 0.0, EulerZXY().to_quaternion())
    assert math.atan2(math.hypot(hand_target.y, hand_target.z), hand_target.x) < 0.1


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
    status = parts_feedback(spot, command).gripper_command_feedback.claw_gripper_feedback.status
    assert status == gripper_command_pb2.ClawGripperCommand.Feedback.STATUS_UNKNOWN


def test_the_hand_moves_at_a_velocity_until_its_end(spot):
    ready(spot)
    before = get_a_tform_b(spot.tree, "body", "hand")
    command = robot_command_pb2.RobotCommand()
    request = command.synchronized_command.arm_command.arm_velocity_command
    request.cartesian_velocity.frame_name, request.cartesian_velocity.velocity_in_frame_name.z = "body", 0.1
    request.angular_velocity_of_hand_rt_odom_in_hand.x = 0.2
    sent(spot, command, ahead_s=1.0)
    time.sleep(1.3)
    after = get_a_tform_b(spot.tree, "body", "hand")
    assert (after.y - before.y, after.z - before.z) == (pytest.approx(0.0, abs=0.03), pytest.approx(0.1, abs=0.05))
    assert after.rot.to_roll() - before.rot.to_roll() == pytest.approx(0.2, abs=0.1)


RISES = {"cartesian_velocity": {"frame_name": "body", "velocity_in_frame_name": {"z": 5.0}}}
OUT = {"cylindrical_velocity": {"linear_velocity": {"r": 1.0}}}
UP = {"cylindrical_velocity": {"linear_velocity": {"z": 1.0}, "max_linear_velocity": {"value": 3.0}}}
SLOW = {"cylindrical_velocity": {"linear_velocity": {"z": 1.0}, "max_linear_velocity": {"value": 0.2}}}


# velocity of the hand -> the least way in 1 s, of a hand that is fast, stowed, or both; by day postures take turns
@pytest.mark.parametrize(
    ("given", "least_m", "stowed"),
    [
        pytest.param(given, least_m, stowed, marks=[pytest.mark.nightly] * (row % 2 == stowed))
        for row, (given, least_m) in enumerate([(RISES, 0.35), (OUT, 0.15), (UP, 0.35), (SLOW, 0.15)])
        for stowed in (False, True)
    ],
)
def test_a_velocity_of_the_hand_moves_it_as_fast_as_it_can(spot, stowed, given, least_m):
    if not stowed:
        ready(spot)
    before, command = hand_in(spot, "body"), robot_command_pb2.RobotCommand()
    request = arm_command_pb2.ArmVelocityCommand.Request(**given)
    command.synchronized_command.arm_command.arm_velocity_command.CopyFrom(request)
    sent(spot, command, ahead_s=1.0)
    time.sleep(1.2)
    assert least_m < math.dist(hand_in(spot, "body"), before) < 1.0


def test_the_gripper_passes_its_angles_at_their_times(spot):
    command, seen = Build.claw_gripper_close_command(), []
    points = command.synchronized_command.gripper_command.claw_gripper_command.trajectory.points
    del points[:]
    for at_s, angle in ((1, -1.0), (3, -0.2)):
        points.add(point=angle).time_since_reference.FromSeconds(at_s)
    number = sent(spot, command)
    for _ in range(7):
        time.sleep(0.5)
        seen.append(spot.served.scripted.opening)
    assert (seen[1], seen[3], seen[6]) == pytest.approx((1.0, 0.6, 0.2), abs=0.1)
    told = parts_feedback(spot, number).gripper_command_feedback.claw_gripper_feedback
    assert told.status == told.STATUS_AT_GOAL


def test_fans_run_for_their_time_or_until_a_later_command(spot):
    power = spot.robot.ensure_client("power")
    first = power.fan_power_command(percent_power=100, duration=60).command_id
    feedback = power_pb2.FanPowerCommandFeedbackResponse
    assert power.fan_power_command_feedback(first).status == feedback.STATUS_RUNNING
    second = power.fan_power_command(percent_power=50, duration=1).command_id
    assert power.fan_power_command_feedback(first).status == feedback.STATUS_OVERRIDDEN_BY_COMMAND
    assert wait_until(lambda: power.fan_power_command_feedback(second).status == feedback.STATUS_COMPLETE)


@pytest.mark.parametrize(("percent", "duration"), [(101, 5), (-1, 5), (50, -1), (50, 100_000)])
def test_fans_with_impossible_power_or_time_are_an_invalid_request(spot, percent, duration):
    with pytest.raises(InvalidRequestError):
        spot.robot.ensure_client("power").fan_power_command(percent_power=percent, duration=duration)


@pytest.mark.parametrize(*table(__file__, "forces"))
def test_an_arm_that_holds_positions_refuses_forces(spot, which, request_):
    command = robot_command_pb2.RobotCommand(synchronized_command={"arm_command": {which: request_}})
    with pytest.raises(rc.ResponseError) as refused:
        sent(spot, command)
    answer = refused.value.response
    assert (answer.status, which in answer.message) == (Status.STATUS_UNSUPPORTED, True), answer.message


def test_an_impedance_command_without_a_force_moves_the_tool_along_its_path(spot):
    command = robot_command_pb2.RobotCommand()
    arm = command.synchronized_command.arm_command.arm_impedance_command
    arm.root_frame_name = "body"
    arm.root_tform_task.CopyFrom(SE3Pose(0.0, 0.1, 0.0, Quat()).to_proto())
    arm.diagonal_stiffness_matrix.values.extend([500.0, 500.0, 500.0, 60.0, 60.0, 60.0])
    arm.task_tform_desired_tool.points.add(pose=SE3Pose(0.75, 0.0, 0.3, Quat()).to_proto())
    number = spot.commands.robot_command(command)
    block(spot, number)
    told = arm_feedback(spot, number).arm_impedance_feedback
    off = get_a_tform_b(told.transforms_snapshot, "desired_tool_at_end", "tool")
    assert (off.x, off.y, off.z) == pytest.approx((0.0, 0.0, 0.0), abs=0.02)
    assert hand_in(spot, "body") == pytest.approx((0.75, 0.1, 0.3), abs=0.01)


# a goal that the hand cannot reach -> how near to the goal it comes, and at most how far from it in the end (m)
@pytest.mark.parametrize(
    ("goal", "off_m"), [((0.0, 0.5, 0.35), 0.1), ((2.0, 0.0, 0.3), 0.85), ((900.0, 0.0, 0.3), None)]
)
def test_a_hand_whose_goal_is_out_of_reach_goes_as_far_as_it_can(spot, goal, off_m):
    ready(spot)
    number = spot.commands.robot_command(pose_of_hand(*goal, "body", 1.0))
    assert arm_feedback(spot, number).arm_cartesian_feedback.status == Cartesian.STATUS_IN_PROGRESS
    assert wait_until(
        lambda: arm_feedback(spot, number).arm_cartesian_feedback.status == Cartesian.STATUS_TRAJECTORY_STALLED, 9.0
    )
    reached = hand_in(spot, "body")
    assert reached[0] > 1.1 if off_m is None else math.dist(reached, goal) < off_m


def follow(offset_m=None):
    """Commands the body to follow the hand, at a distance."""
    command = Build.follow_arm_command()
    if offset_m is not None:
        command.synchronized_command.mobility_command.follow_arm_request.body_offset_from_hand.x = offset_m
    return command


# how the body follows, goal of the hand -> where the body stands then
@pytest.mark.parametrize(
    ("offset_m", "goal", "body_xy"), [(None, (1.6, 0.2, 0.8), (0.85, 0.2)), (0.6, (1.2, 0.0, 0.8), (0.6, 0.0))]
)
def test_the_body_follows_a_hand_whose_goal_is_out_of_reach_at_the_distance_asked_for(spot, offset_m, goal, body_xy):
    ready(spot)
    block(spot, sent(spot, Build.build_synchro_command(follow(offset_m), pose_of_hand(*goal, "odom", 2.0))))
    body = get_odom_tform_body(spot.tree)
    assert (body.x, body.y) == pytest.approx(body_xy, abs=0.04)
    assert hand_in(spot, "odom") == pytest.approx(goal, abs=0.02)


def test_an_arm_that_is_stowed_unfolds_before_it_follows_a_goal_in_the_world(spot):
    block(spot, sent(spot, Build.build_synchro_command(follow(), pose_of_hand(1.25, 0.0, 0.77, "odom", 5.0))))
    assert body_x_m(spot) == pytest.approx(0.5, abs=0.04)
    assert hand_in(spot, "odom") == pytest.approx((1.25, 0.0, 0.77), abs=0.02)


@pytest.mark.parametrize(("frame", "moves"), [("vision", False), ("body", True)])
def test_a_hand_whose_goal_is_in_the_world_stays_there_while_the_body_walks_on(spot, frame, moves):
    number = sent(spot, pose_of_hand(0.75, -0.5, 0.2 if moves else 0.72, frame))
    block(spot, number)
    before = hand_in(spot, "odom")
    walk = sent(spot, Build.synchro_se2_trajectory_point_command(0.4, 0.0, 0.0, "odom"))
    off = []
    while base_feedback(spot, walk).se2_trajectory_feedback.status != 1:
        time.sleep(0.1)
        off.append(math.dist(hand_in(spot, "odom"), before))
    assert (max(off) > 0.3) is moves and (max(off) < 0.06) is not moves
    assert arm_feedback(spot, number).arm_cartesian_feedback.status == Cartesian.STATUS_TRAJECTORY_COMPLETE


def test_a_goal_in_the_world_that_the_body_carries_the_hand_away_from_is_no_longer_complete(spot):
    number = sent(spot, pose_of_hand(0.75, 0.0, 0.72, "odom"))
    block(spot, number)
    walk, seen = sent(spot, Build.synchro_se2_trajectory_point_command(-1.2, 0.0, 0.0, "odom"), 9.0), set()
    while base_feedback(spot, walk).se2_trajectory_feedback.status != 1:
        time.sleep(0.1)
        told = arm_feedback(spot, number).arm_cartesian_feedback
        seen.add(told.status)
        assert told.status != Cartesian.STATUS_TRAJECTORY_COMPLETE or told.measured_pos_distance_to_goal < 0.11
    assert Cartesian.STATUS_IN_PROGRESS in seen
    time.sleep(6.0)
    told = arm_feedback(spot, number).arm_cartesian_feedback
    assert (told.status, told.measured_pos_distance_to_goal > 0.3) == (Cartesian.STATUS_TRAJECTORY_STALLED, True)
    sent(spot, Build.synchro_se2_trajectory_point_command(0.0, 0.0, 0.0, "odom"), 9.0)
    time.sleep(5.0)
    assert arm_feedback(spot, number).arm_cartesian_feedback.status == Cartesian.STATUS_TRAJECTORY_COMPLETE
    assert hand_in(spot, "odom") == pytest.approx((0.75, 0.0, 0.72), abs=0.03)


def test_the_distance_of_the_hand_from_a_goal_in_the_body_does_not_grow_with_a_walk(spot):
    number = sent(spot, pose_of_hand(0.75, 0.0, 0.2, "body"))
    block(spot, number)
    sent(spot, Build.synchro_se2_trajectory_point_command(-0.5, 0.0, 0.0, "odom"), 9.0)
    time.sleep(3.0)
    told = arm_feedback(spot, number).arm_cartesian_feedback
    assert told.status == Cartesian.STATUS_TRAJECTORY_COMPLETE
    assert told.measured_pos_distance_to_goal < 0.03


def test_a_gaze_follows_its_target(spot):
    ready(spot)
    command = Build.arm_gaze_command(3.0, 1.0, 0.3, "odom")
    points = command.synchronized_command.arm_command.arm_gaze_command.target_trajectory_in_frame1.points
    points.add(point={"x": 3.0, "y": -1.0, "z": 0.3}).time_since_reference.FromSeconds(4)
    number, seen = sent(spot, command), []
    for _ in range(40):
        time.sleep(0.1)
        target = get_a_tform_b(spot.tree, "odom", "hand").rot.to_yaw()
        seen.append(target)
    assert seen[19] == pytest.approx(0.0, abs=0.12) and seen[9] > 0.1 > -0.1 > seen[29]
    block(spot, number)


def gaze_error(spot, target_O):
    away = get_a_tform_b(spot.tree, "hand", "odom").transform_point(*target_O)
    return math.atan2(math.hypot(*away[1:]), away[0])


def test_a_gaze_stays_on_its_target_while_the_body_walks(spot):
    ready(spot)
    target_O = (1.2, 1.5, 0.4)
    gaze = Build.arm_gaze_command(*target_O, "odom")
    block(spot, spot.commands.robot_command(gaze))
    walk = Build.synchro_trajectory_command_in_body_frame(0.9, 0.0, 0.0, spot.tree)
    number, off = sent(spot, Build.build_synchro_command(walk, gaze)), []
    for _ in range(25):
        time.sleep(0.1)
        off.append(gaze_error(spot, target_O))
        moves = get_a_tform_b(spot.tree, "odom", "body").x < 0.8
        status = arm_feedback(spot, number).arm_gaze_feedback.status
        assert not (moves and status == Gaze.STATUS_TRAJECTORY_COMPLETE)
    assert max(off[5:]) < 0.25
    block(spot, number)
    assert gaze_error(spot, target_O) < 0.03


def test_a_gaze_whose_tool_is_out_of_reach_is_stalled(spot):
    ready(spot)
    tool = {"frame2_tform_desired_hand": SE3Pose(2.0, 0, 0.3, Quat()), "frame2_name": "odom"}
    command = Build.arm_gaze_command(3.0, 0.0, 0.3, "odom", **tool)
    number = spot.commands.robot_command(command)
    stalled = Gaze.STATUS_TOOL_TRAJECTORY_STALLED
    assert wait_until(lambda: arm_feedback(spot, number).arm_gaze_feedback.status == stalled, 5.0)


def test_a_body_that_follows_no_goal_stays(spot):
    block(spot, sent(spot, Build.build_synchro_command(follow(), Build.arm_ready_command())))
    assert body_x_m(spot) == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(("frame", "goal"), [("odom", (0.95, 0.1, 0.8)), ("body", (0.75, 0.1, 0.3))])
def test_the_hand_stays_in_its_frame_while_the_body_walks(spot, frame, goal):
    ready(spot)
    walk = Build.synchro_se2_trajectory_point_command(0.25, 0.0, 0.1, "odom")
    block(spot, sent(spot, Build.build_synchro_command(walk, pose_of_hand(*goal, frame))))
    time.sleep(1.5)
    assert (body_x_m(spot), hand_in(spot, frame)) == (pytest.approx(0.25, abs=0.04), pytest.approx(goal, abs=0.03))


def test_the_hand_keeps_its_path_below_which_the_body_walks(spot):
    ready(spot)
    pose = pose_of_hand(*(goal := (0.95, 0.0, 0.8)), "odom")
    block(spot, sent(spot, pose))
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
    command = pose_of_hand(x, y, z + 0.15, "body", 0.1)
    command.synchronized_command.arm_command.arm_cartesian_command.max_linear_velocity.value = 0.1
    began = time.monotonic()
    block(spot, spot.commands.robot_command(command))
    assert time.monotonic() - began > 1.4


Planned = arm_command_pb2.ArmJointMoveCommand.Feedback


@pytest.mark.parametrize(
    ("most_rad_s", "planned", "least_s"),
    [(0.5, Planned.PLANNER_STATUS_MODIFIED, 2.5), (5.0, Planned.PLANNER_STATUS_SUCCESS, 0.8)],
)
def test_a_joint_move_that_would_be_too_fast_is_slower_and_says_so(spot, most_rad_s, planned, least_s):
    ready(spot)
    goal = [0.0, -0.9, 1.8, 0.0, -0.9, 1.0]
    number = spot.commands.robot_command(
        Build.arm_joint_move_helper(joint_positions=[goal], times=[1.0], max_vel=most_rad_s)
    )
    told = arm_feedback(spot, number).arm_joint_move_feedback
    assert told.planner_status == planned
    assert least_s < told.time_to_goal.seconds + 1e-9 * told.time_to_goal.nanos < least_s + 0.6
    block(spot, number)


def test_a_path_whose_beginning_is_too_fast_is_in_time_again_later():
    sweep = [np.array([2.0 - 0.1 * k]) for k in range(20)]
    path = smooth(np.array([0.0]), [0.05 + 0.2 * k for k in range(20)], sweep)
    speed = np.abs(np.diff(path.positions_rad[:, 0])) / np.diff(path.times_s)
    assert speed.max() < 4.0 and path.times_s[-1] == pytest.approx(0.05 + 0.2 * 19, abs=0.05)
