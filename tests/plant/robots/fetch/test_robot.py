"""The Robot protocol as the simulated Fetch keeps it."""

import math

import numpy as np
import pytest
from pydrake.multibody.math import SpatialVelocity

from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.engine import Engine
from plant.robots.robot_kind import PlacedRobot
from skills.robot import ArmTrajectory, CommandState, LeaseError, Pose2D
from tests.plant.boxes import fixed_box


def test_the_scan_measures_the_distance_of_a_wall(floor, tmp_path):
    """A wall's face at x = 2.9 m, the robot at 0: the scan's middle lies there in the body frame."""
    wall, bob = fixed_box(tmp_path, "wall", "0.2 6 1", "3 0 0.5"), PlacedRobot("Bob", "fetch", Pose2D(0.0, 0.0, 0.0))
    scan = Engine(build_diagram(DiagramConfig(models=[floor, wall], robots=[bob], render=False))).robots["Bob"].scan()
    points_B = scan.points_B()
    ahead = points_B[np.abs(points_B[:, 1]) < 0.3]
    assert (float(np.median(ahead[:, 0])), scan.ranges_m.shape) == (pytest.approx(2.9, abs=0.02), (1, 662))


def test_odometry_follows_a_driven_arc(engine, fetch, lease):
    """2 s at 0.4 m/s and 0.5 rad/s; encoders err by 1 or 2 percent."""
    fetch.drive(0.4, 0.0, 0.5, until_s=2.0, lease=lease)
    engine.advance(3.0)
    plant, body = engine.world.plant, engine.world.robots["Bob"].body
    true = Pose2D.from_transform(plant.EvalBodyPoseInWorld(engine.context, body))
    read = fetch.odometry().pose
    assert (read.x_m + 0.5, read.y_m + 0.2) == pytest.approx((true.x_m, true.y_m), abs=0.04)
    assert read.yaw_rad == pytest.approx(true.yaw_rad, abs=0.03)


def test_the_head_pose_of_the_capabilities_equals_the_plants(engine, fetch, lease):
    """The frame `head` of the capabilities at the encoders' angles is the plant's link, to the encoders' error."""
    fetch.point_head(0.5, 0.3, until_s=5.0, lease=lease)
    engine.advance(2.0)
    plant, bob = engine.world.plant, engine.world.robots["Bob"]
    link = plant.GetBodyByName("head_tilt", bob.instance)
    X_WB, X_WF = (plant.EvalBodyPoseInWorld(engine.context, body) for body in (bob.body, link))
    X_BF = X_WB.inverse() @ X_WF
    angles = fetch.joints().position_rad
    told = fetch.capabilities().head.X_BF(angles["head_pan"], angles["head_tilt"])
    np.testing.assert_allclose(told.GetAsMatrix34(), X_BF.GetAsMatrix34(), atol=0.01)


TRAVELLING_M = 0.37743 + 0.02
BOX = """<sdf version="1.7"><model name="box"><link name="box">
<inertial><mass>0.3</mass><inertia><ixx>0.0003</ixx><iyy>0.0003</iyy><izz>0.0003</izz></inertia></inertial>
<collision name="box"><geometry><box><size>0.05 0.05 0.12</size></box></geometry></collision></link></model></sdf>"""


def near_m(height_m):
    return pytest.approx(height_m, abs=0.01)


def pose(engine):
    """(x, y, yaw, height) of the body frame."""
    X_WB = engine.world.plant.EvalBodyPoseInWorld(engine.context, engine.world.robots["Bob"].body)
    at = Pose2D.from_transform(X_WB)
    return np.array([at.x_m, at.y_m, at.yaw_rad, X_WB.translation()[2]])


def test_it_stands_still_without_creeping(engine):
    engine.advance(1.0)
    before = pose(engine)
    engine.advance(10.0)
    np.testing.assert_allclose(pose(engine), before, atol=1e-4)


