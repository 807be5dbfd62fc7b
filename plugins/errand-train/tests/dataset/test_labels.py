"""Boxes and masks of the renderer agree with an independent projection; silhouettes count as they should."""

import numpy as np
import pytest
from pydrake.geometry import RenderEngineVtkParams
from pydrake.math import RigidTransform

from errand_make.mesh import Material, Mesh
from errand_train.dataset.compose import Placed, Scene
from errand_train.dataset.lighting import Lighting
from errand_train.dataset.objects import instance
from errand_train.dataset.render import Stage, label_view
from errand_train.dataset.room import Room
from errand_train.dataset.silhouette import silhouette
from errand_train.dataset.views import View, roll_deg
from plant.rendering import lights
from plant.scene_pictures import look_at
from skills.robot import Intrinsics

CAMERA = Intrinsics(320, 240, 276.0, 276.0, 160.0, 120.0)
EYE = np.array([0.0, -1.0, 0.6])


@pytest.fixture(scope="module")
def cubes(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ERRAND_MODEL_CACHE", str(tmp_path_factory.mktemp("models")))
        return instance("cube", 0), instance("cylinder", 2)


def empty_room():
    mesh = Mesh({"floor": Material((0.5, 0.5, 0.5))})
    mesh.add_rectangle("floor", (-3, -3, 0), (6, 0, 0), (0, 6, 0))
    return Room((6.0, 6.0, 2.5), mesh, (), (), (), False)


def labels_of(objects, folder):
    scene = Scene(empty_room(), objects, None, ())
    stage = Stage(scene, Lighting("plain", RenderEngineVtkParams(lights=lights())), folder, 1.0)
    view = View("hand", look_at(EYE, (0, 0, 0.05)), CAMERA, False, False)
    clean, labels = stage.take(view)
    return label_view(stage.labelled, labels, view, stage.hand_pose(view), clean)


def projected_box(model, X_WO):
    """The box of all corner points, by the pinhole's equations."""
    X_CW = look_at(EYE, (0, 0, 0.05)).inverse()
    x, y, z = np.asarray((X_CW @ X_WO) @ model.surface.points.T)
    u, v = CAMERA.fx * x / z + CAMERA.cx, CAMERA.fy * y / z + CAMERA.cy
    return float(u.min()), float(v.min()), float(u.max()), float(v.max())


@pytest.mark.parametrize("place", [(0.0, 0.1), (0.3, 0.4), (-0.25, -0.1)])
def test_boxes_agree_with_the_projection_of_all_corners(cubes, place, tmp_path):
    cube = cubes[0]
    X_WO = RigidTransform([*place, cube.size_m[2] / 2])
    (found,) = labels_of((Placed(cube, X_WO),), tmp_path)
    x, y, w, h = found["bbox"]
    expected = projected_box(cube, X_WO)
    np.testing.assert_allclose((x - 0.5, y - 0.5, x + w - 0.5, y + h - 0.5), expected, atol=1.5)
    assert found["visibility"] > 0.97
    assert found["truncation"] == 0.0
    assert found["instance"] == "cube_000"


def test_an_occluding_object_reduces_visibility(cubes, tmp_path):
    cube, cylinder = cubes
    behind = Placed(cube, RigidTransform([0.0, 0.3, cube.size_m[2] / 2]))
    before = Placed(cylinder, RigidTransform([cube.size_m[0] / 4, 0.3 - cube.size_m[1], cylinder.size_m[2] / 2]))
    found = {str(entry["instance"]): entry for entry in labels_of((behind, before), tmp_path)}
    assert found["cylinder_002"]["visibility"] > 0.97
    assert 0.1 < found["cube_000"]["visibility"] < 0.9


# how far the middle of the cube is from the camera, in sides of it -> ignored
@pytest.mark.parametrize(("sides", "ignored"), [(0.25, 1), (0.45, 1), (1.5, 0)])
def test_an_object_around_the_camera_is_ignored(cubes, sides, ignored, tmp_path):
    cube = cubes[0]
    (found,) = labels_of((Placed(cube, RigidTransform(EYE + [0.0, sides * cube.size_m[1], 0.0])),), tmp_path)
    assert found["ignore"] == ignored


# how far the camera is before the cube's side, which it shows from 0.05 m on -> ignored
@pytest.mark.parametrize(("before_m", "ignored"), [(0.02, 1), (0.04, 1), (0.1, 0)])
def test_an_object_within_the_near_plane_is_ignored(cubes, before_m, ignored, tmp_path):
    # ahead and to the left of the camera, so that the right half of the picture is free
    cube, X_WC = cubes[0], look_at(EYE, (0, 0, 0.05))
    x, _, z = cube.size_m
    (found,) = labels_of((Placed(cube, X_WC @ RigidTransform([-0.45 * x, 0.0, before_m + 0.5 * z])),), tmp_path)
    assert found["ignore"] == ignored


def test_distractors_have_no_label(tmp_path, monkeypatch):
    monkeypatch.setenv("ERRAND_MODEL_CACHE", str(tmp_path / "models"))
    mug = instance("mug", 0)
    assert labels_of((Placed(mug, RigidTransform([0, 0, 0.05])),), tmp_path) == []


# A square of 0.2 m at 1 m, seen with 100 pixels per radian: 20 x 20 pixels, centred at some column.
@pytest.mark.parametrize(("shift_m", "inside", "whole"), [(0.0, 400, 400), (1.6, 200, 400), (3.0, 0, 400)])
def test_a_silhouette_counts_pixels_inside_and_beyond_the_picture(shift_m, inside, whole):
    camera = Intrinsics(320, 240, 100.0, 100.0, 159.5, 119.5)
    corners = np.array([(-0.1, -0.1, 1.0), (0.1, -0.1, 1.0), (0.1, 0.1, 1.0), (-0.1, 0.1, 1.0)]) + [shift_m, 0, 0]
    found = silhouette(corners, np.array([(0, 1, 2), (0, 2, 3)]), camera)
    assert found.inside_px == pytest.approx(inside, abs=25)
    assert found.whole_px == pytest.approx(whole, abs=45)


def test_triangles_behind_the_camera_do_not_count():
    corners = np.array([(-0.1, -0.1, -1.0), (0.1, -0.1, -1.0), (0.1, 0.1, 1.0)])
    assert silhouette(corners, np.array([(0, 1, 2)]), CAMERA).whole_px == 0


def test_the_roll_of_an_upright_and_of_a_turned_camera():
    upright = look_at(EYE, (0, 0, 0.05))
    assert roll_deg(upright) == pytest.approx(0.0, abs=1e-6)
    quarter = RigidTransform(np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))
    assert abs(roll_deg(upright @ quarter)) == pytest.approx(90.0, abs=1e-6)
