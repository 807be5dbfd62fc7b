"""Messages keep their values."""

import math

import pytest
from bosdyn.api import geometry_pb2
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw

from errand_spot.messages import InvalidRequestError, frame_tree, pose, seconds, timestamp, transform

coordinates = st.floats(-100.0, 100.0)
angles = st.floats(-1.5, 1.5)


@given(coordinates, coordinates, coordinates, angles, angles, angles)
def test_a_pose_survives_its_message(x, y, z, roll, pitch, yaw):
    X = RigidTransform(RollPitchYaw(roll, pitch, yaw), [x, y, z])
    assert transform(pose(X), "pose").IsNearlyEqualTo(X, 1e-9)


@given(st.floats(0.0, 4e9))
def test_a_time_survives_its_message(time_s):
    assert seconds(timestamp(time_s)) == pytest.approx(time_s, abs=1e-6)


def test_a_rotation_that_was_left_out_is_none():
    assert transform(geometry_pb2.SE3Pose(), "pose").IsExactlyIdentity()


def test_a_huge_quaternion_is_normalised():
    message = geometry_pb2.SE3Pose(rotation=geometry_pb2.Quaternion(w=1e300, z=1e300))
    assert transform(message, "pose").rotation().ToRollPitchYaw().yaw_angle() == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("field", ["position.x", "rotation.w"])
def test_a_value_that_is_not_finite_is_named(field):
    message = geometry_pb2.SE3Pose()
    part, name = field.split(".")
    setattr(getattr(message, part), name, math.inf)
    with pytest.raises(InvalidRequestError, match=f"goal.{field} is inf"):
        transform(message, "goal")


def test_a_frame_tree_names_each_parent():
    made = frame_tree({"body": ("", RigidTransform()), "odom": ("body", RigidTransform([1.0, 0.0, 0.0]))})
    assert made.child_to_parent_edge_map["odom"].parent_frame_name == "body"
    assert made.child_to_parent_edge_map["odom"].parent_tform_child.position.x == 1.0
