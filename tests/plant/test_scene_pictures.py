"""Pictures of a run show paths, objects and scale at their places."""

import cv2
import numpy as np
import pytest
from pydrake.geometry import Box, MakeRenderEngineVtk, RenderEngineVtkParams, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from plant import scene_pictures
from plant.scene_pictures import PATH_COLOUR, best_view, draw_map, look_at, render_view, top_view

RED, GREY, BLUE = (np.array(rgba) for rgba in ([0.9, 0.05, 0.05, 1], [0.6, 0.6, 0.6, 1], [0.1, 0.1, 0.9, 1]))


@pytest.fixture(scope="module")
def scene():
    """A walled floor under a ceiling, a red ball at (2, 1, 0.5), a blue screen to the east of it."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.01)
    scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(RenderEngineVtkParams()))
    shapes = [
        (Box(8, 6, 0.1), (0, 0, -0.05), GREY),
        (Box(8, 6, 0.1), (0, 0, 2.55), GREY),
        (Sphere(0.3), (2, 1, 0.5), RED),
        (Box(0.05, 1.5, 2.0), (2.8, 1, 1.0), BLUE),
    ]
    for i, (shape, p_WG, colour) in enumerate(shapes):
        plant.RegisterVisualGeometry(plant.world_body(), RigidTransform(p_WG), shape, f"v{i}", colour)
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    return diagram, root, scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(root))


def red_centre(picture):
    """Mean pixel (x, y) of the red pixels."""
    rgb = picture.astype(int)
    rows, columns = np.nonzero((rgb[..., 0] > 80) & (rgb[..., 0] > 2 * rgb[..., 1]) & (rgb[..., 0] > 2 * rgb[..., 2]))
    return np.array([columns.mean(), rows.mean()])


def test_the_map_is_cut_below_the_ceiling_and_to_scale(scene):
    view = top_view(scene[2], (-4, -3, 4, 3), width=400)
    assert view.picture.shape == (300, 400, 3)
    np.testing.assert_allclose(red_centre(view.picture), view.pixels(np.array([[2.0, 1.0]]), 0.5)[0], atol=1.0)
    corners = view.pixels(np.array([[-4.0, 3.0], [4.0, -3.0]]))
    np.testing.assert_allclose(corners, [[-0.5, -0.5], [399.5, 299.5]], atol=0.1)
    assert view.pixels_per_m == pytest.approx(50.0)


def test_the_path_is_drawn_at_its_place_on_the_map(scene):
    view = top_view(scene[2], (-4, -3, 4, 3), width=800)
    path = np.array([[-3.0, -2.0], [0.0, -2.0], [0.0, 2.0]])
    paths, marks = {"path of Alice": (path, PATH_COLOUR)}, {"coke": (1.0, -1.0)}
    picture = draw_map(view, paths, labels={"hall": (-2, 1)}, marks=marks)
    x, y = np.round(view.pixels(np.array([[-1.5, -2.0]]))[0]).astype(int)
    assert picture[y, x, 0] > 200 and picture[y, x, 1] < 100
    assert picture.shape[0] > view.picture.shape[0]
    assert (picture[: view.picture.shape[0]] != view.picture).any()
    assert (view.picture == top_view(scene[2], (-4, -3, 4, 3), width=800).picture).all()


def test_labels_leave_a_person_and_a_robot_at_the_end_of_its_path_free(scene):
    view = top_view(scene[2], (-4, -3, 4, 3), width=800)
    free_W = {"a person": (-2.0, 1.0), "Alice": (2.5, -1.0)}
    picture = draw_map(view, {"path of Alice": (np.array([[2.5, -1.0, 0.0]]), PATH_COLOUR)})
    labels = {"hall": free_W["a person"], "kitchen": free_W["Alice"]}
    named = draw_map(
        view, {"path of Alice": (np.array([[2.5, -1.0, 0.0]]), PATH_COLOUR)}, labels=labels, people=[free_W["a person"]]
    )
    assert (named != picture).any()
    for (x, y), radius_m in zip(free_W.values(), (0.25, 0.4), strict=True):
        (left, top), (right, bottom) = np.round(
            view.pixels(np.array([[x - radius_m, y + radius_m], [x + radius_m, y - radius_m]]))
        ).astype(int)
        assert (named[top:bottom, left:right] == picture[top:bottom, left:right]).all()


@pytest.mark.parametrize("points", [0, 1])
def test_short_paths_are_drawn_too(scene, points):
    view = top_view(scene[2], (-4, -3, 4, 3), width=200)
    drawn = draw_map(view, {"path of Alice": (np.zeros((points, 3)), PATH_COLOUR)})
    assert drawn.shape[1:] == view.picture.shape[1:]


def test_flat_bounds_are_refused(scene):
    with pytest.raises(ValueError, match="bounds"):
        top_view(scene[2], (1, 0, 1, 3))


def test_view_from_the_target_itself_is_refused():
    with pytest.raises(ValueError, match="same point"):
        look_at((1, 1, 1), (1, 1, 1))


def test_view_straight_down_is_possible():
    assert look_at((0, 0, 2), (0, 0, 0)).rotation().matrix()[2, 2] == pytest.approx(-1.0)


def test_horizon_is_level_with_up_at_the_top():
    right_z, down_z, _ = look_at((0, 0, 1), (5, 2, 0.5)).rotation().matrix()[2]
    assert right_z == pytest.approx(0.0)
    assert down_z < 0.0


def test_a_free_view_faces_its_target(scene):
    picture = render_view(scene[2], look_at((-1.0, -1.0, 1.6), (2.0, 1.0, 0.5)), (320, 240))
    np.testing.assert_allclose(red_centre(picture), [160, 120], atol=4)


def test_best_view_avoids_the_screen_in_front_of_the_target(scene):
    X_WC = best_view(scene[2], (2.0, 1.0, 0.5), facing_W=(1.0, 0.0))
    picture = render_view(scene[2], X_WC, (320, 240))
    assert np.linalg.norm(red_centre(picture) - [160, 120]) < 15
    assert abs(X_WC.translation()[1] - 1.0) > 1.0


def test_best_view_keeps_to_the_wanted_side_when_it_is_clear(scene):
    X_WC = best_view(scene[2], (2.0, 1.0, 0.5), facing_W=(0.0, -1.0))
    assert X_WC.translation()[1] < -0.5


@pytest.mark.parametrize("box", [(100, 80, 180, 160), (0, 0, 40, 30), (600, 440, 639, 479)])
def test_detection_box_is_drawn_on_a_copy(box):
    picture = np.full((480, 640, 3), 90, dtype=np.uint8)
    drawn = scene_pictures.draw_detection(picture, box, "coke", 0.87)
    assert (picture == 90).all()
    row = drawn[(box[1] + box[3]) // 2]
    assert [row[box[0]].tolist(), row[(box[0] + box[2]) // 2].tolist()] == [[255, 190, 0], [90, 90, 90]]


def test_saved_picture_reads_back_the_same(tmp_path):
    picture = np.random.default_rng(0).integers(0, 255, (20, 30, 3), dtype=np.uint8)
    scene_pictures.save_png(tmp_path / "deep" / "p.png", picture)
    read = cv2.cvtColor(cv2.imread(str(tmp_path / "deep" / "p.png")), cv2.COLOR_BGR2RGB)
    np.testing.assert_array_equal(read, picture)
