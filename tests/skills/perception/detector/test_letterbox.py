"""The letterbox: pictures of any size in 640x480, boxes there and back, and crops."""

import numpy as np
import pytest

from skills.perception.detector.letterbox import (
    HEIGHT_PX,
    PADDING,
    WIDTH_PX,
    Letterbox,
    Scales,
    fill_letterbox,
    halve,
    letterbox,
)


def noise(*shape):
    return np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)


def test_a_picture_of_the_size_is_left_as_it_is():
    picture = noise(480, 640, 3)
    filled, placed = letterbox(picture)
    assert np.array_equal(filled, picture)
    assert placed.scale_xy == (1.0, 1.0)


def test_grey_is_the_same_in_all_channels():
    picture = noise(480, 640)
    filled, _ = letterbox(picture)
    assert np.array_equal(filled, np.repeat(picture[:, :, None], 3, axis=2))


def test_one_of_a_batch_is_filled_in_place():
    batch = np.zeros((2, HEIGHT_PX, WIDTH_PX, 3), dtype=np.uint8)
    fill_letterbox(np.full((10, 10), 9, dtype=np.uint8), batch[1])
    assert not batch[0].any()
    assert batch[1, 0, 0].tolist() == [9, 9, 9]
    assert batch[1, 0, -1].tolist() == [PADDING] * 3


@pytest.mark.parametrize(
    # picture (w, h) -> inside (w, h) of the letterbox
    ("size", "inside"),
    [
        ((320, 240), (640, 480)),
        ((1280, 720), (640, 360)),
        ((480, 640), (360, 480)),
        ((1, 1), (480, 480)),
        ((20000, 10), (640, 1)),
        ((3, 4000), (1, 480)),
        ((641, 480), (640, 479)),
    ],
)
def test_a_picture_is_scaled_to_fit_and_padded_at_right_and_bottom(size, inside):
    width, height = inside
    filled, placed = letterbox(np.full((size[1], size[0], 3), 7, dtype=np.uint8))
    assert placed.inside_px == inside
    assert np.all(filled[:height, :width] == 7)
    assert np.all(filled[height:] == PADDING)
    assert np.all(filled[:, width:] == PADDING)
    assert filled.shape == (HEIGHT_PX, WIDTH_PX, 3)


@pytest.mark.parametrize("size", [(320, 240), (1920, 1080), (333, 777), (5, 3)])
def test_boxes_convert_back_to_the_picture(size):
    placed = Letterbox(*size)
    boxes = np.array([[0, 0, *size], [0.2 * size[0], 0.1 * size[1], 0.7 * size[0], 0.9 * size[1]]], dtype=np.float32)
    assert placed.to_picture(boxes * np.array(placed.scale_xy * 2)) == pytest.approx(boxes, abs=1e-3)


def test_the_box_of_an_object_lies_on_it_in_both_pictures():
    picture = np.zeros((200, 1000), dtype=np.uint8)
    picture[50:150, 300:700] = 255
    filled, placed = letterbox(picture)
    rows, columns = np.nonzero((filled[:128] > 127).all(axis=2))
    there = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
    assert placed.to_picture(np.array([there]))[0] == pytest.approx([300.0, 50.0, 700.0, 150.0], abs=0.8)


def test_boxes_beyond_the_picture_are_clipped():
    found = Letterbox(1280, 720).to_picture(np.array([[-5.0, 300.0, 640.0, 480.0]]))
    assert found.tolist() == [[0.0, 600.0, 1280.0, 720.0]]


def test_no_boxes_stay_no_boxes():
    assert Letterbox(100, 100).to_picture(np.empty((0, 4))).shape == (0, 4)


@pytest.mark.parametrize(
    "picture",
    [
        np.zeros((4, 4), dtype=np.uint16),
        np.zeros((4, 4, 4), dtype=np.uint8),
        np.zeros((0, 4, 3), dtype=np.uint8),
        np.zeros(4, dtype=np.uint8),
        "picture",
    ],
)
def test_anything_but_a_picture_is_refused(picture):
    with pytest.raises(ValueError, match="a picture is"):
        letterbox(picture)


@pytest.fixture
def scales():
    picture = np.zeros((120, 160, 3), np.uint8)
    picture[40:80, 60:100] = (200, 100, 50)
    return Scales(picture, halve(picture))


def scaled(scale, u, v):
    """Affine map of the point (u, v) to the middle of a crop of 64 x 64."""
    return np.array([[scale, 0.0, 32 - scale * u], [0.0, scale, 32 - scale * v]])


@pytest.mark.parametrize(("scale", "side"), [(2.0, 64), (1.0, 40), (0.5, 20), (0.25, 10)])
def test_a_crop_shows_the_object_at_the_size_and_place_of_the_map(scales, scale, side):
    shown = scales.warp(scaled(scale, 80, 60), (64, 64))[..., 0] > 150
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    low, high = 32 - side // 2, 31 + side // 2
    assert (rows[0], rows[-1], columns[0], columns[-1]) == (low, high, low, high)


def test_a_crop_has_padding_beyond_the_picture(scales):
    assert (scales.warp(scaled(1.0, -200, -200), (64, 64)) == PADDING).all()


def test_a_small_crop_has_no_aliasing():
    grain = np.zeros((128, 128, 3), np.uint8)
    grain[::2, ::2] = grain[1::2, 1::2] = 200
    shown = Scales(grain, halve(grain)).warp(np.array([[0.5, 0.0, 0.0], [0.0, 0.5, 0.0]]), (64, 64))
    assert shown[4:60, 4:60].astype(int).std() < 1.0
