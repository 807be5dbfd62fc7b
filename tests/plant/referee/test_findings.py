"""The referee judges whom the robot met by the recorded paths, and what its pictures show."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from executive.words.goal import GoalCondition, GoalKind, Region, When
from plant.referee.judge import judge
from plant.referee.object_history import PATH_STEP_M, TakenPicture, TimedPath, Truth, extend_path
from skills.robot import Intrinsics
from tests.plant.referee.paths import finding, path, walked

OFFICE = Region("office", ((8.0, -2.0), (12.0, -2.0), (12.0, 2.0), (8.0, 2.0)))
HALL = Region("hall", ((-2.0, -2.0), (4.0, -2.0), (4.0, 2.0), (-2.0, 2.0)))


def test_a_robot_beside_the_person_has_met_them_where_they_were_then():
    met = GoalCondition(GoalKind.MET, person="Robin", began_s=0.0, ended_s=10.0)
    robin = path((5.0, 0.0, 0.0), (20.0, 0.0, 40.0))
    assert finding(met, walked(0.0, 3.5), Robin=robin).success
    assert not finding(met, walked(0.0, 2.5), Robin=robin).success
    assert "no person" in finding(met, walked(0.0, 3.5), Kim=robin).why


def test_a_long_path_keeps_its_ends_and_its_memory():
    points = []
    for number in range(400):
        extend_path(points, np.array([number * 2.0 * PATH_STEP_M, 0.0, 0.0]), float(number), most=100)
    kept = TimedPath(np.array(points))
    assert len(points) <= 100 and kept.position_at(399.0)[0] == pytest.approx(399 * 2.0 * PATH_STEP_M)
    assert kept.position_at(350.0)[0] == pytest.approx(350 * 2.0 * PATH_STEP_M, abs=0.2)


EAST = RotationMatrix(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]))
"""Rotation of a level camera that looks along x."""
LENS = Intrinsics(64, 48, 55.0, 55.0, 31.5, 23.5)


def taken(at=(0.0, 0.0, 1.0), depth_m=2.0, time_s=10.0):
    depth = np.full((LENS.height, LENS.width), depth_m)
    return TakenPicture("alice", time_s, RigidTransform(EAST, at), LENS, depth)


def pictured(*pictures, **wanted):
    """Verdict on pictures of a step from 5 to 20 s."""
    condition = GoalCondition(
        GoalKind.PICTURED, robot="alice", when=When.SOME_TIME, began_s=5.0, ended_s=20.0, **wanted
    )
    return judge([condition], Truth(60.0, (), {}, {}, {}, pictures=pictures), collisions=())


def spot(x, y, z, name="gauge"):
    corners = ((x - 0.05, y - 0.05), (x + 0.05, y - 0.05), (x + 0.05, y + 0.05), (x - 0.05, y + 0.05))
    return Region(name, corners, z - 0.05, z + 0.05)


@pytest.mark.parametrize(
    ("picture", "goal", "success"),
    [
        (taken(), spot(2.0, 0.0, 1.0), True),
        (taken(), spot(2.0, 1.0, 0.3), True),
        (taken(), spot(2.0, 1.3, 1.0), False),
        (taken(), spot(-2.0, 0.0, 1.0), False),
        (taken(depth_m=1.0), spot(2.0, 0.0, 1.0), False),
        (taken(depth_m=0.0), spot(2.0, 0.0, 1.0), True),
        (taken(depth_m=np.inf), spot(2.0, 0.0, 1.0), True),
        (taken(time_s=25.0), spot(2.0, 0.0, 1.0), False),
        (replace(taken(), robot="bob"), spot(2.0, 0.0, 1.0), False),
    ],
    ids=[
        "ahead",
        "in a corner",
        "beside",
        "behind",
        "hidden",
        "of unknown depth",
        "far",
        "after the step",
        "of another robot",
    ],
)
def test_a_picture_shows_a_point_that_is_in_view_and_not_hidden(picture, goal, success):
    assert pictured(picture, goal=(goal,)).success is success


def test_a_picture_from_a_place_need_only_have_it_in_the_field_of_view():
    hidden = taken(depth_m=1.0)
    assert pictured(hidden, goal=(spot(2.0, 0.0, 1.0),), source=(HALL,)).success
    assert not pictured(hidden, goal=(spot(2.0, 0.0, 1.0),), source=(OFFICE,)).success


def test_four_pictures_of_a_room_are_taken_in_it():
    four = [taken(time_s=t) for t in (6.0, 8.0, 10.0, 12.0)]
    found = pictured(*four, source=(HALL,), count=4)
    assert (found.success, found.why) == (True, "4 of 4 pictures show the hall.")
    assert not pictured(*four[1:], taken(at=(9.0, 0.0, 1.0)), source=(HALL,), count=4).success


def test_a_picture_of_coarse_depth_shows_the_same():
    lens = Intrinsics(640, 480, 552.0, 552.0, 320.0, 240.0)
    depth = np.full((480, 640), 3.0)
    depth[:, :320] = 1.0
    fine = TakenPicture("alice", 0.0, RigidTransform(EAST, (0.0, 0.0, 1.0)), lens, depth)
    coarse = replace(fine, depth_m=depth[::10, ::10], step=10)
    for y in (-1.0, -0.5, -0.2, 0.2, 0.5, 1.0):
        assert coarse.shows(np.array([2.5, y, 1.0])) is fine.shows(np.array([2.5, y, 1.0])) is (y < 0.0)
