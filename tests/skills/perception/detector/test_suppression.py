"""One box for each thing."""

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
def test_which_boxes_stay(rows, expected):
    assert kept(*rows) == expected


def test_what_has_gone_takes_nothing_with_it():
    # each overlaps the next by 0.7, the first and the third by 0.4
    rows = [((0, 0, 100, 10), 0.9, 1), ((18, 0, 118, 10), 0.8, 1), ((36, 0, 136, 10), 0.7, 1)]
    assert kept(*rows) == [(0.9, 1), (0.7, 1)]


def test_no_more_than_asked_for_are_kept():
    rows = [((20 * k, 0, 20 * k + 10, 10), 0.9 - 0.1 * k, 1) for k in range(4)]
    assert len(kept(*rows, options=SuppressionOptions(most_kept=2))) == 2


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
def test_what_a_thing_may_be_as_well(rows, expected):
    (found,) = alternative_scores(suppress(candidates(rows[0]), OPTIONS), candidates(*rows), OPTIONS)
    assert found == pytest.approx(expected)


def test_nothing_stays_nothing():
    nothing = Candidates(np.empty((0, 4), np.float32), np.empty(0, np.float32), np.empty(0, np.int64))
    assert len(suppress(nothing, OPTIONS)) == 0


def test_candidates_reach_the_threshold_and_come_by_their_scores():
    boxes = np.array([WHOLE, MOST, HALF], np.float32)
    scores = np.array([[0.5, 0.1], [0.49, 0.9], [0.5, 0.0]], np.float32)
    found = select_candidates(boxes, scores, 0.5, 10)
    assert found.scores.tolist() == [pytest.approx(0.9), 0.5, 0.5]
    assert found.classes.tolist() == [1, 0, 0]
    assert found.boxes.tolist() == [list(MOST), list(WHOLE), list(HALF)]


def test_the_surest_candidates_are_taken():
    boxes = np.tile(np.array(WHOLE, np.float32), (50, 1))
    scores = np.linspace(0.5, 0.99, 50, dtype=np.float32).reshape(50, 1)
    assert select_candidates(boxes, scores, 0.5, 3).scores.tolist() == pytest.approx([0.99, 0.98, 0.97])


@pytest.mark.parametrize("box", [(np.nan, 0, 1, 1), (0, 0, np.inf, 1), (5, 0, 5, 9), (9, 9, 2, 2)])
def test_what_is_no_box_is_no_candidate(box):
    assert len(select_candidates(np.array([box], np.float32), np.array([[0.9]], np.float32), 0.5, 10)) == 0


def test_scores_that_are_no_numbers_are_none():
    assert len(select_candidates(np.array([WHOLE], np.float32), np.array([[np.nan]], np.float32), 0.5, 10)) == 0
