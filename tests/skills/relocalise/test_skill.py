"""Tests of the free space of a drive, by a scan alone."""

import math

import numpy as np
import pytest
from analytic_scan import scan_of

from skills.relocalise.skill import FreeSpaceOptions, can_turn, free_m, obstacles_B
from skills.testing.robot import BASE_ONLY as BODY

OPTIONS = FreeSpaceOptions(side_m=0.15, ahead_m=0.3)


def test_ahead_is_free_up_to_the_wall_less_the_body_and_the_margin():
    seen = obstacles_B(scan_of(wall_x=3.0), BODY, OPTIONS)
    assert free_m(seen, 0.0, BODY, OPTIONS) == pytest.approx(3.0 - 0.55 - 0.3, abs=0.02)
    assert free_m(seen, math.pi, BODY, OPTIONS) == 5.0


def test_only_obstacles_ahead_of_the_body_count():
    post = np.array([[2.0, 0.5]])
    assert free_m(post, 0.0, BODY, OPTIONS) == 5.0
    assert free_m(post, math.atan2(0.5, 2.0), BODY, OPTIONS) == pytest.approx(math.hypot(2.0, 0.5) - 0.85)


def test_the_floor_and_the_body_are_no_obstacles():
    assert len(obstacles_B(scan_of(), BODY, OPTIONS)) == 0
    assert len(obstacles_B(scan_of(discs=[(0.3, 0.0, 0.05)]), BODY, OPTIONS)) == 0


@pytest.mark.parametrize(("x", "free"), [(0.7, True), (0.6, False)])
def test_it_can_turn_where_its_corners_are_free(x, free):
    assert can_turn(np.array([[x, 0.0]]), BODY, OPTIONS) is free
