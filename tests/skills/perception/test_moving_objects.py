import math

import numpy as np
import pytest

from skills.perception.moving_objects import MovingOptions, MovingWatch, clusters

SCAN_S = 0.1


def side_of(x, y, *, seen_from=(0.0, 0.0), radius_m=0.2, noise_m=0.02, rng=None):
    """Returns on the visible side of an upright cylinder."""
    rng = rng or np.random.default_rng(0)
    turn = math.atan2(seen_from[1] - y, seen_from[0] - x) + np.linspace(-1.4, 1.4, 40)
    points = np.column_stack([x + radius_m * np.cos(turn), y + radius_m * np.sin(turn)])
    return points + rng.normal(scale=noise_m, size=points.shape)


def watch(place, scans=12, seen_from=lambda time_s: (0.0, 0.0), **options):
    watched, rng = MovingWatch(MovingOptions()), np.random.default_rng(1)
    told = []
    for n in range(scans):
        time_s = n * SCAN_S
        told.append(watched.update(time_s, side_of(*place(time_s), seen_from=seen_from(time_s), rng=rng, **options)))
    return told


@pytest.mark.parametrize("speed", [0.6, 1.2, 2.0])
def test_a_walking_person_has_speed_and_direction_within_three_scans(speed):
    told = watch(lambda time_s: (2.0, -1.0 + speed * time_s))
    assert told[3] and told[-1]
    vx, vy = told[-1][0].velocity_W
    assert vy == pytest.approx(speed, abs=0.35) and abs(vx) < 0.3


def test_a_standing_person_does_not_move():
    assert not any(watch(lambda time_s: (2.0, 0.5), scans=40))


def test_a_standing_person_does_not_move_as_the_robot_drives_by():
    told = watch(lambda time_s: (2.0, 0.8), scans=40, seen_from=lambda time_s: (1.0 * time_s, 0.0), radius_m=0.3)
    assert not any(told)


def test_a_person_who_stops_does_not_move():
    told = watch(lambda time_s: (2.0, min(0.0, -1.0 + 1.2 * time_s)), scans=20)
    assert told[6] and not told[-1]


def test_a_wall_that_appears_bit_by_bit_does_not_move():
    watched, rng = MovingWatch(), np.random.default_rng(2)
    for n in range(20):
        x = np.linspace(0.0, 0.2 + 0.1 * n, 40)
        told = watched.update(n * SCAN_S, np.column_stack([x, np.full(40, 2.0)]) + rng.normal(scale=0.02, size=(40, 2)))
        assert not told


def test_the_same_scan_again_changes_nothing():
    watched = MovingWatch()
    for n in range(5):
        told = watched.update(n * SCAN_S, side_of(2.0, 0.12 * n))
    assert told and watched.update(4 * SCAN_S, side_of(9.0, 9.0)) == told


def test_a_moving_object_is_predicted_at_constant_velocity():
    (one,) = watch(lambda time_s: (2.0, 1.0 * time_s))[-1]
    ahead = one.places_W(np.array([0.0, 1.0]), one.stamp_s + 0.5)
    assert ahead[1] - ahead[0] == pytest.approx(one.velocity_W)
    assert ahead[0] == pytest.approx(np.array(one.place_W) + 0.5 * np.array(one.velocity_W))


def test_clusters_are_separated_and_small_and_wide_ones_left_out():
    rng = np.random.default_rng(3)
    wall = np.column_stack([np.linspace(0.0, 3.0, 200), np.full(200, 5.0)])
    points = np.concatenate([side_of(1.0, 1.0, rng=rng), side_of(2.0, 1.0, rng=rng), wall, [[8.0, 8.0]]])
    found = clusters(points, MovingOptions())
    assert sorted(round(float(each[:, 0].mean())) for each in found) == [1, 2]
    assert clusters(np.empty((0, 2)), MovingOptions()) == []
