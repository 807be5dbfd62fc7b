import math

import numpy as np

from skills.estimate.grid_map import GridMap
from skills.mapping.frontiers import Ground

CELL_M = 0.05


def ground(width_m=1.0):
    """A room of 4 x 4 m, walled, with an opening to the unknown at the right; the robot in its middle."""
    occupied, unknown = np.zeros((100, 140), dtype=np.bool_), np.ones((100, 140), dtype=np.bool_)
    unknown[10:90, 10:90] = False
    occupied[8:10, 8:92] = occupied[90:92, 8:92] = occupied[8:92, 8:10] = occupied[8:92, 90:92] = True
    half = round(width_m / CELL_M / 2)
    occupied[50 - half : 50 + half, 90:92] = False
    unknown[50 - half : 50 + half, 88:100] = False
    unknown[occupied] = False
    return Ground(GridMap(occupied, CELL_M, (0.0, 0.0), unknown), ~unknown, (2.5, 2.5), clear_m=0.3)


def test_the_opening_is_the_only_frontier():
    (frontier,) = ground().frontiers(least_m=0.5, within_m=1.5)
    assert math.isclose(frontier.at[0], 4.975, abs_tol=0.1) and abs(frontier.at[1] - 2.5) < 0.6
    assert math.dist(frontier.stand, frontier.at) < 0.6
    assert 2.0 < frontier.cost_m < 6.0


def test_an_opening_shorter_than_the_least_length_is_no_frontier():
    assert ground(width_m=0.3).frontiers(least_m=1.0, within_m=1.5) == []


def test_stands_come_nearest_first_and_apart():
    stands = ground().stands_near(4.0, 4.0, most=5, apart_m=0.25)
    away = [math.dist(stand, (4.0, 4.0)) for stand in stands]
    assert away == sorted(away) and away[0] < 0.2
    assert min(math.dist(a, b) for n, a in enumerate(stands) for b in stands[:n]) >= 0.25


def test_cost_is_in_metres_and_infinite_through_walls():
    whole = ground()
    assert math.isclose(whole.cost_to(2.5, 1.5), 1.0, abs_tol=0.11)
    assert math.isinf(whole.cost_to(6.0, 4.5))
