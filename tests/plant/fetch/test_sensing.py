"""What the simulated Fetch senses."""

import math

import numpy as np
import pytest

from plant.diagram import LooseModel, build_diagram
from plant.engine import Engine
from plant.fetch.kind import fetch_capabilities
from plant.fetch.sensing import lidar_spec
from plant.fetch.wheels import Axle, WheelOdometer
from skills.robot import BaseKind, Mount, Pose2D

WALL = """<sdf version="1.7"><model name="wall"><link name="wall">
<collision name="wall"><geometry><box><size>0.2 6 1</size></box></geometry></collision></link></model></sdf>"""


def test_the_lidar_sees_220_degrees_in_662_points():
    azimuths = lidar_spec().azimuths_rad()[lidar_spec().seen()]
    assert len(azimuths) == 662
    assert math.degrees(azimuths[-1] - azimuths[0]) == pytest.approx(220.0, abs=0.1)
    assert math.degrees(azimuths[0] + azimuths[-1]) == pytest.approx(0.0, abs=0.5)


def test_a_wall_ahead_is_where_the_scan_says(floor, tmp_path):
    """A wall's face at x = 2.9 m, the robot at 0: the scan's middle lies there in the body frame."""
    path = tmp_path / "wall.sdf"
    path.write_text(WALL)
    wall = LooseModel("wall", path, Pose2D(3.0, 0.0, 0.0).transform(0.5), fixed=True)
    world = build_diagram(directives=None, models=[floor, wall], robots={"Bob": "fetch"}, render=False)
    scan = Engine(world, {"Bob": Pose2D(0.0, 0.0, 0.0)}).robots["Bob"].scan()
    points_B = scan.points_B()
    ahead = points_B[np.abs(points_B[:, 1]) < 0.3]
    assert float(np.median(ahead[:, 0])) == pytest.approx(2.9, abs=0.02)
    assert scan.ranges_m.shape == (1, 662)


def test_wheels_that_turn_alike_count_a_straight_way_and_against_each_other_a_turn():
    """Radius 0.05 m, half track 0.2 m: 10 rad each are 0.5 m; -4 and 4 rad are 1 rad."""
    odometer = WheelOdometer(Axle(0.05, 0.2), np.zeros(2))
    odometer.count(np.array([10.0, 10.0]))
    odometer.count(np.array([6.0, 14.0]))
    assert (odometer.pose.x_m, odometer.pose.y_m, odometer.pose.yaw_rad) == pytest.approx((0.5, 0.0, 1.0))


def test_odometry_follows_a_driven_arc(engine, fetch, lease):
    """2 s at 0.4 m/s and 0.5 rad/s; encoders err by 1 or 2 percent."""
    fetch.drive(0.4, 0.0, 0.5, until_s=2.0, lease=lease)
    engine.advance(3.0)
    plant, body = engine.world.plant, engine.world.robots["Bob"].body
    true = Pose2D.from_transform(plant.EvalBodyPoseInWorld(engine.context, body))
    read = fetch.odometry().pose
    assert (read.x_m + 0.5, read.y_m + 0.2) == pytest.approx((true.x_m, true.y_m), abs=0.04)
    assert read.yaw_rad == pytest.approx(true.yaw_rad, abs=0.03)


def test_its_capabilities_say_what_differs_from_a_walking_robot():
    known = fetch_capabilities()
    assert known.base_kind is BaseKind.DIFFERENTIAL
    assert [camera.mount for camera in known.cameras] == [Mount.HEAD]
    assert known.lidar_height_m == pytest.approx(0.288, abs=0.001)
    assert known.pitch_range_rad == (0.0, 0.0)
    assert len(known.arm.joint_names) == 7


def test_the_head_of_the_capabilities_is_where_the_plant_has_it(engine, fetch, lease):
    """The frame `head` of the capabilities at the encoders' angles is the plant's link, to the encoders' error."""
    fetch.point_head(0.5, 0.3, until_s=5.0, lease=lease)
    engine.advance(2.0)
    plant, bob = engine.world.plant, engine.world.robots["Bob"]
    link = plant.GetBodyByName("head_tilt", bob.instance)
    X_BF = plant.EvalBodyPoseInWorld(engine.context, bob.body).inverse() @ plant.EvalBodyPoseInWorld(
        engine.context, link
    )
    angles = fetch.joints().position_rad
    told = fetch.capabilities().head.X_BF(angles["head_pan"], angles["head_tilt"])
    np.testing.assert_allclose(told.GetAsMatrix34(), X_BF.GetAsMatrix34(), atol=0.01)
