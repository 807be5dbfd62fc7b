import math

import numpy as np

from plant.robots.spot.legs import BodyMotion, Trot, nominal_footholds

DT_S = 0.01
FOOT_RADIUS_M = 0.036


def stance(feet):
    """Flags of the feet that stand on the floor."""
    return tuple(bool(flag) for flag in np.isclose(feet[:, 2], FOOT_RADIUS_M, rtol=0.0, atol=1e-6))


def walk(trot, vx, vy, wz, seconds):
    """Positions and stance flags of the feet for every step of a body that moves as commanded."""
    x = y = yaw = 0.0
    feet, stances = [], []
    for _ in range(round(seconds / DT_S)):
        motion = BodyMotion(x, y, yaw, vx, vy, wz)
        feet.append(np.array(trot.step(motion, DT_S)))
        stances.append(stance(feet[-1]))
        x, y, yaw = motion.ahead(DT_S)
    return np.array(feet), np.array(stances), (x, y, yaw)


def new_trot():
    trot = Trot(nominal_footholds())
    trot.reset(BodyMotion(0, 0, 0, 0, 0, 0))
    return trot


def test_stance_feet_stay_exactly_where_they_are():
    feet, stances, _ = walk(new_trot(), 0.8, 0.1, 0.4, 4.0)
    both = stances[1:] & stances[:-1]
    assert np.linalg.norm(np.diff(feet, axis=0), axis=2)[both].max() == 0.0


def test_diagonal_pairs_swing_in_turn_and_two_feet_always_stand():
    _, stances, _ = walk(new_trot(), 0.6, 0.0, 0.0, 4.0)
    assert set(map(tuple, stances)) <= {(True,) * 4, (False, True, True, False), (True, False, False, True)}
    assert len(set(map(tuple, stances))) >= 2


def test_feet_stay_within_reach_of_their_places_at_top_speed():
    feet, _, (x, y, _) = walk(new_trot(), 1.6, 0.0, 0.0, 3.0)
    offsets = feet[-1][:, :2] - ([x, y] + nominal_footholds())
    assert np.abs(offsets).max() < 0.35


def test_feet_come_to_rest_under_the_body_when_it_stops():
    trot = new_trot()
    _, _, (x, y, yaw) = walk(trot, 0.8, 0.0, 0.6, 2.0)
    still = BodyMotion(x, y, yaw, 0.0, 0.0, 0.0)
    for _ in range(200):
        feet = np.array(trot.step(still, DT_S))
    c, s = math.cos(yaw), math.sin(yaw)
    places = nominal_footholds() @ np.array([[c, s], [-s, c]]) + [x, y]
    assert np.abs(feet[:, :2] - places).max() < 0.03 and stance(feet) == (True,) * 4