def test_it_drives_a_metre_ahead_within_two_centimetres(engine, fetch, lease):
    """1.0 m: half a metre a second for two seconds; the braking distance equals the loss at the start."""
    x0, y0 = pose(engine)[:2]
    while fetch.odometry().pose.x_m < 1.0 - 0.5**2 / (2 * 2.0):
        fetch.drive(0.5, 0.0, 0.0, until_s=engine.now() + 0.1, lease=lease)
        engine.advance(0.025)
    fetch.stop(lease=lease)
    engine.advance(2.0)
    x, y, yaw, _ = pose(engine)
    assert (x - x0, y - y0) == pytest.approx((1.0, 0.0), abs=0.02)
    assert yaw == pytest.approx(0.0, abs=math.radians(1.0))


def test_it_turns_a_quarter_on_the_spot_within_two_degrees(engine, fetch, lease):
    """The command lasts for 90 degrees at 0.5 rad/s; ramps at both ends differ by 0.03 rad."""
    x0, y0 = pose(engine)[:2]
    fetch.drive(0.0, 0.0, 0.5, until_s=math.pi / 2 / 0.5 + 0.5 * (0.5 / 2.5 - 0.5 / 6.0), lease=lease)
    engine.advance(5.0)
    x, y, yaw, _ = pose(engine)
    assert (yaw, (x, y)) == (pytest.approx(math.pi / 2, abs=math.radians(2.0)), pytest.approx((x0, y0), abs=0.01))


def test_fetch_refuses_to_drive_sideways_and_to_pitch(engine, fetch, lease):
    aside = fetch.command_status(fetch.drive(0.3, 0.1, 0.0, until_s=1.0, lease=lease))
    pitched = fetch.command_status(fetch.stand(0.5, 0.1, until_s=1.0, lease=lease))
    assert [aside.state, pitched.state] == [CommandState.REFUSED] * 2 and "sideways" in aside.reason
    engine.advance(0.5)
    assert pose(engine)[0] == pytest.approx(0.5, abs=1e-3)


def test_a_drive_that_expires_stops_the_robot(engine, fetch, lease):
    command = fetch.drive(0.8, 0.0, 0.0, until_s=0.5, lease=lease)
    engine.advance(2.0)
    assert fetch.command_status(command).state is CommandState.DONE
    before = pose(engine)
    engine.advance(1.0)
    np.testing.assert_allclose(pose(engine), before, atol=1e-3)


def test_speed_and_acceleration_are_limited(engine, fetch, lease):
    fetch.drive(5.0, 0.0, 0.0, until_s=10.0, lease=lease)
    engine.advance(0.4)
    assert pose(engine)[0] - 0.5 < 0.5 * 1.0 * 0.4**2 + 0.02
    engine.advance(1.5)
    x0 = pose(engine)[0]
    engine.advance(0.5)
    assert (pose(engine)[0] - x0) / 0.5 == pytest.approx(1.0, abs=0.03)


def test_a_push_from_the_side_does_not_roll_it_away(engine):
    """Wheels roll ahead only: 150 N from the side are less than the tyres hold, 0.9 x 600 N."""
    plant, base = engine.world.plant, engine.world.robots["Bob"].base
    engine.advance(0.5)
    start = pose(engine)
    velocities = plant.GetVelocities(engine.context)
    velocities[base.floating_velocities_start_in_v() + 4] = 0.2
    plant.SetVelocities(engine.context, velocities)
    engine.advance(1.0)
    assert abs(pose(engine)[1] - start[1]) < 0.02


def test_the_lift_moves_up_and_down_at_its_speed(engine, fetch, lease):
    """0.3 m at 0.1 m/s: 3 s."""
    up = fetch.stand(TRAVELLING_M + 0.3, 0.0, until_s=10.0, lease=lease)
    engine.advance(2.5)
    assert fetch.command_status(up).state is CommandState.RUNNING
    engine.advance(1.0)
    assert (fetch.command_status(up).state, pose(engine)[3]) == (CommandState.DONE, near_m(TRAVELLING_M + 0.3))
    down = fetch.sit(until_s=10.0, lease=lease)
    engine.advance(4.0)
    assert (fetch.command_status(down).state, pose(engine)[3]) == (CommandState.DONE, near_m(0.377))


