import math

import numpy as np
import pytest

from errand_make.maps.mapper import MapperOptions
from errand_make.maps.submap_matching import Distributions, Window, find_pose
from skills.estimate.matching import match
from skills.geometry import relative_pose
from skills.grid_map import GridMap
from skills.robot import Pose2D

MATCHING = MapperOptions().matching
SPREAD = np.diag([0.2, 0.2, 0.1]) ** 2


def walls(*, count=400, seed=0, sigma_m=0.03, end=True):
    """Noisy points (x, y, facing) of two long walls beside the origin, and the wall ahead."""
    rng = np.random.default_rng(seed)
    along = rng.uniform(-4.0, 4.0, count)
    left = np.column_stack([along[::2], 1.0 + 0.0 * along[::2], np.full(len(along[::2]), -math.pi / 2)])
    right = np.column_stack([along[1::2], -1.0 + 0.0 * along[1::2], np.full(len(along[1::2]), math.pi / 2)])
    ahead = np.column_stack([np.full(80, 4.0), rng.uniform(-1.0, 1.0, 80), np.full(80, math.pi)])
    points = np.vstack([left, right, ahead] if end else [left, right])
    points[:, :2] += rng.normal(0.0, sigma_m, (len(points), 2))
    return points


def submap(**kind):
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


CELL_M = 0.05


def field(*boxes):
    occupied = np.zeros((200, 240), dtype=np.bool_)
    for x0, y0, x1, y1 in boxes:
        occupied[round(y0 / CELL_M) : round(y1 / CELL_M), round(x0 / CELL_M) : round(x1 / CELL_M)] = True
    return GridMap(occupied, CELL_M, (0.0, 0.0))


ROOM = ((1.0, 1.0, 9.0, 1.1), (1.0, 7.0, 9.0, 7.1), (1.0, 1.0, 1.1, 7.1), (9.0, 1.0, 9.1, 7.1), (3.0, 1.0, 4.0, 2.0))


def seen_from(grid, pose):
    """The surface cells as seen from a pose."""
    rows, columns = np.nonzero(np.abs(grid.distance) < CELL_M)
    x, y = (columns + 0.5) * CELL_M - pose.x_m, (rows + 0.5) * CELL_M - pose.y_m
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return np.column_stack([c * x + s * y, -s * x + c * y])[::4]


@pytest.mark.parametrize("true", [Pose2D(5.0, 4.0, 0.1), Pose2D(6.3, 5.2, -0.15)])
def test_finds_the_pose_in_a_wide_window(true):
    grid = field(*ROOM)
    found = find_pose(grid, seen_from(grid, true), Pose2D(5.5, 4.5, 0.0), Window(2.0, 0.3))
    assert math.hypot(found.pose.x_m - true.x_m, found.pose.y_m - true.y_m) < 0.1
    assert abs(found.pose.yaw_rad - true.yaw_rad) < math.radians(2.0)
    assert found.competing_score < 0.9 * found.score


def test_equals_the_best_of_an_exhaustive_search():
    grid = field(*ROOM)
    points = seen_from(grid, Pose2D(5.0, 4.0, 0.0))
    found = find_pose(grid, points, Pose2D(5.3, 4.3, 0.0), Window(0.8, 0.0))
    assert found is not None
    distance = grid.distance
    half = 0.05  # the search ends at squares of 0.1 m, whose middles it scores
    steps = np.arange(-0.75, 0.76, 2 * half)
    scores = []
    for dx in steps:
        for dy in steps:
            cells = np.floor((points + [5.3 + dx, 4.3 + dy]) / CELL_M).astype(int)
            inside = np.clip(cells, 0, [distance.shape[1] - 1, distance.shape[0] - 1])
            off = np.abs(distance[inside[:, 1], inside[:, 0]]) + np.hypot(*(cells - inside).T) * CELL_M
            scores.append(np.mean(np.maximum(0.0, 1.0 - (off / 0.25) ** 2)))
    assert found.score >= max(scores) - 1e-6


def test_a_corridor_has_competing_poses():
    grid = field((1.0, 3.0, 11.0, 3.1), (1.0, 5.0, 11.0, 5.1))
    x = np.arange(-2.0, 2.0, 0.05)
    points = np.vstack([np.column_stack([x, np.full(len(x), side)]) for side in (-1.0, 1.0)])
    found = find_pose(grid, points, Pose2D(6.0, 4.05, 0.0), Window(2.0, 0.05))
    assert found is not None and found.competing_score > 0.9 * found.score


def test_nothing_is_found_where_nothing_fits():
    grid = field(*ROOM)
    circle = 0.8 * np.column_stack([np.cos(np.arange(0, 6.2, 0.05)), np.sin(np.arange(0, 6.2, 0.05))])
    assert find_pose(grid, circle, Pose2D(6.0, 4.5, 0.0), Window(1.0, 0.2)) is None
