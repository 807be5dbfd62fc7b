"""Perceived pose, gesture and colour of clothes of figures of people, in pictures of the plant."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform

from errand_people.appearance import PICTURES_S, Look, appearance_of, candidates
from errand_people.looks import Appearance, Colour, Gesture, Pose
from tests.benchmarks.person_pictures import built_with, camera_pose, figure_of, person_model, pictures

AT, AWAY_M, CAMERA_M = np.array([1.0, 2.0]), 2.2, 1.0


def look_of(figure, side_rad=0.3, at=AT, looks_at=AT, directives=None):
    """What a look shows of a person who faces x, from a side."""
    built = built_with([person_model(each, at) for each in (figure,) if each is not None], directives)
    p_W = np.array([*(looks_at + AWAY_M * np.array([math.cos(side_rad), math.sin(side_rad)])), CAMERA_M])
    look, rng = Look(looks_at), np.random.default_rng(3)
    while (height_m := look.next_height_m) is not None:
        images = pictures(built, camera_pose(p_W, np.array([*looks_at, height_m])), PICTURES_S, rng)
        look.add(images, RigidTransform())
    return look


# posture, gesture, colour, side (rad)
@pytest.mark.parametrize(
    ("posture", "gesture", "colour", "side_rad"),
    [
        ("standing", "none", "red", 0.0),
        ("standing", "waving", "grey", -0.9),
        ("standing", "raising_left_arm", "orange", 0.9),
        ("standing", "raising_right_arm", "black", 0.9),
        ("standing", "pointing_left", "white", -0.5),
        ("standing", "pointing_right", "green", -0.5),
        ("sitting", "none", "yellow", 0.6),
        ("sitting", "raising_right_arm", "blue", -0.6),
    ],
)
def test_a_look_tells_pose_gesture_and_colour(posture, gesture, colour, side_rad):
    look = look_of(figure_of(posture, gesture, colour), side_rad)
    assert look.result == Appearance(Pose(posture), Gesture(gesture), Colour(colour))
    assert np.linalg.norm(look.place_W - AT) < 0.2


def test_a_look_lowers_the_camera_to_see_who_lies(tmp_path):
    shape = '<visual name="f"><geometry><box><size>6 6 0.02</size></box></geometry></visual>'
    (tmp_path / "f.sdf").write_text(f'<sdf version="1.9"><model name="f"><link name="f">{shape}</link></model></sdf>')
    floor = tmp_path / "world.dmd.yaml"
    add, weld = f'{{name: f, file: "{(tmp_path / "f.sdf").as_uri()}"}}', "{parent: world, child: 'f::f'}"
    floor.write_text(f"directives:\n- add_model: {add}\n- add_weld: {weld}\n")
    look = look_of(figure_of("lying", "none", "red"), 1.3, directives=floor)
    assert look.result == Appearance(Pose.LYING, Gesture.NONE, Colour.RED)


def test_the_hair_of_a_person_seen_from_behind_tells_which_arm_is_raised():
    look = look_of(figure_of("standing", "raising_left_arm", "red"), math.pi)
    assert look.result.gesture is Gesture.RAISING_LEFT_ARM


def test_nobody_has_no_appearance():
    assert look_of(None).result == Appearance()


def test_two_people_side_by_side_are_told_apart_by_their_places():
    look = look_of(figure_of("standing", "none", "red"), at=AT + [0.0, 1.0])
    assert look.result.pose is None


def test_skin_shows_where_people_may_be():
    figure = figure_of("sitting", "none", "green")
    built = built_with([person_model(figure, AT)])
    pose = camera_pose(np.array([3.8, 2.0, CAMERA_M]), np.array([1.0, 2.0, 0.9]))
    (image,) = pictures(built, pose, (0.0,), np.random.default_rng(3))
    found = candidates(image, RigidTransform())
    assert found
    assert all(math.dist(each, AT) < 0.6 for each in found)
    assert appearance_of([image], RigidTransform(), np.array(found[0]))[0].pose is Pose.SITTING
