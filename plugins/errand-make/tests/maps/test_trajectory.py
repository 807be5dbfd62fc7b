import math

import numpy as np
import pytest

from errand_make.maps.trajectory import align, trajectory_error_m
from skills.geometry import compose
from skills.robot import Pose2D

TRUE = [Pose2D(math.cos(t), 2.0 * math.sin(t), t) for t in np.linspace(0.0, 6.0, 50).tolist()]


def test_a_shifted_and_turned_trajectory_has_no_error():
    moved = [compose(Pose2D(3.0, -1.0, 0.7), pose) for pose in TRUE]
    assert trajectory_error_m(moved, TRUE) == pytest.approx(0.0, abs=1e-9)


def test_the_error_is_the_root_mean_square():
    off = [Pose2D(pose.x_m, pose.y_m + (0.1 if n % 2 else -0.1), 0.0) for n, pose in enumerate(TRUE)]
    assert trajectory_error_m(off, TRUE) == pytest.approx(0.1, abs=0.005)


def test_points_move_with_the_trajectory():
    moved = [compose(Pose2D(3.0, -1.0, 0.7), pose) for pose in TRUE]
    points = np.array([(pose.x_m, pose.y_m) for pose in moved])
    assert align(points, moved, TRUE) == pytest.approx(np.array([(pose.x_m, pose.y_m) for pose in TRUE]))
