"""Paths of people around obstacles."""

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely

from plant.people.ground import LEAST_M, SHOULDERS_M, Ground
from plant.worlds.world import WorldError

A, B = (0.0, 0.0), (4.0, 0.0)
WALL = [np.array(corners, dtype=float) for corners in ([(1.9, -3), (2.1, -3), (2.1, 1), (1.9, 1)],)]


def clearance_m(path, outlines):
    line = shapely.LineString(path)
    return min(line.distance(shapely.Polygon(outline)) for outline in outlines)


def test_a_free_path_is_straight():
    assert Ground([WALL[0] + (0.0, 9.0)], (A, B)).plan_path(A, B, who="Kim") == (A, B)


def test_a_path_leads_around_a_wall_with_clearance_for_the_shoulders():
    path = Ground(WALL, (A, B)).plan_path(A, B, who="Kim")
    assert path[0] == A and path[-1] == B and clearance_m(path, WALL) > SHOULDERS_M - 0.06
    assert sum(map(math.dist, path, path[1:])) < 5.2 and len(path) < 9


def test_a_path_leads_through_a_door_of_75_centimetres():
    beyond = np.array([(1.9, 1.75), (2.1, 1.75), (2.1, 9), (1.9, 9)])
    below = np.array([(1.9, -9), (2.1, -9), (2.1, 1), (1.9, 1)])
    path = Ground([below, beyond], (A, B)).plan_path(A, B, who="Kim")
    assert any(a[0] < 2.0 <= b[0] and 1.2 < (a[1] + b[1]) / 2 < 1.5 for a, b in pairwise(path))


def test_a_waypoint_may_be_near_a_table_but_not_in_it():
    ground, near = Ground(WALL, (A, B)), (1.9 - LEAST_M - 0.05, 0.0)
    assert ground.plan_path(A, near, who="Kim")[-1] == near
    with pytest.raises(WorldError, match=r"Kim cannot stand at \(2, 0\)"):
        ground.plan_path(A, (2.0, 0.0), who="Kim")


def test_a_missing_path_is_reported_with_both_ends():
    sides = ((3, -1, 5, -0.8), (3, 0.8, 5, 1), (3, -1, 3.2, 1), (4.8, -1, 5, 1))
    box = [np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], dtype=float) for x0, y0, x1, y1 in sides]
    with pytest.raises(WorldError, match=r"Kim finds no path from \(0, 0\) to \(4, 0\)"):
        Ground(box, (A, B)).plan_path(A, B, who="Kim")


def test_a_person_close_to_a_wall_steps_away_first():
    ground, close = Ground(WALL, (A, B)), (1.8, 0.0)
    with pytest.raises(WorldError, match="Kim cannot stand"):
        ground.plan_path(close, A, who="Kim")
    path = ground.plan_on(close, A, who="Kim")
    assert path[0] == close and path[-1] == A and clearance_m(path[1:], WALL) > SHOULDERS_M - 0.06


def test_free_points_are_drawn_for_a_person_who_is_hemmed_in():
    points = list(Ground(WALL, (A, B)).free_points((1.67, 0.0), 1.0, 0.5, np.random.default_rng(3), 20))
    assert len(points) > 10 and all(math.dist(point, (1.67, 0.0)) >= 1.0 for point in points)
    assert all(shapely.Point(point).distance(shapely.Polygon(WALL[0])) > 0.4 for point in points)
