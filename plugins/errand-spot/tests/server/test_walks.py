"""Walks along trajectories: in time, up to obstacles and no-go regions. A wall stands 1.7 m ahead of the robot."""

import time

import numpy as np
import pytest
from bosdyn.api import basic_command_pb2, geometry_pb2, robot_command_pb2, world_object_pb2
from bosdyn.api.spot import robot_command_pb2 as spot_command_pb2
from bosdyn.client.exceptions import InvalidRequestError
from bosdyn.client.robot_command import InvalidRequestError as InvalidCommandError
from bosdyn.client.robot_command import RobotCommandBuilder as Build
from bosdyn.util import seconds_to_duration

from errand_spot.server.computer import Pace
from errand_spot.server.obstacles import Clearance
from skills.testing.blocks import Block
from tests.tables import table

PACE, SHARED = Pace.CLIENT, True
Walk = basic_command_pb2.SE2TrajectoryCommand.Feedback


def path(points, times=(), frame="odom", params=None):
    """Command of a trajectory through points (x, y, yaw) at times."""
    command = robot_command_pb2.RobotCommand()
    base = command.synchronized_command.mobility_command
    base.se2_trajectory_request.se2_frame_name = frame
    for k, (x, y, yaw) in enumerate(points):
        point = base.se2_trajectory_request.trajectory.points.add()
        point.pose.position.x, point.pose.position.y, point.pose.angle = x, y, yaw
        if times:
            point.time_since_reference.CopyFrom(seconds_to_duration(times[k]))
    base.params.Pack(params or spot_command_pb2.MobilityParams())
    return command


def sent(spot, command, ahead_s=30.0):
    return spot.commands.robot_command(command, end_time_secs=time.time() + ahead_s)


def feedback(spot, number):
    synchronized = spot.commands.robot_command_feedback(number).feedback.synchronized_feedback
    return synchronized.mobility_command_feedback.se2_trajectory_feedback


def walked(spot, number, seconds=20.0):
    """Waits until a walk has stopped; returns its true path (N, 3), sampled each 0.1 s, and its last feedback."""
    poses, until = [], time.monotonic() + seconds
    while (told := feedback(spot, number)).status != Walk.STATUS_STOPPED and time.monotonic() < until:
        pose = spot.served.scripted.pose
        poses.append((pose.x_m, pose.y_m, pose.yaw_rad))
        time.sleep(0.1)
    return np.array(poses), told


def nearest_m(poses, x, y):
    return float(np.hypot(*(poses[:, :2] - [x, y]).T).min())


SQUARE = ((0.5, 0.0, 0.0), (0.5, 0.5, 0.0), (0.0, 0.5, 0.0), (0.0, 0.0, 0.0))


@pytest.mark.parametrize("frame", ["vision", "body"])
def test_a_closed_square_is_walked_along_its_corners_in_time(spot, frame):
    began = time.monotonic()
    poses, told = walked(spot, sent(spot, path(SQUARE, (2.0, 4.0, 6.0, 8.0), frame)))
    assert [nearest_m(poses, x, y) < 0.05 for x, y, _ in SQUARE] == [True] * 4
    assert 8.0 <= time.monotonic() - began < 9.5
    assert told.final_goal_status == Walk.FINAL_GOAL_STATUS_ACHIEVABLE
    at_4_s = poses[40]
    assert at_4_s[:2] == pytest.approx((0.5, 0.5), abs=0.08)


@pytest.mark.parametrize(("goal", "limits"), [((1.2, 0.4), {}), ((0.3, 1.2), {"x": 0.2, "y": 0.6})])
def test_a_goal_is_walked_to_on_the_straight_line(spot, goal, limits):
    params = spot_command_pb2.MobilityParams()
    if limits:
        params.vel_limit.max_vel.linear.CopyFrom(geometry_pb2.Vec2(**limits))
        params.vel_limit.max_vel.angular = 1.0
    spot.served.scripted.blocks.clear()
    poses, _ = walked(spot, sent(spot, path([(*goal, 0.8)], params=params)))
    off_m = np.abs(poses[:, 0] * goal[1] - poses[:, 1] * goal[0]) / np.hypot(*goal)
    assert off_m.max() < 0.04 and poses[-1, :2] == pytest.approx(goal, abs=0.03)


def test_a_way_out_and_back_is_walked_though_it_ends_where_it_begins(spot):
    poses, _ = walked(spot, sent(spot, path([(0.6, 0.0, 0.0), (0.0, 0.0, 0.0)], (2.0, 4.0))))
    assert poses[:, 0].max() == pytest.approx(0.6, abs=0.06)
    assert spot.served.scripted.pose.x_m == pytest.approx(0.0, abs=0.03)


