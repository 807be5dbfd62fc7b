import math

import numpy as np

from skills.estimate.matching import match
from skills.geometry import relative_pose
from skills.mapping.distributions import Distributions
from skills.mapping.mapper import MapperOptions
from skills.robot import Pose2D

MATCHING = MapperOptions().matching
SPREAD = np.diag([0.2, 0.2, 0.1]) ** 2


def walls(*, count: int = 400, seed: int = 0, sigma_m: float = 0.03, end: bool = True) -> np.ndarray:
    """Noisy points (x, y, facing) of two long walls beside the origin, and the wall ahead."""
    rng = np.random.default_rng(seed)
    along = rng.uniform(-4.0, 4.0, count)
    left = np.column_stack([along[::2], 1.0 + 0.0 * along[::2], np.full(len(along[::2]), -math.pi / 2)])
    right = np.column_stack([along[1::2], -1.0 + 0.0 * along[1::2], np.full(len(along[1::2]), math.pi / 2)])
    ahead = np.column_stack([np.full(80, 4.0), rng.uniform(-1.0, 1.0, 80), np.full(80, math.pi)])
    points = np.vstack([left, right, ahead] if end else [left, right])
    points[:, :2] += rng.normal(0.0, sigma_m, (len(points), 2))
    return points


def submap(**kind) -> Distributions:
    made = Distributions(half_m=6.0)
    for seed in range(10):
        made.add(walls(seed=seed, **kind), Pose2D(0.0, 0.0, 0.0))
    return made


def test_a_scan_is_aligned_to_a_centimetre():
    found = match(submap().linearise, walls(seed=99), Pose2D(0.08, -0.06, 0.03), SPREAD, MATCHING)
    assert math.hypot(found.pose.x_m, found.pose.y_m) < 0.01 and abs(found.pose.yaw_rad) < math.radians(0.3)
    assert found.inlier_share > 0.9


def test_along_a_bare_corridor_the_prior_stays_with_its_covariance():
    found = match(submap(end=False).linearise, walls(seed=99, end=False), Pose2D(0.15, 0.04, 0.0), SPREAD, MATCHING)
    assert abs(found.pose.x_m - 0.15) < 0.1 and abs(found.pose.y_m) < 0.01
    assert found.covariance[0, 0] > 100.0 * found.covariance[1, 1]


def test_the_other_side_of_a_thin_wall_does_not_pull():
    rng = np.random.default_rng(1)
    y = rng.uniform(-3.0, 3.0, 300)
    near, far = np.full(300, math.pi), np.zeros(300)
    made = Distributions(half_m=6.0)
    made.add(np.column_stack([2.0 + rng.normal(0, 0.03, 300), y, near]), Pose2D(0.0, 0.0, 0.0))
    made.add(np.column_stack([2.1 + rng.normal(0, 0.03, 300), y, far]), Pose2D(0.0, 0.0, 0.0))
    behind = np.column_stack([2.1 + rng.normal(0, 0.03, 300), y, far])
    found = match(made.linearise, behind, Pose2D(0.0, 0.0, 0.0), SPREAD, MATCHING)
    assert abs(relative_pose(Pose2D(0.0, 0.0, 0.0), found.pose).x_m) < 0.01
