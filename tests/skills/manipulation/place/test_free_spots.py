"""Tests of free spots on a seen surface."""

import numpy as np
import pytest

from skills.api import Surface
from skills.manipulation.place.placement import (
    CLEARANCE_M,
    EDGE_M,
    clear_spots,
    clearest_first,
    free_spots,
    spaced_spots,
    spots,
    unseen_view,
)
from skills.perception.fitting import LevelPlane, SeenShape
from skills.perception.point_cloud import PointCloud
from skills.perception.surface_segmentation import Cluster, SurfaceView

TABLE = Surface("table", ((1.0, -0.5), (1.6, -0.5), (1.6, 0.5), (1.0, 0.5)), 0.7)
PLANE = LevelPlane((1.3, 0.0), 0.7, (0.0, 0.0), 0.002)


def _cloud(xy, z=0.7):
    points = np.column_stack([xy, np.full(len(xy), z)])
    return PointCloud(points, np.zeros((len(xy), 2), np.int64), np.zeros((len(xy), 3), np.uint8))


def _view(seen_y=(-0.5, 0.5), things=()):
    grid = np.stack(np.meshgrid(np.arange(1.0, 1.6, 0.01), np.arange(*seen_y, 0.01)), -1).reshape(-1, 2)
    clusters = tuple(
        Cluster(
            _cloud(np.array([thing]), 0.8), "table", PLANE, SeenShape(thing, 0.07, 0.07, 0.1, 0.0, True), (0, 0, 1, 1)
        )
        for thing in things
    )
    return SurfaceView(PLANE, _cloud(grid), clusters)


def test_spots_keep_off_the_edges():
    found = spots(TABLE)
    assert found[:, 0].min() == pytest.approx(1.0 + EDGE_M)  # no nearer to the robot than need be
    assert found[:, 0].max() <= 1.6 - EDGE_M + 1e-9


def test_spots_within_a_forbidden_circle_are_left_out():
    found = clear_spots(spots(TABLE), [(1.3, 0.0, 0.25), (1.1, -0.4, 0.1)])
    assert 0 < len(found) < len(spots(TABLE))
    assert np.linalg.norm(found - [1.3, 0.0], axis=1).min() > 0.25
    assert np.linalg.norm(found - [1.1, -0.4], axis=1).min() > 0.1


def test_a_small_surface_has_its_middle_as_spot():
    small = Surface("stool", ((0.0, 0.0), (0.12, 0.0), (0.12, 0.12), (0.0, 0.12)), 0.4)
    assert spots(small) == pytest.approx(np.array([[0.06, 0.06]]))


def test_spots_near_an_object_are_not_free():
    free = free_spots(_view(things=((1.3, 0.0),)), spots(TABLE))
    assert len(free) > 0
    assert np.linalg.norm(free - [1.3, 0.0], axis=1).min() > CLEARANCE_M


def test_an_unseen_spot_is_not_free():
    free = free_spots(_view(seen_y=(0.0, 0.5)), spots(TABLE))
    assert free[:, 1].min() > -0.04


def test_a_full_table_has_no_free_spot():
    things = tuple((x, y) for x in np.arange(1.05, 1.6, 0.1) for y in np.arange(-0.45, 0.5, 0.1))
    assert len(free_spots(_view(things=things), spots(TABLE))) == 0


def test_the_spot_with_the_most_clearance_comes_first_and_none_near_an_earlier_one():
    free = np.array([[1.2, -0.4], [1.2, 0.0], [1.2, 0.4]])
    view = _view(things=[(1.4, -0.4)])
    assert clearest_first(free, view, [])[-1] == pytest.approx(free[0])
    assert clearest_first(free, view, [free[2]])[0] == pytest.approx(free[1])
    assert len(clearest_first(free[:1], view, [free[0]])) == 0


def test_a_hidden_surface_is_free_except_near_known_objects():
    standing = np.array([[1.3, 0.0, 0.78]])
    free = free_spots(unseen_view(TABLE, standing), spots(TABLE))
    assert 0 < len(free) < len(spots(TABLE))
    assert np.linalg.norm(free - [1.3, 0.0], axis=1).min() > CLEARANCE_M - 0.04
    assert len(free_spots(unseen_view(TABLE, np.empty((0, 3))), spots(TABLE))) == len(spots(TABLE))


def test_spaced_spots_keep_their_order_and_distance():
    free = np.array([[0.0, 0.0], [0.1, 0.0], [0.3, 0.0], [0.4, 0.0], [0.0, 0.25]])
    assert np.array_equal(spaced_spots(free), free[[0, 2, 4]])