def test_a_turn_past_half_a_turn_goes_the_way_of_its_points(spot):
    poses, _ = walked(spot, sent(spot, path([(0, 0, 2.0), (0, 0, 4.0), (0, 0, 6.0)], (3.0, 6.0, 9.0))))
    assert np.unwrap(poses[:, 2])[-1] == pytest.approx(6.0, abs=0.1)


def test_points_of_the_past_are_left_out(spot):
    command = path([(-0.5, 0.0, 0.0), (0.3, 0.0, 0.0)], (1.0, 5.0))
    trajectory = command.synchronized_command.mobility_command.se2_trajectory_request.trajectory
    trajectory.reference_time.CopyFrom(spot.robot.time_sync.robot_timestamp_from_local_secs(time.time() - 2.0))
    poses, _ = walked(spot, sent(spot, command))
    assert poses[:, 0].min() > -0.02
    assert spot.served.scripted.pose.x_m == pytest.approx(0.3, abs=0.03)


def test_a_walk_into_a_wall_stops_before_it_and_is_blocked(spot):
    number = sent(spot, path([(3.0, 0.0, 0.0)]))
    poses, told = walked(spot, number)
    standing = np.flatnonzero(np.abs(np.diff(poses[:, 0])) < 0.002)
    assert told.final_goal_status == Walk.FINAL_GOAL_STATUS_BLOCKED
    assert told.body_movement_status == Walk.BODY_STATUS_SETTLED
    assert 0.9 < spot.served.scripted.pose.x_m < 1.7 - 0.56
    assert 0.1 * len(standing) < 3.0


@pytest.mark.parametrize("goal", [(2.6, 0.0), (-2.6, 0.0), (0.0, 2.6)], ids=["ahead", "backwards", "aside"])
def test_a_walk_stops_before_a_low_table_between_the_beams(spot, goal):
    x, y = goal
    spot.served.scripted.blocks[:] = [Block(x - 0.4, y - 0.4, x + 0.4, y + 0.4, 0.40, 0.45)]
    poses, told = walked(spot, sent(spot, path([(*goal, 0.0)])))
    assert told.final_goal_status == Walk.FINAL_GOAL_STATUS_BLOCKED
    assert 0.0 < 2.2 - np.hypot(*poses[-1, :2]) - (0.53 if x else 0.25) < 0.2


def test_a_blocked_robot_goes_on_when_its_way_clears(spot):
    number = sent(spot, path([(2.0, 0.0, 0.0)]))
    walked(spot, number)
    spot.served.scripted.blocks.clear()
    time.sleep(4.0)
    told = feedback(spot, number)
    assert (told.status, told.final_goal_status) == (Walk.STATUS_STOPPED, Walk.FINAL_GOAL_STATUS_ACHIEVABLE)
    assert spot.served.scripted.pose.x_m == pytest.approx(2.0, abs=0.03)


def params(**obstacles):
    return spot_command_pb2.MobilityParams(obstacle_params=spot_command_pb2.ObstacleParams(**obstacles))


OFF = {"disable_vision_body_obstacle_avoidance": True}


# obstacle parameters -> where a walk to 3 m ahead ends
@pytest.mark.parametrize(
    ("given", "x_m"),
    [({"obstacle_avoidance_padding": 0.4}, 0.74), ({"disable_vision_body_obstacle_avoidance": True}, 3.0)],
)
def test_obstacle_parameters_set_the_distance_from_obstacles_or_switch_avoidance_off(spot, given, x_m):
    walked(spot, sent(spot, path([(3.0, 0.0, 0.0)], params=params(**given))))
    assert spot.served.scripted.pose.x_m == pytest.approx(x_m, abs=0.1)


# obstacle parameters -> how far a velocity of 0.5 m/s for 5 s drives towards the wall, and the padding that it keeps
@pytest.mark.parametrize(
    ("given", "x_m"), [({}, 1.1), ({"obstacle_avoidance_padding": 0.4}, 0.74), (OFF, 2.5)], ids=["usual", "wide", "off"]
)
def test_a_velocity_stops_before_an_obstacle_unless_avoidance_is_off(spot, given, x_m):
    sent(spot, Build.synchro_velocity_command(0.5, 0.0, 0.0, params=params(**given)), ahead_s=5.0)
    time.sleep(5.5)
    assert spot.served.scripted.pose.x_m == pytest.approx(x_m, abs=0.1)


