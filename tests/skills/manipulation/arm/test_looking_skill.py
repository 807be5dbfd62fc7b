"""Tests of the angles of a head that looks at a point, and of pictures without the arm."""

import numpy as np
import pytest
from pydrake.math import RigidTransform

from plant.robots.fetch.kind import FETCH
from skills.api import PlanningError
from skills.manipulation.arm.looking_skill import head_angles, mask_arm
from skills.robot import FrameTree, Image, Intrinsics

CAPABILITIES = FETCH.capabilities()
HEAD, CAMERA = CAPABILITIES.head, CAPABILITIES.object_camera


@pytest.mark.parametrize("p_BT", [(0.8, 0.0, 0.4), (0.7, 0.5, 0.5), (1.5, -1.0, -0.3), (0.5, 0.9, 0.6)])
def test_the_camera_looks_at_the_point(p_BT):
    X_BC = HEAD.X_BF(*head_angles(HEAD, CAMERA, np.array(p_BT))) @ CAMERA.X_FC
    x, y, z = X_BC.inverse() @ np.array(p_BT)
    assert z > 0.0
    assert np.hypot(x, y) / z < 0.01


def test_a_point_behind_is_refused():
    with pytest.raises(PlanningError, match="head does not turn"):
        head_angles(HEAD, CAMERA, np.array([-1.0, 0.0, 0.5]))


def test_pixels_of_the_arm_have_no_depth():
    lens = Intrinsics(3, 1, 1.0, 1.0, 1.0, 0.0)
    depth = np.array([[1.0, 1.0, 1.0]], dtype=np.float32)
    none = np.zeros((0, 0), np.uint8)
    frames = FrameTree({"body": ("odom", RigidTransform()), "camera": ("body", RigidTransform())})
    image = Image(0.0, "head", "camera", lens, lens, None, none, depth, frames)
    arm_B = [np.array([1.0, -0.5, 1.0]), np.array([1.0, 0.5, 1.0])]  # at the third pixel's point (1, 0, 1)
    assert mask_arm(image, arm_B).depth_m.tolist() == [[1.0, 1.0, 0.0]]
