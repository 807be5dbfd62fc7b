"""People in analytic LiDAR scans, and the cameras that look for them."""

import math

import numpy as np
import pytest
from analytic_scan import scan_of
from planar_robot import Bench
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from skills.perception.people import STOWED_AHEAD_M, cameras_towards, people_in_scan, pictures_with_depth
from skills.robot import CameraCapabilities, NoImageError, Pose2D, Scan

OUTLINE = ((0.56, 0.25), (0.56, -0.25), (-0.5, -0.25), (-0.5, 0.25))


def people_seen(scan, X_WB=None):
    return people_in_scan(scan, X_WB or RigidTransform(), OUTLINE)


def test_the_nearest_of_two_comes_first():
    people = people_seen(scan_of([(2.6, -1.0, 0.2), (1.6, 0.8, 0.2)]))
    assert [round(person.place_W[1], 1) > 0 for person in people] == [True, False]


def test_a_person_in_front_of_a_wall_is_found():
    assert len(people_seen(scan_of([(1.6, 0.0, 0.2)], wall_x=2.6))) == 1


@pytest.mark.parametrize(
    ("discs", "wall_x"),
    [
        ([], 2.0),
        ([(1.5, 0.0, 0.03)], None),
        ([(2.4, 0.0, 0.2)], 2.5),
        ([(5.0, 0.0, 0.2)], None),
        ([(0.55, 0.0, 0.1)], None),
    ],
    ids=["a wall", "a thin post", "a person who leans on a wall", "a person far away", "the held object"],
)
def test_a_scan_without_people_has_none(discs, wall_x):
    assert people_seen(scan_of(discs, wall_x=wall_x)) == []


@pytest.mark.parametrize(
    ("discs", "X_WB", "place_W", "distance_m"),
    [
        ([(1.8, 0.4, 0.2)], None, (1.8, 0.4), 1.84),
        ([(1.8, 0.0, 0.2)], Pose2D(5.0, 2.0, 1.5708).transform(), (5.0, 3.8), 1.8),
    ],
)
def test_a_person_is_found_at_their_position_in_the_world(discs, X_WB, place_W, distance_m):
    (person,) = people_seen(scan_of(discs), X_WB)
    assert person.place_W == pytest.approx(place_W, abs=0.12)
    assert person.distance_m == pytest.approx(distance_m, abs=0.12)


class SurveyedWall:
    """Survey that explains a wall at x_m and all behind it."""

    def __init__(self, x_m):
        self.x_m = x_m

    def is_unexplained(self, points_W):
        return points_W[:, 0] < self.x_m - 0.15


def people_before_wall(discs, x_m=3.0, **more):
    scan = scan_of(discs, wall_x=x_m, **more)
    return people_in_scan(scan, RigidTransform([0.0, 0.0, 0.52]), OUTLINE, 6.0, SurveyedWall(x_m))


def test_a_person_close_to_a_surveyed_wall_is_found():
    (person,) = people_before_wall([(2.55, 0.0, 0.2)])
    assert person.place_W == pytest.approx((2.55, 0.0), abs=0.12)


def test_two_people_side_by_side_are_two_people_where_a_survey_explains_the_walls():
    assert len(people_before_wall([(1.8, 0.35, 0.2), (1.8, -0.35, 0.2)])) == 2


def test_a_surveyed_wall_and_an_unmapped_post_are_no_people():
    assert people_before_wall([]) == []
    assert people_before_wall([(1.5, 0.0, 0.04)]) == []


def test_a_person_just_before_a_stowed_arm_is_where_they_stand():
    # the robot ends at x = 0.5; the person's near side is 0.13 m ahead
    scan = scan_of([(0.83, 0.0, 0.2)], wall_x=3.0)
    X_WB, survey = RigidTransform([0.0, 0.0, 0.52]), SurveyedWall(3.0)
    (person,) = people_in_scan(scan, X_WB, OUTLINE, 6.0, survey, ahead_m=STOWED_AHEAD_M)
    assert person.place_W == pytest.approx((0.83, 0.0), abs=0.12)


def test_a_pair_of_legs_is_a_person_for_a_lidar_of_one_ring():
    angles = np.linspace(-0.5, 0.5, 200)
    x, y = 1.5 * np.ones(200), 1.5 * np.tan(angles)
    legs = np.abs(np.abs(y) - 0.12) < 0.06
    ranges = np.where(legs, np.hypot(x, y), np.nan).astype(np.float32)[None, :]
    scan = Scan(0.0, ranges, np.zeros(1), angles, RigidTransform([0.0, 0.0, 0.3]), RigidTransform())
    (person,) = people_in_scan(scan, RigidTransform(), ((0.3, 0.3), (-0.3, -0.3)))
    assert person.place_W == pytest.approx((1.6, 0.0), abs=0.05)


def looking(heading_rad):
    """Level camera with a heading to the left of ahead."""
    ahead = RotationMatrix(RollPitchYaw(-math.pi / 2, 0.0, -math.pi / 2))
    return RigidTransform(RotationMatrix.MakeZRotation(heading_rad) @ ahead)


HEADINGS_RAD = {"frontleft": -0.58, "frontright": 0.58, "left": 1.57, "right": -1.57, "back": 3.14}
BODY = tuple(CameraCapabilities(name, looking(heading)) for name, heading in HEADINGS_RAD.items())


@pytest.mark.parametrize(
    ("velocity", "expected"),
    [
        ((0.0, 0.0, 0.0), ("frontleft", "frontright")),
        ((0.5, 0.1, 0.0), ("frontleft", "frontright")),
        ((0.0, 0.0, 0.9), ("frontleft", "frontright")),
        ((-0.3, 0.1, 0.0), ("back",)),
        ((0.1, 0.3, 0.0), ("left",)),
        ((-0.1, -0.3, 0.0), ("right",)),
    ],
)
def test_cameras_face_the_direction_of_motion(velocity, expected):
    assert tuple(camera.source for camera in cameras_towards(np.array(velocity), BODY)) == expected


def test_missing_cameras_are_not_used():
    assert cameras_towards(np.array([-0.3, 0.0, 0.0]), BODY[:1]) == ()


def test_each_camera_without_a_useful_picture_is_named():
    bench = Bench(Pose2D(1.5, 2.0, 0.0))

    class Spoiled:
        def image(self, source):
            if source == "frontleft":
                raise NoImageError("the camera 'frontleft' gives no picture")
            return bench.robot.image(source)

    images, faults = pictures_with_depth(Spoiled(), bench.clock, bench.robot.capabilities().body_cameras)
    assert [image.source for image in images] == ["frontright"]
    assert faults == ["the camera 'frontleft' gives no picture"]
