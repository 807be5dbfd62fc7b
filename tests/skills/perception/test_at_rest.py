"""Whether depth pictures that were taken one after the other show an object at rest."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from table_scene import BLUE, RED, Can, scene

from skills.perception.at_rest import at_rest

AT_W = np.array([1.0, 0.0, 0.80])


def _can(x, y=0.0, colour=RED):
    return Can(x, y, 0.033, 0.115, colour)


def _rests(first, second):
    before, after = scene(first, noise_m=0.001), scene(second, noise_m=0.002)
    return at_rest(before, after, RigidTransform(), AT_W, 0.25)


def test_noise_alone_does_not_move_an_object():
    assert _rests([_can(1.0)], [_can(1.0)])


@pytest.mark.parametrize("moved_m", [(0.02, 0.0), (0.0, 0.02), (0.3, 0.3)])
def test_an_object_that_has_moved_is_not_at_rest(moved_m):
    assert not _rests([_can(1.0)], [_can(1.0 + moved_m[0], moved_m[1])])


def test_an_object_that_is_gone_is_not_at_rest():
    assert not _rests([_can(1.0)], [])


def test_what_moves_farther_away_does_not_count():
    assert _rests([_can(1.0), _can(1.0, 0.4, BLUE)], [_can(1.0), _can(1.0, 0.5, BLUE)])
