"""Postures of held chains: what is hit counts exactly, also for turned boxes."""

import cart_urdf as cart
import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from errand_make.robots.posture import Obstacle, held_postures
from errand_make.robots.tree import KinematicTree
from plant.robots.urdf_robot.urdf_file import UrdfFile


def test_the_points_in_a_turned_box_are_found():
    X_BL = RigidTransform(RollPitchYaw(0.3, -0.5, 1.0), [0.1, 0.2, 0.3])
    low, high = np.array([-0.2, -0.1, -0.05]), np.array([0.2, 0.1, 0.05])
    points_B = np.random.default_rng(1).uniform(-0.3, 0.6, (3, 4000))
    points_L = (X_BL.inverse() @ points_B).T
    expected = np.flatnonzero(((points_L > low) & (points_L < high)).all(axis=1))
    assert len(expected) > 10 and Obstacle(X_BL, low, high).contained(points_B).tolist() == expected.tolist()


def test_a_box_without_volume_contains_nothing():
    flat = Obstacle(RigidTransform(), np.array([-1.0, -1.0, 0.01]), np.array([1.0, 1.0, -0.01]))
    assert len(flat.contained(np.zeros((3, 5)))) == 0


@pytest.fixture
def tree(tmp_path):
    (tmp_path / "cart.urdf").write_text(cart.robot(cart.base(), cart.wheels(), cart.arm()))
    return KinematicTree(UrdfFile(tmp_path / "cart.urdf"), "base_link", RigidTransform())


def test_an_arm_that_sticks_out_is_held_inside_the_outline(tree):
    arm = [tree.urdf.joints[f"arm_{k}_joint"] for k in range(1, 7)]
    base = tree.points(["base_link"])
    best = held_postures(tree, arm, base, 0.0)[0]
    names = dict(zip((each.name for each in arm), best.tolist(), strict=True))
    held = KinematicTree(tree.urdf, "base_link", RigidTransform(), posture=names)
    before, after = (each.points(each.links_below(arm[0]))[:, :2].max() for each in (tree, held))
    assert before > 0.9 and after < base[:, 0].max() + 0.03