def test_a_velocity_stops_before_a_no_go_region_and_leaves_it_backwards(spot):
    mutate(spot, action=Mutation.ACTION_ADD, object=region())
    sent(spot, Build.synchro_velocity_command(0.3, 0.0, 0.0), ahead_s=3.0)
    time.sleep(3.2)
    stopped_m = spot.served.scripted.pose.x_m
    assert 0.1 < stopped_m < 0.8 - 0.55
    sent(spot, Build.synchro_velocity_command(-0.3, 0.0, 0.0), ahead_s=1.0)
    time.sleep(1.2)
    assert spot.served.scripted.pose.x_m == pytest.approx(stopped_m - 0.3, abs=0.08)


def test_a_body_that_follows_the_hand_stops_before_an_obstacle(spot):
    goal = Build.arm_pose_command(3.0, 0.0, 0.8, 1.0, 0.0, 0.0, 0.0, "odom", 1.0)
    number = sent(spot, Build.build_synchro_command(Build.follow_arm_command(), goal))
    time.sleep(12.0)
    told = spot.commands.robot_command_feedback(number).feedback.synchronized_feedback.arm_command_feedback
    assert spot.served.scripted.pose.x_m < 1.7 - 0.55
    assert told.arm_cartesian_feedback.status == told.arm_cartesian_feedback.STATUS_TRAJECTORY_STALLED


@pytest.mark.parametrize("padding", [-0.1, float("nan")])
def test_a_padding_below_zero_is_an_invalid_request(spot, padding):
    with pytest.raises(InvalidCommandError) as refused:
        sent(spot, path([(1.0, 0.0, 0.0)], params=params(obstacle_avoidance_padding=padding)))
    assert "padding" in refused.value.response.message


def test_a_blocked_walk_stays_blocked_while_the_measured_speed_is_never_zero(spot, monkeypatch):
    spot.served.scripted.lidar = 360, 0.0  # by its noise the robot would creep on
    number = sent(spot, path([(3.0, 0.0, 0.0)]))
    walked(spot, number)
    monkeypatch.setattr("errand_spot.server.mobility._STILL_M_S", 0.0)
    for _ in range(5):
        time.sleep(0.1)
        told = feedback(spot, number)
        assert (told.status, told.final_goal_status) == (Walk.STATUS_STOPPED, Walk.FINAL_GOAL_STATUS_BLOCKED)


@pytest.mark.parametrize("limit", [{"max_vel": -0.5}, {"min_vel": 0.5}, {"max_vel": float("inf")}])
def test_a_limit_that_reverses_or_has_no_bound_is_refused(spot, limit):
    params = spot_command_pb2.MobilityParams()
    for name, value in limit.items():
        getattr(params.vel_limit, name).linear.x = value
    with pytest.raises(InvalidCommandError) as refused:
        sent(spot, path([(0.3, 0.0, 0.0)], params=params))
    assert "vel_limit" in refused.value.response.message


def region(frame="odom", lasts_s=0.0, **properties):
    """World object of a box across the way 0.9 m ahead."""
    box = geometry_pb2.Box2WithFrame(frame_name=frame)
    box.box.size.x, box.box.size.y = 0.2, 3.0
    box.frame_name_tform_box.position.x, box.frame_name_tform_box.rotation.w = 0.9, 1.0
    given = world_object_pb2.NoGoRegionProperties(box=box, **properties)
    made = world_object_pb2.WorldObject(name="box", nogo_region_properties=given)
    if lasts_s:
        made.object_lifetime.CopyFrom(seconds_to_duration(lasts_s))
    return made


def mutate(spot, **mutation):
    made = world_object_pb2.MutateWorldObjectRequest.Mutation(**mutation)
    request = world_object_pb2.MutateWorldObjectRequest(mutation=made)
    return spot.robot.ensure_client("world-objects").mutate_world_objects(request).mutated_object_id


Mutation = world_object_pb2.MutateWorldObjectRequest


def test_the_robot_stops_before_a_no_go_region_until_a_client_deletes_it(spot):
    number = mutate(spot, action=Mutation.ACTION_ADD, object=region())
    _, told = walked(spot, sent(spot, path([(1.0, 0.0, 0.0)])))
    assert told.final_goal_status == Walk.FINAL_GOAL_STATUS_BLOCKED
    assert 0.1 < spot.served.scripted.pose.x_m < 0.8 - 0.56
    mutate(spot, action=Mutation.ACTION_DELETE, object=world_object_pb2.WorldObject(id=number))
    walked(spot, sent(spot, path([(1.0, 0.0, 0.0)])))
    assert spot.served.scripted.pose.x_m == pytest.approx(1.0, abs=0.03)


