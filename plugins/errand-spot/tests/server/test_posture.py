"""Body over its feet: turn, shift, height and pitch, at once and over time; what it cannot do is refused."""

import time

import bosdyn.client.robot_command as rc
import numpy as np
import pytest
from bosdyn.api import basic_command_pb2, trajectory_pb2
from bosdyn.api.spot import robot_command_pb2 as spot_command_pb2
from bosdyn.client.frame_helpers import get_odom_tform_body
from bosdyn.client.math_helpers import Quat, SE3Pose
from bosdyn.client.robot_command import RobotCommandBuilder as Build
from bosdyn.geometry import EulerZXY
from bosdyn.util import seconds_to_duration

from errand_spot.server.computer import Pace

PACE, SHARED = Pace.CLIENT, True
Stand = basic_command_pb2.StandCommand.Feedback


def stood(spot, params, timeout_s=8.0):
    rc.blocking_stand(spot.commands, timeout_sec=timeout_s, update_frequency=20.0, params=params)


def turned(yaw, pitch=0.0, roll=0.0, height=0.0):
    return Build.mobility_params(body_height=height, footprint_R_body=EulerZXY(yaw=yaw, pitch=pitch, roll=roll))


def body(spot):
    """True x, y and yaw of the body."""
    pose = spot.served.scripted.pose
    return pose.x_m, pose.y_m, pose.yaw_rad


def body_pose(*timed, root="odom"):
    """Parameters of a path of the body: pairs of time and pose."""
    points = [
        trajectory_pb2.SE3TrajectoryPoint(pose=pose.to_proto(), time_since_reference=seconds_to_duration(at_s))
        for at_s, pose in timed
    ]
    path = trajectory_pb2.SE3Trajectory(points=points)
    if root == "footprint":
        return spot_command_pb2.MobilityParams(
            body_control=spot_command_pb2.BodyControlParams(base_offset_rt_footprint=path)
        )
    pose = spot_command_pb2.BodyControlParams.BodyPose(root_frame_name=root, base_offset_rt_root=path)
    return spot_command_pb2.MobilityParams(body_control=spot_command_pb2.BodyControlParams(body_pose=pose))


def foot(spot):
    """Position of the left front foot in `odom`."""
    state = spot.states.get_robot_state()
    p = state.foot_state[0].foot_position_rt_body
    return get_odom_tform_body(state.kinematic_state.transforms_snapshot).transform_point(p.x, p.y, p.z)


def test_the_body_turns_over_its_feet_and_back(spot):
    before = foot(spot)
    stood(spot, turned(0.4))
    assert body(spot) == pytest.approx((0.0, 0.0, 0.4), abs=0.02)
    assert foot(spot) == pytest.approx(before, abs=0.01)
    stood(spot, turned(0.0))
    assert body(spot) == pytest.approx((0.0, 0.0, 0.0), abs=0.02)


def test_height_pitch_and_turn_go_together(spot):
    stood(spot, turned(-0.2, pitch=0.2, height=-0.06))
    assert spot.served.scripted.height_m == pytest.approx(0.46, abs=0.01)
    assert spot.served.scripted.pitch_rad == pytest.approx(0.2, abs=0.02)
    assert body(spot)[2] == pytest.approx(-0.2, abs=0.02)


def test_the_body_stays_within_its_range(spot):
    stood(spot, turned(1.5, pitch=1.2, height=0.5))
    assert spot.served.scripted.height_m == pytest.approx(0.58, abs=0.01)
    assert (spot.served.scripted.pitch_rad, body(spot)[2]) == (
        pytest.approx(0.35, abs=0.01),
        pytest.approx(0.5, abs=0.02),
    )


def test_poses_over_time_in_the_world_are_passed_at_their_times(spot):
    ahead, down = SE3Pose(0.075, 0.0, 0.52, Quat()), SE3Pose(0.0, 0.0, 0.52, Quat.from_pitch(0.3))
    params = body_pose((2.0, ahead), (4.0, down), (6.0, SE3Pose(0.0, 0.0, 0.52, Quat())))
    number = spot.commands.robot_command(Build.synchro_stand_command(params=params))
    track = []
    for _ in range(70):
        time.sleep(0.1)
        track.append((body(spot)[0], spot.served.scripted.pitch_rad))
    x, pitch = np.array(track).T
    assert (x[19], pitch[39]) == (pytest.approx(0.075, abs=0.02), pytest.approx(0.3, abs=0.03))
    assert x.max() < 0.09
    assert (x[-1], pitch[-1]) == (pytest.approx(0.0, abs=0.01), pytest.approx(0.0, abs=0.01))
    told = spot.commands.robot_command_feedback(number).feedback.synchronized_feedback.mobility_command_feedback
    assert told.stand_feedback.status == Stand.STATUS_IS_STANDING


def test_a_stand_is_in_progress_until_its_last_pose(spot):
    shifted = SE3Pose(0.05, 0.0, 0.0, Quat())
    number = spot.commands.robot_command(
        Build.synchro_stand_command(params=body_pose((3.0, shifted), root="footprint"))
    )
    time.sleep(2.0)
    told = spot.commands.robot_command_feedback(number).feedback.synchronized_feedback.mobility_command_feedback
    assert told.stand_feedback.status == Stand.STATUS_IN_PROGRESS


def test_after_a_walk_the_feet_are_below_the_body_again(spot):
    stood(spot, turned(0.4))
    walk = Build.synchro_se2_trajectory_point_command(0.3, 0.1, 0.2, "odom")
    number = spot.commands.robot_command(walk, end_time_secs=time.time() + 8.0)
    assert rc.block_for_trajectory_cmd(spot.commands, number, timeout_sec=8.0)
    stood(spot, turned(0.0))
    assert body(spot) == pytest.approx((0.3, 0.1, 0.2), abs=0.04)


WALK = Build.synchro_se2_trajectory_point_command(0.3, 0.0, 0.0, "odom")
ASSIST = spot_command_pb2.MobilityParams()
ASSIST.body_control.body_assist_for_manipulation.enable_hip_height_assist = True
MOON = body_pose((0.0, SE3Pose(0.0, 0.0, 0.5, Quat())), root="moon")


@pytest.mark.parametrize("params", [ASSIST, turned(0.0, roll=0.05)], ids=["assist", "small roll"])
def test_the_robot_stands_level_when_asked_for_an_assist_or_a_small_roll(spot, params):
    stood(spot, params)
    assert (spot.served.scripted.height_m, *body(spot)) == pytest.approx((0.52, 0.0, 0.0, 0.0), abs=0.01)


# what the body cannot do -> what the refusal names
@pytest.mark.parametrize(
    ("command", "params", "error", "said"),
    [
        (Build.synchro_stand_command(), turned(0.0, roll=0.2), rc.UnsupportedError, "roll"),
        (Build.synchro_stand_command(), MOON, rc.UnknownFrameError, "moon"),
        (Build.synchro_stand_command(), body_pose(), rc.InvalidRequestError, "no points"),
        (WALK, turned(0.3), rc.UnsupportedError, "during a walk"),
    ],
    ids=["roll", "frame", "no points", "turned walk"],
)
def test_the_robot_refuses_a_posture_that_its_body_cannot_take(spot, command, params, error, said):
    command.synchronized_command.mobility_command.params.Pack(params)
    with pytest.raises(error) as refused:
        spot.commands.robot_command(command, end_time_secs=time.time() + 5.0)
    assert said in refused.value.response.message
    time.sleep(0.5)
    assert body(spot) == pytest.approx((0.0, 0.0, 0.0), abs=0.01)
