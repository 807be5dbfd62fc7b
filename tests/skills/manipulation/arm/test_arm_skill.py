"""Tests of what all skills of the arm share."""

import math

import pytest

from plant.robots.fetch.kind import FETCH
from plant.robots.robot_kind import robot_kind
from plant.robots.spot.kind import SPOT
from skills.manipulation.place.skill import Place
from skills.testing.robot import BASE_ONLY


@pytest.mark.parametrize("kind", ["spot", "fetch"])
def test_both_kinds_reach_the_floor_and_a_counter_but_not_the_ceiling(kind):
    low_m, high_m = Place.reached_heights_m(robot_kind(kind).capabilities())
    assert low_m < 0.02
    assert 0.9 < high_m < 2.2


def test_a_torso_on_a_lift_reaches_higher_than_legs():
    fetch, spot = (Place.reached_heights_m(each.capabilities()) for each in (FETCH, SPOT))
    assert fetch[1] > spot[1] + 0.2


def test_without_an_arm_no_height_is_said():
    assert Place.reached_heights_m(BASE_ONLY) == (-math.inf, math.inf)
