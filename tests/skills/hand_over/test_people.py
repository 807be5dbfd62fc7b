"""Persons in analytic LiDAR scans."""

import pytest
from analytic_scan import scan_of

from skills.hand_over.people import people_in_scan


def test_a_person_is_found_where_they_stand():
    (person,) = people_in_scan(scan_of([(1.8, 0.4, 0.2)]))
    assert (person.x_m, person.y_m) == pytest.approx((1.8, 0.4), abs=0.12)


def test_the_nearest_of_two_comes_first():
    people = people_in_scan(scan_of([(2.6, -1.0, 0.2), (1.6, 0.8, 0.2)]))
    assert [round(person.y_m, 1) > 0 for person in people] == [True, False]


def test_a_person_before_a_wall_stands_alone_still():
    people = people_in_scan(scan_of([(1.6, 0.0, 0.2)], wall_x=2.6))
    assert len(people) == 1


def test_a_wall_is_nobody():
    assert people_in_scan(scan_of(wall_x=2.0)) == []


def test_a_thin_post_is_nobody():
    assert people_in_scan(scan_of([(1.5, 0.0, 0.03)])) == []


def test_somebody_leaning_on_a_wall_is_not_told_from_it():
    assert people_in_scan(scan_of([(2.4, 0.0, 0.2)], wall_x=2.5)) == []


def test_somebody_far_away_does_not_count():
    assert people_in_scan(scan_of([(5.0, 0.0, 0.2)])) == []


def test_what_the_robot_holds_before_itself_is_nobody():
    assert people_in_scan(scan_of([(0.55, 0.0, 0.1)])) == []