def test_the_lidar_stays_at_its_height_when_the_lift_goes_up(engine, fetch, lease):
    fetch.stand(TRAVELLING_M + 0.2, 0.0, until_s=10.0, lease=lease)
    engine.advance(3.0)
    scan = fetch.scan()
    assert scan.X_BL.translation()[2] + scan.X_OB.translation()[2] == near_m(0.2878)


def test_the_head_turns_to_its_goal_and_refuses_one_out_of_reach(engine, fetch, lease):
    command = fetch.point_head(0.8, 0.4, until_s=5.0, lease=lease)
    engine.advance(2.0)
    assert fetch.command_status(command).state is CommandState.DONE
    angles = fetch.joints().position_rad
    assert (angles["head_pan"], angles["head_tilt"]) == pytest.approx((0.8, 0.4), abs=0.02)
    far = fetch.point_head(2.0, 0.0, until_s=5.0, lease=lease)
    assert "pan 2.00 rad must lie in [-1.57, 1.57]" in fetch.command_status(far).reason


def arm_by(fetch, lease, offsets_rad, seconds):
    """Commands the stowed arm to turn its joints."""
    start = np.array(fetch.capabilities().arm.stowed_rad)
    path = ArmTrajectory(np.array([0.0, seconds]), np.array([start, start + offsets_rad]))
    return fetch.move_arm(path, until_s=10.0, lease=lease), start + offsets_rad


def test_the_arm_follows_a_trajectory_to_its_end(engine, fetch, lease):
    command, goal = arm_by(fetch, lease, [-0.6, -0.5, 0.3, -0.3, 0.4, -0.4, 0.5], 2.0)
    engine.advance(4.0)
    assert fetch.command_status(command).state is CommandState.DONE
    read = fetch.joints().position_rad
    np.testing.assert_allclose([read[name] for name in fetch.capabilities().arm.joint_names], goal, atol=0.03)


def test_a_trajectory_that_is_too_fast_is_refused(fetch, lease):
    """shoulder_pan turns at 1.256 rad/s at most."""
    command, _ = arm_by(fetch, lease, [-1.0, 0, 0, 0, 0, 0, 0], 0.5)
    assert "at most 1.3 is allowed" in fetch.command_status(command).reason


def test_the_stowed_arm_stays_within_the_footprint(engine):
    """The footprint's radius is 0.28 m."""
    plant, bob = engine.world.plant, engine.world.robots["Bob"]
    inspector = engine.world.scene_graph.model_inspector()
    far_m = 0.0
    for name in (*bob.kind.capabilities().arm.joint_names, "left_finger", "right_finger"):
        link = plant.GetBodyByName(name, bob.instance)
        X_WBase, X_WL = (plant.EvalBodyPoseInWorld(engine.context, body) for body in (bob.base, link))
        X_BaseLink = X_WBase.inverse() @ X_WL
        for shape in plant.GetCollisionGeometriesForBody(link):
            box = inspector.GetObbInGeometryFrame(shape)
            signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1)
            corners = X_BaseLink @ inspector.GetPoseInFrame(shape) @ box.pose() @ (signs.T * box.half_width()).T
            far_m = max(far_m, float(np.hypot(corners[0], corners[1]).max()))
    assert far_m < 0.29


def test_a_second_holder_is_refused_until_it_takes_the_lease(engine, fetch, lease):
    with pytest.raises(LeaseError, match="'test'"):
        fetch.acquire_lease("other")
    command = fetch.drive(0.5, 0.0, 0.0, until_s=5.0, lease=lease)
    fetch.take_lease("other")
    assert fetch.command_status(command).state is CommandState.STOPPED
    refused = fetch.drive(0.5, 0.0, 0.0, until_s=5.0, lease=lease)
    assert "no longer counts" in fetch.command_status(refused).reason