def test_a_no_go_region_ends_with_its_lifetime(spot):
    mutate(spot, action=Mutation.ACTION_ADD, object=region(lasts_s=3.0))
    number = sent(spot, path([(1.0, 0.0, 0.0)]))
    time.sleep(2.5)
    assert spot.served.scripted.pose.x_m < 0.3
    assert len(spot.robot.ensure_client("world-objects").list_world_objects().world_objects) == 1
    time.sleep(4.0)
    assert not spot.robot.ensure_client("world-objects").list_world_objects().world_objects
    assert feedback(spot, number).final_goal_status == Walk.FINAL_GOAL_STATUS_ACHIEVABLE


@pytest.mark.parametrize(*table(__file__, "regions"))
def test_a_region_that_cannot_be_used_is_an_invalid_request(spot, box, frame, said):
    made = region(frame)
    made.nogo_region_properties.box.box.size.x = box
    with pytest.raises(InvalidRequestError, match=said):
        mutate(spot, action=Mutation.ACTION_ADD, object=made)


def test_a_robot_that_touches_an_obstacle_may_leave_it(spot):
    computer = spot.served.server.computer
    computer.scan_points.points_O = np.array([[0.58, 0.0]])
    clearance = Clearance(spot_command_pb2.ObstacleParams())
    back, ahead = np.array([-0.5, 0.0, 0.0]), np.array([0.5, 0.0, 0.0])
    assert clearance.limit(computer, back) == pytest.approx(back)
    assert clearance.limit(computer, ahead) == pytest.approx(0.0)


# region: x, y, length, width (m) -> walk (m/s) for 2 s, and how far it gets ahead and to the left; the body is 1.06 m
# long and 0.5 m wide
@pytest.mark.parametrize(*table(__file__, "inside"))
def test_a_region_is_left_or_passed_but_not_entered(spot, box, walk, ends):
    made = region()
    placed = made.nogo_region_properties.box
    placed.frame_name_tform_box.position.x, placed.frame_name_tform_box.position.y = box[:2]
    placed.box.size.x, placed.box.size.y = box[2:]
    mutate(spot, action=Mutation.ACTION_ADD, object=made)
    sent(spot, Build.synchro_velocity_command(*walk, 0.0), ahead_s=2.0)
    time.sleep(2.3)
    pose = spot.served.scripted.pose
    assert (pose.x_m, pose.y_m) == pytest.approx(ends, abs=0.06)


def test_a_region_that_lies_on_its_side_is_an_invalid_request(spot):
    made = region()
    made.nogo_region_properties.box.frame_name_tform_box.rotation.y = 1.0
    with pytest.raises(InvalidRequestError, match="level"):
        mutate(spot, action=Mutation.ACTION_ADD, object=made)


def stance(spot, x=0.32, y=0.17, dx=0.0, **changes):
    """Command of a stance whose middle lies dx ahead; returns its feedback after 3 s."""
    feet = {"fl": (x, y), "fr": (x, -y), "hl": (-x, y), "hr": (-x, -y)}
    command = Build.stance_command("odom", *(geometry_pb2.Vec2(x=a + dx, y=b) for a, b in feet.values()))
    number = sent(spot, command)
    time.sleep(3.0)
    synchronized = spot.commands.robot_command_feedback(number).feedback.synchronized_feedback
    return synchronized.mobility_command_feedback.stance_feedback.status


Feet = basic_command_pb2.StanceCommand.Feedback


# stance -> status, and where the robot stands then
@pytest.mark.parametrize(
    ("given", "status", "x_m"),
    [
        ({}, Feet.STATUS_STANCED, 0.0),
        ({"dx": 0.3, "y": 0.2}, Feet.STATUS_STANCED, 0.3),
        ({"dx": 1.0}, Feet.STATUS_TOO_FAR_AWAY, 0.0),
        ({"x": 0.3, "y": 0.3}, Feet.STATUS_TOO_FAR_AWAY, 0.0),
    ],
    ids=["here", "a step ahead", "too far", "too wide"],
)
def test_a_stance_moves_the_feet_or_says_that_it_is_too_far_away(spot, given, status, x_m):
    assert stance(spot, **given) == status
    assert spot.served.scripted.pose.x_m == pytest.approx(x_m, abs=0.03)
