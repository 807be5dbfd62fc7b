"""Boxes about clusters for the arm."""

import numpy as np
import pytest

from skills.detect.viewpoints import standing_parts


def filled(width_m, depth_m, x_m=0.0, y_m=0.0, yaw_rad=0.0):
    """Points all over a rectangle with a corner at (x, y), then rotated about the origin."""
    x, y = np.meshgrid(np.arange(0.0, width_m, 0.01), np.arange(0.0, depth_m, 0.01))
    points = np.column_stack([x.ravel() + x_m, y.ravel() + y_m])
    return points @ np.array([[np.cos(yaw_rad), -np.sin(yaw_rad)], [np.sin(yaw_rad), np.cos(yaw_rad)]]).T


def inside_any(parts, point, margin_m=0.01):
    """Returns whether a point lies in the upright rectangle about one of the parts."""
    boxes = [(part.min(axis=0) - margin_m, part.max(axis=0) + margin_m) for part in parts]
    return any(np.all(point >= low) and np.all(point <= high) for low, high in boxes)


@pytest.mark.parametrize("yaw_rad", [0.0, 0.4, 1.2])
def test_a_filled_rectangle_is_one_part(yaw_rad):
    assert len(standing_parts(filled(0.5, 0.2, yaw_rad=yaw_rad))) == 1


def test_two_walls_at_a_corner_leave_the_space_between_them_free():
    parts = standing_parts(np.concatenate([filled(0.7, 0.03), filled(0.03, 0.45)]))
    assert not inside_any(parts, [0.3, 0.2])
    assert inside_any(parts, [0.6, 0.01])
    assert inside_any(parts, [0.01, 0.4])


def test_all_points_are_kept():
    walls = np.concatenate([filled(0.7, 0.03), filled(0.03, 0.45)])
    assert sum(map(len, standing_parts(walls))) == len(walls)


def test_a_small_object_is_one_part_even_if_little_of_it_is_seen():
    assert len(standing_parts(np.concatenate([filled(0.1, 0.005), filled(0.005, 0.1)]))) == 1
