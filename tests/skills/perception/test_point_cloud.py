"""Coverage of surfaces, and changes between two pictures."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from table_scene import BLUE, GREY, RED, TABLE, Can, scene

from skills.api import Surface
from skills.manipulation.arm.poses import camera_pose
from skills.perception.point_cloud import Coverage, SurfaceShares, is_at_rest

AWAY = Surface("shelf", ((-3.0, -0.5), (-2.0, -0.5), (-2.0, 0.5), (-3.0, 0.5)), 0.75)


def shares(*images, surfaces=(TABLE,)):
    coverage = Coverage(surfaces)
    for image in images:
        coverage.add(image, RigidTransform())
    return coverage.shares()


def test_an_empty_table_is_seen_as_far_as_the_picture_shows_it():
    share = shares(scene([]))["table"]
    assert share.seen > 0.7
    assert share.hidden == 0.0
    assert share.out_of_view == pytest.approx(1.0 - share.seen)


def test_an_object_hides_a_part_of_its_surface():
    assert shares(scene([Can(0.9, 0.0, 0.1, 0.3, GREY)]))["table"].hidden > 0.02


def test_a_surface_elsewhere_is_out_of_view():
    assert shares(scene([]), surfaces=(TABLE, AWAY))["shelf"].out_of_view == 1.0


def test_shares_are_described_in_words():
    assert str(SurfaceShares(0.8, 0.15)) == "80 % seen, 15 % hidden, 5 % out of view"
    assert str(SurfaceShares(1.0, 0.0)) == "100 % seen"


def test_two_pictures_add_up():
    left = scene([], X_WC=camera_pose(np.array([0.5, 0.0, 1.15]), np.array([1.1, 0.5, 0.75])))
    right = scene([], X_WC=camera_pose(np.array([0.5, 0.0, 1.15]), np.array([1.1, -0.5, 0.75])))
    assert shares(left, right)["table"].seen > shares(left)["table"].seen + 0.1


def test_a_part_seen_once_stays_seen():
    assert shares(scene([]), scene([Can(0.9, 0.0, 0.1, 0.3, GREY)]))["table"] == shares(scene([]))["table"]


def test_without_depth_nothing_is_seen():
    image = scene([])
    image.depth_m[:] = np.nan
    assert shares(image)["table"] == SurfaceShares(0.0, 0.0)


def _can(x, y=0.0, colour=RED):
    return Can(x, y, 0.033, 0.115, colour)


def _rests(first, second):
    before, after = scene(first, noise_m=0.001), scene(second, noise_m=0.002)
    return is_at_rest(before, after, RigidTransform(), np.array([1.0, 0.0, 0.80]), 0.25)


def test_noise_alone_does_not_move_an_object():
    assert _rests([_can(1.0)], [_can(1.0)])


def test_an_object_that_is_gone_is_not_at_rest():
    assert not _rests([_can(1.0)], [])


def test_changes_farther_away_do_not_count():
    assert _rests([_can(1.0), _can(1.0, 0.4, BLUE)], [_can(1.0), _can(1.0, 0.5, BLUE)])


@pytest.mark.parametrize("moved_m", [(0.02, 0.0), (0.0, 0.02), (0.3, 0.3)])
def test_an_object_that_has_moved_is_not_at_rest(moved_m):
    assert not _rests([_can(1.0)], [_can(1.0 + moved_m[0], moved_m[1])])
