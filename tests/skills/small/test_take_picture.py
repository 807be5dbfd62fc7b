"""Which camera takes a picture, and what is published with it."""

from dataclasses import replace

import numpy as np
import pytest

from executive.testing.bench import SkillBench
from executive.testing.skill_test import PoseSetup, RobotSetup, WorldSetup, bench_of_setup
from plant.robots.spot.kind import SPOT
from skills.api import PICTURES, Cause
from skills.robot import Pose2D
from skills.small.take_picture import TakePicture, TakePictureInputs
from skills.testing.estimators import KnownPlace

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


class SlippedPlace(KnownPlace):
    """A localiser that notices, with the first scan after `at_s`, that odometry has jumped 1.5 m to the side."""

    def __init__(self, start, at_s):
        super().__init__(start)
        self.at_s = at_s

    def update(self, robot):
        super().update(robot)
        if self._stamp_s >= self.at_s:
            self._X_WO = Pose2D(0.0, 1.5, 0.0).transform()


def pictured_by(localiser):
    """Result of the skill with this localiser, and the published pictures."""
    bench, _ = bench_of_setup(SPOT_CAPABILITIES, RobotSetup(pose=PoseSetup(x=0.45)), WorldSetup())
    bench.robot.return_lease(bench.context().lease)
    bench = SkillBench(bench.robot, bench.clock, localiser=localiser)
    run = bench.run(TakePicture, TakePictureInputs("the thing", (1.4, 0.0, 0.75)))
    return run, [message for topic, message in bench.published if topic == PICTURES]


def test_a_robot_that_does_not_know_its_place_claims_no_picture():
    lost = KnownPlace()
    lost.localised = False
    run, pictures = pictured_by(lost)
    assert (run.cause, pictures) == (Cause.POSTCONDITION, [])
    assert "no scan confirms where the picture was taken" in run.message


def test_an_estimate_from_before_the_picture_confirms_nothing():
    old = KnownPlace()
    old.update = lambda robot: None  # the LiDAR is off: no scan is newer than the picture
    run, pictures = pictured_by(old)
    assert (run.cause, pictures) == (Cause.POSTCONDITION, [])


def test_a_picture_that_by_the_confirmed_pose_does_not_show_the_point_is_not_claimed():
    run, pictures = pictured_by(SlippedPlace(None, 0.0))
    assert run.outcome == "success"  # it knew all along, and pointed the camera anew
    run, pictures = pictured_by(SlippedPlace(None, run.time_s - 0.05))
    assert (run.cause, pictures) == (Cause.POSTCONDITION, [])
    assert "the thing is not in the picture" in run.message


def pictured_before(wall_m, point_W=(1.4, 0.0, 0.75), **inputs):
    """Result of the skill with a wall `wall_m` before the camera everywhere in the depth (0: unknown)."""
    bench, _ = bench_of_setup(SPOT_CAPABILITIES, RobotSetup(pose=PoseSetup(x=0.45)), WorldSetup())
    image = bench.robot.image
    bench.robot.image = lambda *which, **how: (lambda one: replace(one, depth_m=np.full_like(one.depth_m, wall_m)))(
        image(*which, **how)
    )
    run = bench.run(TakePicture, TakePictureInputs("the thing", point_W, **inputs))
    return run, [message for topic, message in bench.published if topic == PICTURES]


def test_a_point_hidden_in_the_same_picture_is_not_claimed():
    run, pictures = pictured_before(0.2)
    assert (run.cause, pictures) == (Cause.POSTCONDITION, [])
    assert "before it hides it" in run.message


def test_a_point_without_depth_around_it_is_not_claimed():
    run, pictures = pictured_before(0.0)
    assert (run.cause, pictures) == (Cause.POSTCONDITION, [])
    assert "no depth shows whether something hides it" in run.message


def test_a_picture_of_what_is_ahead_shows_what_stands_there():
    run, pictures = pictured_before(0.2, ahead=True)
    assert (run.outcome, len(pictures)) == ("success", 1)


def test_a_camera_below_the_top_of_a_surface_takes_no_picture_of_it():
    run, pictures = picture_of((0.45, 1.2, 0.75), "left", BLIND)
    assert len(pictures) == 1  # of a thing at this point
    bench, _ = bench_of_setup(BLIND, RobotSetup(pose=PoseSetup(x=0.45)), WorldSetup())
    run = bench.run(TakePicture, TakePictureInputs("the table", (0.45, 1.2, 0.75), camera="left", top=True))
    assert (run.cause, run.message.split(": ")[1].startswith("the left camera, 0.")) == (Cause.PLANNING, True)
    assert "does not see a top 0.75 m high" in run.message


# the camera of a picture of a top 1 m high -> error and a word of its hint; None: it is taken
@pytest.mark.parametrize(
    ("camera", "error", "hint"),
    [
        ("hand", None, ""),
        ("", None, ""),
        ("Front left", "the frontleft camera, 0.54 m high, does not see a top 1 m high", "higher"),
        ("tail", "the robot has no camera 'tail'", "frontleft"),
    ],
)
def test_a_camera_that_is_missing_or_too_low_is_refused_before_a_run(camera, error, hint):
    inputs = {"of": "shelf", "camera": camera, "top": True, "point_W": (1.0, 2.0, 1.0)}
    what, more = TakePicture.refuses(inputs, SPOT.capabilities()) or (None, "")
    assert what == error and hint in more
    assert TakePicture.refuses({**inputs, "top": False}, SPOT.capabilities()) is None or camera == "tail"


def test_a_robot_without_cameras_takes_no_picture_by_a_named_one():
    blind = replace(SPOT.capabilities(), cameras=())
    refusal = TakePicture.refuses({"camera": "hand"}, blind)
    assert refusal == ("the robot has no camera 'hand'", "choose another kind of robot")
