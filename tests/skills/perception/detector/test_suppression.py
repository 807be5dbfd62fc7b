import numpy as np
import pytest

from skills.perception.detector.suppression import (
    Candidates,
    SuppressionOptions,
    alternative_scores,
    select_candidates,
    suppress,
)

OPTIONS = SuppressionOptions(same_class=0.6, other_class=0.8, sure_score=0.5)


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
