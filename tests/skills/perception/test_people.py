"""People in analytic LiDAR scans."""

import numpy as np
import pytest
from analytic_scan import scan_of
from pydrake.math import RigidTransform

from skills.perception.people import people_in_scan
from skills.robot import Pose2D, Scan

OUTLINE = ((0.56, 0.25), (0.56, -0.25), (-0.5, -0.25), (-0.5, 0.25))


def people_seen(scan, X_WB=None):
    return people_in_scan(scan, X_WB or RigidTransform(), OUTLINE)


def test_a_person_is_found_at_their_position():
    (person,) = people_seen(scan_of([(1.8, 0.4, 0.2)]))
    assert person.place_W == pytest.approx((1.8, 0.4), abs=0.12)


def test_the_nearest_of_two_comes_first():
    people = people_seen(scan_of([(2.6, -1.0, 0.2), (1.6, 0.8, 0.2)]))
    assert [round(person.place_W[1], 1) > 0 for person in people] == [True, False]


def test_a_person_in_front_of_a_wall_is_found():
    people = people_seen(scan_of([(1.6, 0.0, 0.2)], wall_x=2.6))
    assert len(people) == 1


def test_a_wall_is_no_person():
    assert people_seen(scan_of(wall_x=2.0)) == []


def test_a_thin_post_is_no_person():
    assert people_seen(scan_of([(1.5, 0.0, 0.03)])) == []


def test_a_person_who_leans_on_a_wall_is_not_found():
    assert people_seen(scan_of([(2.4, 0.0, 0.2)], wall_x=2.5)) == []


def test_a_person_far_away_does_not_count():
    assert people_seen(scan_of([(5.0, 0.0, 0.2)])) == []


def test_the_held_object_is_no_person():
    assert people_seen(scan_of([(0.55, 0.0, 0.1)])) == []


def test_the_position_is_in_the_world_frame():
    (person,) = people_seen(scan_of([(1.8, 0.0, 0.2)]), Pose2D(5.0, 2.0, 1.5708).transform())
    assert person.place_W == pytest.approx((5.0, 3.8), abs=0.12)
    assert person.distance_m == pytest.approx(1.8, abs=0.12)


def test_a_pair_of_legs_is_a_person_for_a_lidar_of_one_ring():
    angles = np.linspace(-0.5, 0.5, 200)
    x, y = 1.5 * np.ones(200), 1.5 * np.tan(angles)
    legs = np.abs(np.abs(y) - 0.12) < 0.06
    ranges = np.where(legs, np.hypot(x, y), np.nan).astype(np.float32)[None, :]
    scan = Scan(0.0, ranges, np.zeros(1), angles, RigidTransform([0.0, 0.0, 0.3]), RigidTransform())
    (person,) = people_in_scan(scan, RigidTransform(), ((0.3, 0.3), (-0.3, -0.3)))
    assert person.place_W == pytest.approx((1.6, 0.0), abs=0.05)
