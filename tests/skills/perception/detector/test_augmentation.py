"""Test-time augmentation, with a small network that reads detections from the pictures."""

import numpy as np
import pytest
from tiny_detector import CLASSES, picture_of, write_model

from skills.detection import Detection, Detector
from skills.perception.detector.augmentation import (
    AugmentationOptions,
    AugmentedDetector,
    View,
)
from skills.perception.detector.onnx_detector import OnnxDetector, load_detector

SEEN = np.full((480, 640, 3), 90, dtype=np.uint8)
BOX = (100.0, 50.0, 300.0, 150.0)
MIRRORED = (340.0, 50.0, 540.0, 150.0)
SMALL = (50.0, 25.0, 150.0, 75.0)
VIEWS = (View(), View(mirrored=True), View(scale=0.5))


@pytest.fixture
def seen_in(tmp_path, monkeypatch):
    model = load_detector(write_model(tmp_path / "tiny.onnx")).model

    def look(*answers, views=VIEWS, least_score=None, model=model):
        left = iter(answers)
        monkeypatch.setattr(
            OnnxDetector, "detect", lambda self, pictures, least_score: [tuple(next(left)) for _ in pictures]
        )
        options = AugmentationOptions(views, low=-1.0, high=2.0)
        return AugmentedDetector(OnnxDetector(model), options).detect_in_views(SEEN, least_score)

    return look


def test_detection_in_all_views_has_the_mean_score_and_box(seen_in):
    (found,) = seen_in(
        [Detection("hammer", 0.9, BOX)], [Detection("hammer", 0.6, MIRRORED)], [Detection("hammer", 0.6, SMALL)]
    )
    assert (found.class_name, found.score) == ("hammer", pytest.approx(0.7))
    assert found.box == pytest.approx(BOX)


def test_the_class_of_most_views_wins(seen_in):
    # hammer 0.6, 0.9, 0.9; coke 0.9, 0.3, 0
    both = [Detection("coke", 0.9, BOX, (("hammer", 0.6),))]
    (found,) = seen_in(both, [Detection("hammer", 0.9, MIRRORED, (("coke", 0.3),))], [Detection("hammer", 0.9, SMALL)])
    assert (found.class_name, found.score) == ("hammer", pytest.approx(0.8))
    assert found.alternatives == (("coke", pytest.approx(0.4)),)


@pytest.mark.parametrize(("least_score", "told"), [(None, 0), (0.3, 1)])
def test_faint_detections_are_returned_with_a_lower_least_score(seen_in, least_score, told):
    each = ([Detection("hammer", 0.4, box)] for box in (BOX, MIRRORED, SMALL))
    assert len(seen_in(*each, least_score=least_score)) == told


def test_a_detection_in_one_view_has_a_low_score(seen_in):
    assert seen_in([Detection("hammer", 0.9, BOX)], [], []) == ()


def test_an_empty_picture_has_no_detections(seen_in):
    assert seen_in([], [], []) == ()


def test_a_view_that_shows_an_object_too_small_does_not_count(seen_in):
    little, mirrored = (100.0, 50.0, 140.0, 70.0), (500.0, 50.0, 540.0, 70.0)
    (found,) = seen_in([Detection("beer", 0.8, little)], [Detection("beer", 0.6, mirrored)], [])
    assert found.score == pytest.approx(0.7)


def test_a_very_large_object_is_judged_by_smaller_views(seen_in):
    # 400 pixels long; 200 in the look at half the size
    found = seen_in(
        [Detection("coke", 0.9, (100.0, 50.0, 500.0, 150.0))],
        [Detection("coke", 0.9, (140.0, 50.0, 540.0, 150.0))],
        [Detection("hammer", 0.8, (50.0, 25.0, 250.0, 75.0))],
    )
    assert [(one.class_name, one.score) for one in found] == [("hammer", pytest.approx(0.8))]


def test_a_person_is_judged_at_the_whole_picture_unless_that_makes_them_small(seen_in, tmp_path):
    # 400 pixels high, 200 at half the size, 80 at a fifth, which does not count
    box = (100.0, 40.0, 200.0, 440.0)
    views = (View(), View(scale=0.5), View(scale=0.2))
    model = load_detector(write_model(tmp_path / "people.onnx", classes=("beer", "person"))).model
    half = Detection("person", 0.7, (50.0, 20.0, 100.0, 220.0))
    (found,) = seen_in([Detection("person", 0.9, box)], [half], [], views=views, model=model)
    assert (found.class_name, found.score) == ("person", pytest.approx(0.8))


