"""Detection in camera images: rotation, brightness, darkness."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from table_scene import CAMERA, COKE, TABLE, scene

from skills.detection import Detection
from skills.manipulation.arm.poses import camera_pose
from skills.perception.detector.camera_images import (
    brighten,
    detect_class_in_grey,
    detect_in_image,
    is_dark,
    is_upside_down,
    rotate_180,
    rotate_boxes_180,
    turn_upright,
)
from skills.robot import FrameTree
from skills.testing.estimators import PlainColours


def test_a_rotated_picture_begins_with_its_last_pixel():
    picture = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    assert rotate_180(picture)[0, 0].tolist() == [21, 22, 23]
    assert rotate_180(picture).flags.c_contiguous


def test_boxes_are_rotated_within_the_picture():
    # in 640 x 480: u 100 to 200 and v 50 to 80 of the turned picture
    (found,) = rotate_boxes_180([Detection("hammer", 0.9, (100.0, 50.0, 200.0, 80.0))], 640, 480)
    assert (found.class_name, found.score, found.box) == ("hammer", 0.9, (440.0, 400.0, 540.0, 430.0))


COKES = PlainColours({"coke": COKE.colour})


def rolled(roll_rad):
    """Image of the scene from a camera that is rolled about its axis."""
    X_WC = camera_pose(CAMERA, np.array([1.05, 0.0, TABLE.height_m]))
    return scene([COKE], X_WC=X_WC @ RigidTransform(RotationMatrix.MakeZRotation(roll_rad), np.zeros(3)))


class Recorder(PlainColours):
    """Detector that records its pictures."""

    def detect(self, pictures):
        self.__dict__["shown"] = list(pictures)
        return [() for _ in pictures]


@pytest.mark.parametrize(
    ("roll_deg", "turned"), [(0, False), (78, False), (-102, False), (172, True), (180, True), (-172, True)]
)
def test_a_picture_is_upside_down_when_its_camera_hangs_upside_down(roll_deg, turned):
    # Spot's cameras: left and back about 0, frontleft -78, frontright -102, right 172 degrees
    assert is_upside_down(rolled(np.radians(roll_deg))) is turned


def test_a_picture_that_looks_straight_down_is_not_rotated():
    down = RigidTransform(RotationMatrix(np.diag([1.0, -1.0, -1.0])), [1.05, 0.0, 1.6])
    assert not is_upside_down(replace(rolled(0.0), frames=FrameTree({"hand_camera": ("odom", down)})))


def test_boxes_of_a_rotated_picture_fit_the_original_picture():
    image = rolled(np.pi)
    (seen,) = detect_in_image(COKES, image)
    (plain,) = COKES.detect([image.colour])[0]
    assert seen.box == plain.box


@pytest.mark.parametrize("roll_deg", [0, 78, -102, 172])
def test_a_picture_is_turned_so_that_its_top_is_up_with_its_boxes(roll_deg):
    # whatever the roll, the box of the upright can is higher than wide, above the table, and where the can is drawn
    image = rolled(np.radians(roll_deg))
    picture, (found,) = turn_upright(image, COKES.detect([image.colour])[0])
    (again,) = COKES.detect([picture])[0]
    assert found.box == pytest.approx(again.box, abs=1.0)
    assert found.box[3] - found.box[1] > found.box[2] - found.box[0]


@pytest.mark.parametrize("roll_rad", [0.0, np.pi], ids=["upright", "on its head"])
def test_the_detector_sees_the_world_upright(roll_rad):
    detector, upright, image = Recorder(), rolled(0.0), rolled(roll_rad)
    detect_in_image(detector, image)
    (shown,) = detector.shown
    rows = np.nonzero(np.all(shown == COKE.colour, axis=2))[0]
    assert abs(rows.mean() - np.nonzero(np.all(upright.colour == COKE.colour, axis=2))[0].mean()) < 2.0
    assert np.nonzero(np.all(image.colour == COKE.colour, axis=2))[0].size == rows.size


def test_each_grey_picture_is_rotated_upright():
    detector, upright, head = Recorder(), rolled(0.0), rolled(np.pi)
    assert detect_class_in_grey(detector, [upright, head], "coke") == [(), ()]
    assert np.array_equal(detector.shown[0], upright.grey)
    assert np.array_equal(detector.shown[1], head.grey[::-1, ::-1])


def test_the_detector_sees_brightened_pictures():
    detector, image = Recorder(), rolled(0.0)
    dim = replace(image, colour=image.colour // 8)
    detect_in_image(detector, dim)
    (shown,) = detector.shown
    assert shown.mean() > 1.5 * dim.colour.mean()


def test_the_quick_search_is_used_if_the_detector_has_one():
    class Quick(Recorder):
        def detect_class(self, pictures, class_name):
            self.__dict__["asked"] = class_name
            return [() for _ in pictures]

    detector = Quick()
    assert detect_class_in_grey(detector, [rolled(0.0)], "person") == [()]
    assert (detector.asked, hasattr(detector, "shown")) == ("person", False)


@pytest.mark.parametrize(("counts", "dark"), [(0, True), (4, True), (12, False), (255, False)])
def test_a_picture_that_is_black_all_over_is_dark(counts, dark):
    image = scene([COKE])
    assert is_dark(replace(image, grey=np.full_like(image.grey, counts))) is dark


def test_a_dim_picture_with_something_in_it_is_not_dark():
    image = scene([COKE])
    grey = np.zeros_like(image.grey)
    grey[100:140, 100:160] = 60
    assert not is_dark(replace(image, grey=grey))


def test_bright_pixels_of_a_dim_picture_stay_white():
    picture = np.full((10, 10), 10, np.uint8)
    picture[0, 0] = 200
    assert brighten(picture)[0, 0] == 255


# mean -> mean as shown: left as it is, five times, and eight times at most
@pytest.mark.parametrize(("mean", "shown"), [(120, 120), (20, 100), (5, 40)])
def test_a_dim_picture_is_brightened(mean, shown):
    assert brighten(np.full((4, 4, 3), mean, np.uint8)).mean() == shown
