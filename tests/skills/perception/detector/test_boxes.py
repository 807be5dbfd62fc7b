"""Boxes of the detector: the letterbox there and back, crops, and suppression of boxes on one object."""

import numpy as np
import pytest

from skills.perception.detector.boxes import (
    HEIGHT_PX,
    PADDING,
    WIDTH_PX,
    Candidates,
    Letterbox,
    Scales,
    SuppressionOptions,
    alternative_scores,
    fill_letterbox,
    halve,
    letterbox,
    select_candidates,
    suppress,
)

OPTIONS = SuppressionOptions(same_class=0.6, other_class=0.8, sure_score=0.5)


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


def candidates(*rows):
    boxes, scores, classes = zip(*rows, strict=True)
    return Candidates(np.array(boxes, np.float32), np.array(scores, np.float32), np.array(classes))


def kept(*rows, options=OPTIONS):
    found = suppress(candidates(*rows), options)
    return [(round(float(score), 3), int(which)) for score, which in zip(found.scores, found.classes, strict=True)]


WHOLE, MOST, HALF, BESIDE = (0, 0, 10, 10), (0, 0, 9, 10), (0, 0, 5, 10), (20, 0, 30, 10)


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([(WHOLE, 0.9, 1), (MOST, 0.8, 1)], [(0.9, 1)]),
        ([(WHOLE, 0.9, 1), (HALF, 0.8, 1)], [(0.9, 1), (0.8, 1)]),
        ([(WHOLE, 0.9, 1), (BESIDE, 0.8, 1)], [(0.9, 1), (0.8, 1)]),
        ([(WHOLE, 0.9, 1), (MOST, 0.8, 2)], [(0.9, 1)]),
        ([(WHOLE, 0.9, 1), ((0, 0, 7, 10), 0.8, 2)], [(0.9, 1), (0.8, 2)]),
        ([(WHOLE, 0.4, 1), (MOST, 0.3, 2)], [(0.4, 1), (0.3, 2)]),
        ([(WHOLE, 0.4, 1), (MOST, 0.3, 1)], [(0.4, 1)]),
    ],
    ids=["duplicate", "half", "beside", "two classes", "two classes, less", "both unsure", "unsure duplicate"],
)
def test_suppression_keeps_the_best_of_overlapping_boxes(rows, expected):
    assert kept(*rows) == expected


def test_a_suppressed_box_suppresses_no_other():
    # each overlaps the next by 0.7, the first and the third by 0.4
    rows = [((0, 0, 100, 10), 0.9, 1), ((18, 0, 118, 10), 0.8, 1), ((36, 0, 136, 10), 0.7, 1)]
    assert kept(*rows) == [(0.9, 1), (0.7, 1)]


def test_the_number_of_detections_is_limited():
    rows = [((20 * k, 0, 20 * k + 10, 10), 0.9 - 0.1 * k, 1) for k in range(4)]
    assert len(kept(*rows, options=SuppressionOptions(most_kept=2))) == 2


def test_no_candidates_stay_no_candidates():
    nothing = Candidates(np.empty((0, 4), np.float32), np.empty(0, np.float32), np.empty(0, np.int64))
    assert len(suppress(nothing, OPTIONS)) == 0


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([(WHOLE, 0.9, 1), (MOST, 0.4, 2), (MOST, 0.2, 3)], {2: 0.4, 3: 0.2}),
        ([(WHOLE, 0.9, 1), (WHOLE, 0.4, 2), (MOST, 0.3, 2)], {2: 0.4}),
        ([(WHOLE, 0.9, 1), (MOST, 0.4, 1)], {}),
        ([(WHOLE, 0.9, 1), (HALF, 0.4, 2), (BESIDE, 0.4, 2)], {}),
    ],
    ids=["two alternatives", "the surer box of one", "its own class", "too little shared"],
)
def test_alternatives_are_other_classes_on_the_same_object(rows, expected):
    (found,) = alternative_scores(suppress(candidates(rows[0]), OPTIONS), candidates(*rows), OPTIONS)
    assert found == pytest.approx(expected)


def test_candidates_reach_the_threshold_and_are_sorted_by_score():
    boxes = np.array([WHOLE, MOST, HALF], np.float32)
    scores = np.array([[0.5, 0.1], [0.49, 0.9], [0.5, 0.0]], np.float32)
    found = select_candidates(boxes, scores, 0.5, 10)
    assert found.scores.tolist() == [pytest.approx(0.9), 0.5, 0.5]
    assert found.classes.tolist() == [1, 0, 0]
    assert found.boxes.tolist() == [list(MOST), list(WHOLE), list(HALF)]


def test_the_best_candidates_are_selected():
    boxes = np.tile(np.array(WHOLE, np.float32), (50, 1))
    scores = np.linspace(0.5, 0.99, 50, dtype=np.float32).reshape(50, 1)
    assert select_candidates(boxes, scores, 0.5, 3).scores.tolist() == pytest.approx([0.99, 0.98, 0.97])


def test_scores_that_are_nan_are_no_candidates():
    assert len(select_candidates(np.array([WHOLE], np.float32), np.array([[np.nan]], np.float32), 0.5, 10)) == 0


@pytest.mark.parametrize("box", [(np.nan, 0, 1, 1), (0, 0, np.inf, 1), (5, 0, 5, 9), (9, 9, 2, 2)])
def test_invalid_boxes_are_no_candidates(box):
    assert len(select_candidates(np.array([box], np.float32), np.array([[0.9]], np.float32), 0.5, 10)) == 0
