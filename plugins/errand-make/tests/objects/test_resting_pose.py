"""Tests of the feet on which an imported body rests."""

import numpy as np
from scipy.spatial import ConvexHull

from errand_make.objects.resting_pose import feet


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
