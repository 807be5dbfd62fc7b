"""How a person goes along a route."""

import math

import pytest

from plant.people.walk import Leg, Walk

STEP_S = 0.0125


def walk_of(*legs, loops=False, start_s=0.0, speed_m_s=1.0):
    first = legs[0].corners_W[0] if legs else (0.0, 0.0)
    return Walk(legs, at_W=first, yaw_rad=0.0, speed_m_s=speed_m_s, start_s=start_s, loops=loops)


def after(walk, seconds):
    for _ in range(round(seconds / STEP_S)):
        walk.advance(STEP_S)
    return walk


def test_goes_at_its_speed_and_stops_at_the_end():
    walk = after(walk_of(Leg(((0.0, 0.0), (3.0, 0.0)), 0.0), speed_m_s=1.2), 1.0)
    assert walk.place_W == pytest.approx((1.2, 0.0)) and walk.walks
    assert after(walk, 5.0).place_W == (3.0, 0.0) and walk.done and not walk.walks


def test_waits_for_its_start_and_at_a_stop():
    legs = (Leg(((0.0, 0.0), (1.0, 0.0)), 2.0), Leg(((1.0, 0.0), (1.0, 1.0)), 0.0))
    walk = walk_of(*legs, start_s=1.0)
    assert after(walk, 1.0).place_W == (0.0, 0.0)
    assert after(walk, 2.5).place_W == (1.0, 0.0) and not walk.walks
    assert after(walk, 1.0).place_W[1] == pytest.approx(0.5, abs=0.05)


def test_sets_off_when_told():
    walk = walk_of(Leg(((0.0, 0.0), (3.0, 0.0)), 0.0), start_s=1000.0)
    walk.set_off()
    assert after(walk, 1.0).place_W == pytest.approx((1.0, 0.0))


def test_turns_to_where_it_goes_no_faster_than_a_person_does():
    walk = walk_of(Leg(((0.0, 0.0), (0.0, 3.0)), 0.0))
    assert after(walk, 0.1).yaw_rad == pytest.approx(0.4, abs=0.06)
    assert walk.heading_rad == pytest.approx(math.pi / 2)
    assert after(walk, 1.0).yaw_rad == pytest.approx(math.pi / 2)


def test_goes_round_and_round_on_a_loop():
    legs = (Leg(((0.0, 0.0), (1.0, 0.0)), 0.0), Leg(((1.0, 0.0), (0.0, 0.0)), 0.0))
    assert after(walk_of(*legs, loops=True), 4.5).place_W == pytest.approx((0.5, 0.0), abs=0.05)


def test_somebody_without_a_way_stands():
    assert after(walk_of(), 1.0).place_W == (0.0, 0.0)


def test_goes_on_from_a_state():
    leg = Leg(((0.0, 0.0), (1.0, 0.0), (1.0, 3.0)), 0.5)
    walk, other = after(walk_of(leg), 1.7), walk_of(leg)
    other.restore(walk.state())
    assert after(other, 0.5).state() == after(walk, 0.5).state()