# first view -> number of views: all where another class or object may be there, or the score is low
@pytest.mark.parametrize(
    ("first", "views"),
    [
        ([Detection("hammer", 0.9, BOX)], 1),
        ([Detection("hammer", 0.9, BOX), Detection("coke", 0.2, SMALL)], 1),
        ([Detection("hammer", 0.2, BOX)], 1),
        ([], 1),
        ([Detection("hammer", 0.9, BOX), Detection("coke", 0.4, SMALL)], 3),
        ([Detection("hammer", 0.9, BOX, (("beer", 0.4),))], 3),
        ([Detection("hammer", 0.6, BOX)], 3),
    ],
)
def test_other_views_are_taken_where_the_proposal_network_leaves_doubt(tmp_path, monkeypatch, first, views):
    taken = []

    def detect(self, pictures, least_score):
        taken.extend(pictures)
        return [tuple(first) for _ in pictures]

    monkeypatch.setattr(OnnxDetector, "detect", detect)
    detector = AugmentedDetector(load_detector(write_model(tmp_path / "tiny.onnx")), AugmentationOptions(VIEWS))
    detector.detect_in_views(SEEN)
    assert len(taken) == views


def test_two_objects_of_a_class_stay_two(seen_in):
    other = (400.0, 300.0, 600.0, 400.0)
    found = seen_in(
        [Detection("beer", 0.8, BOX), Detection("beer", 0.7, other)],
        [Detection("beer", 0.8, MIRRORED), Detection("beer", 0.7, (40.0, 300.0, 240.0, 400.0))],
        [Detection("beer", 0.8, SMALL), Detection("beer", 0.7, (200.0, 150.0, 300.0, 200.0))],
    )
    assert [one.box for one in found] == [pytest.approx(BOX), pytest.approx(other)]


@pytest.mark.parametrize(
    "view",
    [
        View(),
        View(True),
        View(scale=0.7),
        View(True, 0.5),
    ],
    ids=str,
)
@pytest.mark.parametrize("shape", [(480, 640, 3), (240, 320)], ids=["colour", "grey"])
def test_a_box_of_a_view_converts_to_the_object_in_the_picture(view, shape):
    picture = np.zeros(shape, dtype=np.uint8)
    picture[50:150, 100:300] = 255
    varied = view.apply(picture)
    white = varied if varied.ndim == 2 else varied[..., 0]
    rows, columns = np.nonzero(white > 200)
    box = (float(columns.min()), float(rows.min()), float(columns.max() + 1), float(rows.max() + 1))
    assert view.box_in_picture(box, shape[1]) == pytest.approx((100.0, 50.0, 300.0, 150.0), abs=3.0)


@pytest.mark.parametrize("view", [View(), View(True), View(scale=0.35)], ids=str)
def test_a_whole_picture_keeps_its_size(view):
    assert view.apply(np.zeros((240, 320, 3), dtype=np.uint8)).shape == (240, 320, 3)


def test_augmented_detector_uses_one_view_by_default(tmp_path):
    inner = load_detector(write_model(tmp_path / "tiny.onnx"))
    augmented: Detector = AugmentedDetector(inner)
    picture = picture_of(("hammer", 0.9, (100, 50, 200, 80)))
    assert augmented.class_names == CLASSES
    assert augmented.detect([picture]) == inner.detect([picture]) == [inner.detect_in_views(picture)]
    assert augmented.detect_class([picture], "hammer") == inner.detect_class([picture], "hammer") != [()]


@pytest.mark.parametrize("bad", [np.zeros((0, 0, 3), np.uint8), np.zeros((9, 9, 7), np.uint8)], ids=["empty", "seven"])
def test_anything_but_a_picture_is_refused(tmp_path, bad):
    with pytest.raises(ValueError, match="picture"):
        AugmentedDetector(load_detector(write_model(tmp_path / "tiny.onnx"))).detect_in_views(bad)
