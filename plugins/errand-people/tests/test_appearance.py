"""Perceived pose, gesture and colour of clothes of figures of people, in pictures of the plant."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from errand_people.appearance import PICTURES_S, Look, appearance_of, candidates
from errand_people.looks import Appearance, Colour, Gesture, Pose
from executive.words.variation import DAY_LIGHT
from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.models.catalogue import load_catalogue
from plant.models.person_figure import CLOTHES, Figure
from plant.rendering import render_parameters
from tests.benchmarks.person_pictures import camera_pose, pictures

PERSON = load_catalogue()["person"].forms["standing"].path()
AT, AWAY_M, CAMERA_M = np.array([1.0, 2.0]), 2.2, 1.0


def look_of(figure, side_rad=0.3, at=AT, looks_at=AT, floor=None):
    """What a look shows of a person who faces x, from a side."""
    models = [] if figure is None else [LooseModel("Kim", PERSON, RigidTransform([*at, 0.0]), True, None, None, figure)]
    models += [] if floor is None else [floor]
    built = build_diagram(DiagramConfig(models=models, renderer_parameters=render_parameters(DAY_LIGHT)))
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
    look = look_of(Figure(posture, gesture, CLOTHES[colour]), side_rad)
    assert look.result == Appearance(Pose(posture), Gesture(gesture), Colour(colour))
    assert np.linalg.norm(look.place_W - AT) < 0.2


def test_a_look_lowers_the_camera_to_see_who_lies(tmp_path):
    shape = "<geometry><box><size>6 6 0.02</size></box></geometry>"
    floor = tmp_path / "floor.sdf"
    floor.write_text(
        f'<sdf version="1.9"><model name="f"><link name="f"><visual name="f">{shape}</visual></link></model></sdf>'
    )
    look = look_of(Figure("lying", "none", CLOTHES["red"]), 1.3, floor=LooseModel("f", floor, RigidTransform(), True))
    assert look.result == Appearance(Pose.LYING, Gesture.NONE, Colour.RED)


def test_the_hair_of_a_person_seen_from_behind_tells_which_arm_is_raised():
    look = look_of(Figure("standing", "raising_left_arm", CLOTHES["red"]), math.pi)
    assert look.result.gesture is Gesture.RAISING_LEFT_ARM


def test_nobody_has_no_appearance():
    assert look_of(None).result == Appearance()


def test_two_people_side_by_side_are_told_apart_by_their_places():
    look = look_of(Figure("standing", "none", CLOTHES["red"]), at=AT + [0.0, 1.0])
    assert look.result.pose is None


def test_skin_shows_where_people_may_be():
    figure = Figure("sitting", "none", CLOTHES["green"])
    X_WP = RigidTransform(RotationMatrix.MakeZRotation(0.0), [*AT, 0.0])
    built = build_diagram(DiagramConfig(models=[LooseModel("Kim", PERSON, X_WP, True, None, None, figure)]))
    pose = camera_pose(np.array([3.8, 2.0, CAMERA_M]), np.array([1.0, 2.0, 0.9]))
    (image,) = pictures(built, pose, (0.0,), np.random.default_rng(3))
    found = candidates(image, RigidTransform())
    assert found
    assert all(math.dist(each, AT) < 0.6 for each in found)
    assert appearance_of([image], RigidTransform(), np.array(found[0]))[0].pose is Pose.SITTING
