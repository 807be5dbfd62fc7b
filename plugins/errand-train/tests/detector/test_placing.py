import numpy as np
import pytest

from errand_train.detector.labels import Labels
from errand_train.detector.placing import Cell, join_targets, place_labels, similarity_map

CELL = Cell(0, 0, 100, 80)


def square(x, y, side):
    return np.array([[x, y], [x + side, y], [x + side, y + side], [x, y + side]], dtype=np.float32)


def labels(*outlines, seen=1.0, ignored=False):
    count = len(outlines)
    return Labels(outlines, np.arange(count), np.full(count, seen, dtype=np.float32), np.full(count, ignored))


def still():
    return similarity_map(np.zeros(2, np.float32), np.zeros(2, np.float32), angle_rad=0.0, scale=1.0, flipped=False)


def test_an_object_inside_the_cell_keeps_its_box():
    found = place_labels(labels(square(10, 20, 30)), still(), CELL)
    assert found.boxes.tolist() == [[10, 20, 40, 50]]
    assert not found.ignored.any()


def test_a_right_angle_turns_the_box_about_the_focus():
    focus = np.array([20, 20], dtype=np.float32)
    affine = similarity_map(focus, focus, angle_rad=np.pi / 2, scale=1.0, flipped=False)
    tall = np.array([[15, 10], [25, 10], [25, 30], [15, 30]], dtype=np.float32)
    assert place_labels(labels(tall), affine, CELL).boxes[0].tolist() == pytest.approx([10, 15, 30, 25], abs=1e-3)


def test_a_turned_disc_keeps_its_box_where_a_turned_box_would_grow():
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    disc = (np.stack([np.cos(angles), np.sin(angles)], axis=1) * 20 + (50, 40)).astype(np.float32)
    focus = np.array([50, 40], dtype=np.float32)
    affine = similarity_map(focus, focus, angle_rad=np.pi / 4, scale=1.0, flipped=False)
    assert place_labels(labels(disc), affine, CELL).boxes[0].tolist() == pytest.approx([30, 20, 70, 60], abs=0.5)


def test_mirroring_moves_the_focus_to_its_target_and_swaps_sides():
    affine = similarity_map(
        np.array([10, 10], np.float32), np.array([50, 40], np.float32), angle_rad=0.0, scale=2.0, flipped=True
    )
    assert place_labels(labels(square(10, 10, 15)), affine, CELL).boxes.tolist() == [[20, 40, 50, 70]]


# seen before, part within the cell -> ignored (under a quarter seen)
@pytest.mark.parametrize(
    ("seen", "x", "expected"), [(1.0, 80, False), (1.0, 95, True), (0.4, 70, False), (0.4, 80, True), (0.2, 10, True)]
)
def test_hardly_visible_objects_are_ignored(seen, x, expected):
    found = place_labels(labels(square(x, 10, 40), seen=seen), still(), CELL)
    assert found.ignored.tolist() == [expected]
    assert found.boxes[0, 2] <= 100


def test_objects_outside_the_cell_are_left_out():
    found = place_labels(labels(square(10, 10, 20), square(200, 10, 20)), still(), CELL)
    assert found.classes.tolist() == [0]


def test_objects_that_became_small_are_ignored():
    affine = similarity_map(np.zeros(2, np.float32), np.zeros(2, np.float32), angle_rad=0.0, scale=0.2, flipped=False)
    assert place_labels(labels(square(10, 10, 40)), affine, CELL).ignored.tolist() == [True]


def test_ignored_objects_stay_ignored():
    assert place_labels(labels(square(10, 10, 40), ignored=True), still(), CELL).ignored.tolist() == [True]


def test_a_picture_without_objects_gives_no_targets():
    found = place_labels(labels(), still(), CELL)
    assert found.boxes.shape == (0, 4)
    assert join_targets([found, found]).boxes.shape == (0, 4)
