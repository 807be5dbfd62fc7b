"""Gaps between shapes and boxes, beside the signed distances of Drake."""

import numpy as np
import pytest
from pydrake.geometry import (
    Box,
    Capsule,
    Cylinder,
    GeometryFrame,
    GeometryInstance,
    ProximityProperties,
    SceneGraph,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix

from skills.manipulation.arm.clearance import FIXED, Kind, box_gaps, touching

BOX_HALF_M = np.array([[0.2, 0.1, 0.3]])
SHAPES = {
    Kind.SPHERE: (Sphere(0.1), (0.1, 0.1, 0.0), 0.1),
    Kind.CAPSULE: (Capsule(0.05, 0.3), (0.05, 0.05, 0.15), 0.2),
    Kind.CYLINDER: (Cylinder(0.06, 0.4), (0.06, 0.06, 0.2), np.hypot(0.06, 0.2)),
    Kind.BOX: (Box(0.1, 0.2, 0.3), (0.05, 0.1, 0.15), np.linalg.norm((0.05, 0.1, 0.15))),
}


def touches(kind, X_BS, padding_m):
    """Whether a shape that hangs on no joint comes within a padding of the box at the origin."""
    _, half_m, radius_m = SHAPES[kind]
    rotation, place = X_BS.rotation().matrix()[None], X_BS.translation()[None]
    no_joints = np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3))
    group = np.array([FIXED]), np.array([1]), np.array([[*place[0], radius_m]])
    shape = np.array([radius_m]), np.array([kind]), np.array([half_m]), np.ascontiguousarray(rotation), place
    box = BOX_HALF_M, np.eye(3)[None], np.zeros((1, 3))
    return touching(np.zeros(0, dtype=bool), padding_m, np.zeros((1, 0)), *no_joints, *group, *shape, *box)


def distances_m(kind, poses):
    """Drake's signed distances of the shape at each pose from the box at the origin."""
    graph = SceneGraph()
    source = graph.RegisterSource("test")
    frame = graph.RegisterFrame(source, GeometryFrame("moving"))
    for owner, shape in ((graph.world_frame_id(), Box(*2 * BOX_HALF_M[0])), (frame, SHAPES[kind][0])):
        geometry = graph.RegisterGeometry(source, owner, GeometryInstance(RigidTransform(), shape, "shape"))
        graph.AssignRole(source, geometry, ProximityProperties())
    context, found = graph.CreateDefaultContext(), []
    for X_BS in poses:
        port = graph.get_source_pose_port(source)
        poses_now = graph.AllocateInputAbstract(port)
        poses_now.get_mutable_value().set_value(frame, X_BS)
        port.FixValue(context, poses_now.get_value())
        (pair,) = graph.get_query_output_port().Eval(context).ComputeSignedDistancePairwiseClosestPoints()
        found.append(pair.distance)
    return found


def random_poses(count):
    rng = np.random.default_rng(3)
    return [RigidTransform(_turned(rng), rng.uniform(-0.4, 0.4, 3)) for _ in range(count)]


def _turned(rng):
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return RotationMatrix(axes * np.sign(np.linalg.det(axes)))


@pytest.mark.parametrize("kind", SHAPES)
def test_shapes_that_drake_finds_within_the_padding_touch(kind):
    # never looser than Drake; stricter in few cases, at rims and corners
    poses = random_poses(300)
    away = distances_m(kind, poses)
    for padding_m in (0.0, 0.05):
        found = [touches(kind, X_BS, padding_m) for X_BS in poses]
        near = [distance_m <= padding_m for distance_m in away]
        assert all(touch for touch, is_near in zip(found, near, strict=True) if is_near)
        assert sum(found) - sum(near) <= 3
        assert 30 < sum(near) < 270


def test_no_gap_of_two_boxes_is_wider_than_their_distance():
    poses = random_poses(300)
    half_m = np.array(SHAPES[Kind.BOX][1])
    for X_BS, distance_m in zip(poses, distances_m(Kind.BOX, poses), strict=True):
        rotation, place = X_BS.rotation().matrix(), X_BS.translation()
        still, at_origin = np.zeros((1, 3)), np.zeros((1, 3))
        gap_m = box_gaps(half_m, rotation, place, still, BOX_HALF_M, np.eye(3)[None], at_origin)[0, 0]
        assert gap_m <= distance_m + 1e-9
        assert (gap_m > 0) == (distance_m > 0)
