"""Which camera takes a picture, and what is published with it."""

from dataclasses import replace

import pytest

from executive.testing.skill_test import PoseSetup, RobotSetup, WorldSetup, bench_of_setup
from plant.robots.spot.kind import SPOT
from skills.api import PICTURES, Cause
from skills.small.take_picture import TakePicture, TakePictureInputs

SPOT_CAPABILITIES = SPOT.capabilities()
BLIND = replace(SPOT_CAPABILITIES, cameras=SPOT_CAPABILITIES.body_cameras)
"""Spot with the cameras of its body alone."""


def picture_of(point_W, camera="", capabilities=SPOT_CAPABILITIES):
    """Result of the skill, and the published pictures."""
    bench, _ = bench_of_setup(capabilities, RobotSetup(pose=PoseSetup(x=0.45)), WorldSetup())
    run = bench.run(TakePicture, TakePictureInputs("the thing", point_W, camera=camera))
    return run, [message for topic, message in bench.published if topic == PICTURES]


def test_a_picture_is_published_with_the_pose_of_its_camera():
    run, (message,) = picture_of((1.4, 0.0, 0.75))
    (x, _, z), stamp_s = message["pose"]["position_W"], message["stamp_s"]
    assert (run.outcome, message["of"], message["camera"]) == ("success", "the thing", "hand")
    assert (0.6 < x < 1.3, z > 0.9, 0.0 < stamp_s <= run.time_s) == (True, True, True)
    assert message["image"].ndim == 3


@pytest.mark.parametrize(
    ("point_W", "named", "camera"),
    [
        ((1.4, 0.2, 0.2), "Front Right", "frontright"),
        ((-2.0, 0.0, 0.5), "", "back"),
        ((0.3, 2.0, 0.5), "", "left"),
        ((1.2, -0.2, 0.1), "", "frontleft"),
    ],
)
def test_a_camera_of_the_body_takes_the_picture_where_it_is_named_or_sees_it_alone(point_W, named, camera):
    run, pictures = picture_of(point_W, named, BLIND)
    assert (run.message, [each["camera"] for each in pictures]) == (run.message, [camera])


def test_without_a_camera_that_sees_it_there_is_no_picture():
    run, pictures = picture_of((0.45, 0.0, 4.0), capabilities=BLIND)
    assert (run.cause, pictures) == (Cause.PLANNING, [])
