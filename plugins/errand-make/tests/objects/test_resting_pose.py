"""Tests of the feet on which an imported body rests."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from errand_make.objects.resting_pose import feet, resting_rotation


def _hammer():
    """Head and round handle, which touches the plane below the head with its far end only."""
    head = np.stack(np.meshgrid([-0.17, -0.13], [-0.06, 0.06], [-0.016, 0.016]), -1).reshape(-1, 3)
    angle = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    ring = np.column_stack([np.zeros(8), 0.016 * np.sin(angle), -0.016 * np.cos(angle)])
    return head, np.concatenate([ring + [-0.13, 0.0, 0.004], ring + [0.17, 0.0, 0.0]])


def test_feet_of_a_hammer_are_within_its_head_and_handle_and_not_between_them():
    parts = _hammer()
    found = feet(np.concatenate(parts), np.array([-0.1, 0.0, 0.0]), parts)
    walls = [ConvexHull(part).equations for part in parts]
    out_m = [min(float(np.max(wall @ [*foot.p, 1.0])) for wall in walls) + foot.radius for foot in found]
    below = [foot.p[0] for foot in found if abs(foot.p[2] - foot.radius + 0.016) < 1e-6]
    assert min(below) < -0.13
    assert max(below) > 0.15  # the end of the handle bears it, too
    assert max(out_m) < 0.002


def _prism(radius_m, length_m, tip_m):
    """Corners of an upright hexagonal prism with a pointed end, and its middle."""
    angle = np.linspace(0.0, 2.0 * np.pi, 6, endpoint=False)
    ring = radius_m * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(6)])
    points = np.concatenate([ring, ring + [0.0, 0.0, length_m - tip_m], [[0.0, 0.0, length_m]]])
    return points, np.array([0.0, 0.0, (length_m - tip_m) / 2.0])


UP, DOWN = np.eye(3), np.diag([1.0, -1.0, -1.0])


#   radius, length, length of the tip (m)              what it is; a tip below never stands
@pytest.mark.parametrize(
    ("form", "lies", "turns"),
    [
        ((0.0035, 0.18, 0.02), True, [UP]),  # a pencil
        ((0.005, 0.18, 0.02), True, [UP]),  # a thick one
        ((0.006, 0.15, 0.0), True, [UP, DOWN]),  # a piece of chalk
        ((0.0125, 1.2, 0.0), True, [UP, DOWN]),  # a broomstick
        ((0.03, 0.2, 0.02), False, [UP]),  # a bottle
        ((0.01, 0.09, 0.0), False, [UP, DOWN]),  # a lipstick
    ],
)
def test_slender_bodies_lie_and_others_keep_standing(form, lies, turns):
    points, com = _prism(*form)
    for turn in turns:
        body, middle = points @ turn.T, turn @ com
        size_m = np.ptp(body @ resting_rotation(body, middle).T, axis=0)
        assert bool(size_m[2] < 0.5 * size_m.max()) is lies
