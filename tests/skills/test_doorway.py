"""Measured width of a doorway in scans of blocks; it is 0.9 m wide in a wall at x = 2."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform

from skills.doorway import Doorway, measure_opening
from skills.robot import Pose2D
from skills.testing.blocks import Block, take_scan

DOOR = Doorway((2.0, 0.0), 0.9, 0.0)
WALL = (Block(1.95, 0.45, 2.05, 3.0), Block(1.95, -3.0, 2.05, -0.45), Block(1.95, -0.45, 2.05, 0.45, 2.05, 2.5))
BEYOND = Block(5.0, -3.0, 5.1, 3.0)


def seen(*blocks, at=None, believed=None, door=DOOR, count=5):
    """Opening measured in scans from a pose, which the robot believes to be another one."""
    at, rng = at or Pose2D(0.5, 0.0, 0.0), np.random.default_rng(0)
    X_WB = at.transform(0.52)
    scans = [take_scan((*WALL, BEYOND, *blocks), X_WB, RigidTransform(), 0.0, rng, noise_m=0.03) for _ in range(count)]
    X_believed = (believed or at).transform(0.52)
    return measure_opening(door, [(scan, X_believed @ scan.X_BL) for scan in scans])


HERE, NEAR, SHUT = Pose2D(0.5, 0.0, 0.0), Pose2D(0.45, 0.08, 0.03), Block(1.98, -0.45, 2.02, 0.45)
LEAF = [Block(2.0 + 0.06 * k, -0.45 + 0.1 * k, 2.06 + 0.06 * k, -0.35 + 0.1 * k) for k in range(8)]
"""A door that is ajar by 30 degrees."""


@pytest.mark.parametrize(
    ("blocks", "at", "believed", "least_m", "most_m"),
    [
        ([], HERE, None, (0.75, 0.9), (0.75, 1.0)),
        ([], Pose2D(0.5, 0.0, 1.5), None, (0.75, 0.9), (0.75, 1.0)),
        ([], Pose2D(0.5, 0.0, math.pi), None, (0.75, 0.9), (0.75, 1.0)),
        ([], Pose2D(0.8, 1.0, -0.7), None, (0.75, 0.9), (0.75, 1.0)),
        ([], Pose2D(3.5, 0.0, math.pi), None, (0.75, 0.9), (0.75, 1.0)),
        ([], Pose2D(-0.5, 0.0, 0.0), None, (0.75, 0.9), (0.75, 1.0)),
        ([], HERE, NEAR, (0.6, 0.9), (0.6, 1.0)),
        ([SHUT], HERE, None, (0.0, 0.0), (0.0, 0.0)),
        ([SHUT], HERE, NEAR, (0.0, 0.1), (0.0, 0.1)),
        ([Block(1.98, -0.45, 2.02, 0.25)], HERE, None, (0.0, 0.26), (0.14, 1.0)),
        ([Block(1.98, -0.45, 2.02, 0.05)], HERE, None, (0.0, 0.46), (0.34, 1.0)),
        ([Block(1.98, -0.45, 2.02, -0.25)], HERE, None, (0.0, 0.76), (0.64, 1.0)),
        ([Block(1.85, -0.2, 2.15, 0.2, 0.0, 1.7)], HERE, None, (0.0, 0.3), (0.8, 1.0)),  # counts as unseen
        ([SHUT, Block(1.2, -0.25, 1.4, 0.25, 0.0, 1.8)], HERE, None, (0.0, 0.0), (0.5, 1.0)),  # hides a closed door
        (LEAF, HERE, None, (0.0, 0.6), (0.0, 0.6)),
    ],
    ids=[
        "open, from the middle",
        "open, to the left of the robot",
        "open, behind the robot",
        "open, from aside",
        "open, from the other side",
        "open, from farther away",
        "open, by a pose with a small error",
        "closed",
        "closed, by a pose with a small error",
        "gap of 20 cm",
        "gap of 40 cm",
        "gap of 70 cm",
        "object free in the doorway",
        "closed door behind an object",
        "swing door that is ajar",
    ],
)
def test_the_opening_of_a_doorway_is_measured(blocks, at, believed, least_m, most_m):
    opening = seen(*blocks, at=at, believed=believed)
    assert least_m[0] <= opening.least_m <= least_m[1]
    assert most_m[0] <= opening.most_m <= most_m[1]


def test_too_few_rays_show_nothing():
    opening = seen(at=Pose2D(-20.0, 0.0, 0.0), count=1)
    assert (opening.least_m, opening.rays < 50) == (0.0, True)
    assert opening.most_m == pytest.approx(0.9)


def test_view_angle_of_a_doorway():
    assert DOOR.view_angle_rad((0.0, 0.0)) == pytest.approx(0.0)
    assert DOOR.view_angle_rad((4.0, 0.0)) == pytest.approx(0.0)
    assert DOOR.view_angle_rad((1.0, 1.0)) == pytest.approx(math.pi / 4)
    assert DOOR.view_angle_rad((2.0, 1.0)) == pytest.approx(math.pi / 2)
