import numpy as np
import pytest
from pydrake.math import RigidTransform

from skills.estimate.scan_points import ArmShape, SelfFilter, scan_of_points, segment_distance
from skills.robot import ArmCapabilities, Capabilities, GripperCapabilities, Joints

URDF = """<robot name="r">
  <link name="body"/><link name="upper"/><link name="lower"/>
  <joint name="shoulder" type="revolute"><parent link="body"/><child link="upper"/><origin xyz="0.3 0 0.2"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
</robot>"""
HAND = GripperCapabilities("finger", 1.0, 0.1, 50.0, 0.05, 0.1, 0.2, 0.2, 0.0, 0.02, 0.01, 0.15, 0.08, length_m=0.35)
OUTLINE = ((0.55, 0.25), (-0.55, 0.25), (-0.55, -0.25), (0.55, -0.25))


def capabilities(arm=True):
    limbs = ArmCapabilities(("shoulder", "elbow"), 1.0, (0.0, 0.0), 5.0) if arm else None
    return Capabilities(OUTLINE, 1.6, 2.0, 0.52, (0.4, 0.6), (-0.3, 0.3), limbs, HAND, (), URDF)


def joints(shoulder, elbow):
    return Joints(0.0, {"shoulder": shoulder, "elbow": elbow, "other": 1.0}, {}, {})


def test_arm_points_follow_the_joint_angles():
    points = ArmShape(capabilities()).points_B(joints(0.0, -np.pi / 2))
    assert points == pytest.approx(np.array([[0.3, 0.0, 0.2], [0.7, 0.0, 0.2], [0.7, 0.0, 0.55]]), abs=1e-9)


def test_body_points_are_filtered_also_without_an_arm():
    own = SelfFilter.of(capabilities(arm=False))
    assert own.arm is None
    assert own.foreign(np.array([[0.0, 0.2, 0.5], [0.0, 0.6, 0.5]]), np.empty((0, 3))).tolist() == [False, True]


def test_a_held_object_is_the_robots_own_and_one_beyond_is_not():
    own = SelfFilter.of(capabilities())
    arm = own.arm.points_B(joints(0.0, 0.0))
    points = np.array([[1.05, 0.1, 0.2], [1.4, 0.0, 0.2], [0.8, 0.5, 0.2]])
    assert own.foreign(points, arm).tolist() == [False, True, True]


def test_points_about_a_holding_hand_are_the_held_object():
    own = SelfFilter(outline_m=(-0.5, 0.5, -0.25, 0.25))
    arm = np.array([[0.3, 0.0, 0.7], [0.8, 0.0, 0.7], [1.0, 0.0, 0.7]])
    beside_the_hand = np.array([[0.95, 0.3, 0.7]])
    assert own.foreign(beside_the_hand, arm).tolist() == [True]
    assert own.foreign(beside_the_hand, arm, holding=True).tolist() == [False]


def test_distance_from_a_segment_ends_at_its_ends():
    points = np.array([[0.5, 1.0, 0.0], [2.0, 0.0, 0.0], [-3.0, 4.0, 0.0]])
    ends = np.zeros(3), np.array([1.0, 0.0, 0.0])
    assert segment_distance(points, *ends) == pytest.approx([1.0, 1.0, 5.0])


def test_points_become_a_revolution_with_the_nearest_of_each_ray():
    points_L = np.array([[2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 2.5, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 5.0]])
    scan = scan_of_points(
        points_L, np.radians(np.linspace(-15.0, 15.0, 31)), 900, 1.0, RigidTransform(), RigidTransform()
    )
    assert scan.ranges_m.shape == (31, 900)
    # ahead, left; what lies within 0.3 m or above the rings is left out
    assert (scan.ranges_m[15, 450], scan.ranges_m[15, 675]) == (pytest.approx(2.0), pytest.approx(2.5))
    assert np.isfinite(scan.ranges_m).sum() == 2
    assert np.sort(scan.points_B(), axis=0) == pytest.approx(
        np.sort([[2.0, 0.0, 0.0], [0.0, 2.5, 0.0]], axis=0), abs=1e-6
    )