def test_a_restored_robot_moves_like_the_original(fetch_world):
    """The same commands after a restore end at the same place as without one."""

    first, second = Engine(fetch_world, seed=3), Engine(fetch_world, seed=3)
    lease = first.robots["Bob"].acquire_lease("test")
    first.robots["Bob"].drive(0.4, 0.0, 0.3, until_s=1.0, lease=lease)
    first.robots["Bob"].stand(0.5, 0.0, until_s=5.0, lease=lease)
    first.advance(3.0)
    second.resume(first.state(), first.world_state())
    first.advance(1.0)
    second.advance(1.0)
    np.testing.assert_allclose(pose(second), pose(first), atol=1e-3)
    a, b = (engine.robots["Bob"].odometry().pose for engine in (first, second))
    assert (a.x_m, a.y_m, a.yaw_rad) == pytest.approx((b.x_m, b.y_m, b.yaw_rad), abs=1e-3)


@pytest.fixture
def boxed(floor, tmp_path):
    """A Fetch with a box between its open fingers, which falls unless they close."""
    path = tmp_path / "box.sdf"
    path.write_text(BOX)
    box, bob = LooseModel("box", path, Pose2D(5.0, 5.0, 0.0).transform(0.06)), Pose2D(0.0, 0.0, 0.0)
    config = DiagramConfig(models=[floor, box], robots=[PlacedRobot("Bob", "fetch", bob)], render=False)
    return Engine(build_diagram(config))


def test_the_gripper_closes_on_a_box_and_carries_it(boxed):
    """A box of 5 cm and 0.3 kg between the fingers stays there, and is felt, while the robot drives and turns."""
    bob, plant = boxed.robots["Bob"], boxed.world.plant
    lease = bob.acquire_lease("test")
    start = np.array(bob.capabilities().arm.stowed_rad)
    ahead = np.array([0.0, 0.3, 0.0, -0.3, 0.0, 0.0, 0.0])
    bob.move_arm(ArmTrajectory(np.array([0.0, 4.0]), np.array([start, ahead])), until_s=10.0, lease=lease)
    opened = bob.set_gripper(0.10, 30.0, until_s=10.0, lease=lease)
    boxed.advance(5.0)
    assert bob.command_status(opened).state is CommandState.DONE
    assert bob.gripper().opening == pytest.approx(0.10, abs=0.004)
    hand = boxed.world.robots["Bob"].hand
    (index,) = plant.GetBodyIndices(boxed.world.models["box"])
    box = plant.get_body(index)
    closed = bob.set_gripper(0.0, 40.0, until_s=boxed.now() + 5.0, lease=lease)
    while bob.gripper().opening > 0.052:
        p_W = plant.EvalBodyPoseInWorld(boxed.context, hand) @ np.array([0.1665, 0.0, 0.0])
        plant.SetFreeBodyPose(boxed.context, box, Pose2D(p_W[0], p_W[1], 0.0).transform(p_W[2]))
        plant.SetFreeBodySpatialVelocity(context=boxed.context, body=box, V_JpJc=SpatialVelocity.Zero())
        boxed.advance(0.025)
    for _ in range(10):
        boxed.advance(0.1)
    assert bob.command_status(closed).state is CommandState.DONE and bob.gripper().holding
    assert bob.gripper().opening == pytest.approx(0.05, abs=0.004)
    assert bob.gripper().force_n == pytest.approx(40.0, abs=8.0)
    X_HO = plant.EvalBodyPoseInWorld(boxed.context, hand).inverse() @ plant.EvalBodyPoseInWorld(boxed.context, box)
    for number in range(40):
        bob.drive(0.5, 0.0, -1.8 if number // 10 % 2 else 1.8, until_s=boxed.now() + 0.3, lease=lease)
        boxed.advance(0.1)
        assert bob.gripper().holding
    now = plant.EvalBodyPoseInWorld(boxed.context, hand).inverse() @ plant.EvalBodyPoseInWorld(boxed.context, box)
    np.testing.assert_allclose(now.translation(), X_HO.translation(), atol=0.01)
