"""Tests of the collision scene: boxes in any frame, a held object, padding."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from plant.robots.fetch.kind import FETCH
from plant.robots.spot.kind import spot_capabilities
from skills.manipulation.arm.collision import AROUND, ArmScene, Box, gaps_m
from skills.manipulation.arm.kinematics import arm_model

CAPABILITIES = spot_capabilities()
MODEL = arm_model(CAPABILITIES)
AHEAD = MODEL.inverse(RigidTransform([0.8, 0.0, 0.2]))[0]
AT_HAND = Box(RigidTransform([0.85, 0.0, 0.2]), (0.1, 0.1, 0.1))


@pytest.fixture(scope="module")
def scene():
    return ArmScene(CAPABILITIES, MODEL, {})


def test_boxes_in_another_frame_stand_where_that_frame_is(scene):
    # frame F 2 m to the left: free; F at the body: in contact
    scene.set_boxes([AT_HAND], RigidTransform([0.0, 2.0, 0.0]))
    assert scene.free(AHEAD)
    scene.set_boxes([AT_HAND], RigidTransform())
    assert not scene.free(AHEAD)


def test_boxes_of_before_stand_where_they_stood_after_other_boxes(scene):
    scene.set_boxes([AT_HAND])
    with scene.with_only((), 0.0):
        assert scene.free(AHEAD)
    assert not scene.free(AHEAD)


def test_the_touched_links_are_named(scene):
    scene.set_boxes([AT_HAND])
    assert any(AROUND in pair for pair in scene.contacts(AHEAD))


def test_without_a_lift_every_pose_is_free_as_usual(scene):
    assert scene.free_as_usual(AHEAD)


def test_the_padding_counts_for_boxes_set_later(scene):
    # a box that ends 5 cm below the hand's origin, which is 3 to 4 cm high: free with 1 cm, too near with 10 cm
    below = Box(RigidTransform([0.85, 0.0, 0.2 - 0.05 - 0.1]), (0.1, 0.1, 0.1))
    scene.set_padding(0.10)
    scene.set_boxes([below])
    assert not scene.free(AHEAD)
    scene.set_padding(0.002)
    assert scene.free(AHEAD)


def test_an_object_in_the_hand_stays_there_when_the_boxes_change(scene):
    far_ahead = Box(RigidTransform([1.4, 0.0, 0.2]), (0.1, 0.1, 0.1))
    scene.hold([Box(RigidTransform([0.5, 0.0, 0.0]), (0.5, 0.05, 0.05))])
    scene.set_boxes([far_ahead])
    assert not scene.free(AHEAD)
    scene.hold(())
    assert scene.free(AHEAD)


def test_checks_of_a_scene_do_not_depend_on_those_before(scene):
    turns = np.random.default_rng(4).uniform(MODEL.lower_rad, MODEL.upper_rad, (20, len(MODEL.names)))
    scene.set_boxes([AT_HAND])
    first = [scene.free(q) for q in turns]
    scene.set_boxes(())
    scene.set_boxes([AT_HAND])
    assert [scene.free(q) for q in turns] == first


def test_a_pose_free_with_the_torso_up_may_touch_once_it_is_down():
    fetch = FETCH.capabilities()
    raised_m = fetch.height_range_m[1] - fetch.standing_height_m
    usual_lift_m = fetch.standing_height_m - fetch.height_range_m[0]
    model = arm_model(fetch)
    ahead = model.inverse(RigidTransform([0.6, 0.0, 0.6]))[0]
    raised = ArmScene(fetch, model, {fetch.lift_joint: usual_lift_m + raised_m})
    # a box below the hand, through which the arm would go as the torso comes down
    below = Box(RigidTransform([0.6, 0.0, 0.6 - raised_m]), (0.1, 0.1, 0.1))
    raised.set_boxes([below])
    assert raised.free(ahead)
    assert not raised.free_as_usual(ahead)
    assert raised.free(ahead)  # asking changes nothing
    usual = ArmScene(fetch, model, {fetch.lift_joint: usual_lift_m})
    usual.set_boxes([below])
    assert usual.free_as_usual(ahead)
    assert not usual.free_as_usual(ahead, clear_m=1.0)
    assert usual.free_as_usual(ahead)


# a cube with sides of 0.2 m at the origin: where another stands, how it is turned about z, how far it is off
@pytest.mark.parametrize(
    ("place", "turn_rad", "gap_m"),
    [
        ((1.0, 0.0, 0.0), 0.0, 0.8),
        ((0.0, 0.0, -0.5), 0.0, 0.3),
        ((0.5, 0.0, 0.0), np.pi / 4, 0.4 - 0.1 * np.sqrt(2.0)),
        ((0.15, 0.0, 0.0), 0.0, -0.05),
    ],
)
def test_boxes_are_as_far_apart_as_along_the_axis_that_separates_them_best(place, turn_rad, gap_m):
    side_m = (0.2, 0.2, 0.2)
    other = Box(RigidTransform(RotationMatrix.MakeZRotation(turn_rad), place), side_m)
    gaps = gaps_m(Box(RigidTransform(), side_m), [other], np.array([[0.0, 0.0, 0.0], [0.0, 3.0, 0.0]]))
    assert gaps[0] == pytest.approx([gap_m])
    assert gaps[1, 0] > 2.5  # moved away
