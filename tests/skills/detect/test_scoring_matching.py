"""Which detection finds which label."""

import numpy as np
import pytest

from skills.detect.scoring_matching import match, overlaps


def boxes(*rows):
    return np.array(rows, dtype=float).reshape(-1, 4)


def flags(*values):
    return np.array(values, dtype=bool)


def matched(detections, scores, labels, *, crowd=None, passed=None, small=None, at=(0.5,)):
    return match(
        boxes(*detections),
        np.array(scores, dtype=float),
        boxes(*labels),
        crowd=flags(*(crowd or [False] * len(labels))),
        passed=flags(*(passed or [False] * len(labels))),
        small=flags(*(small or [False] * len(detections))),
        at=at,
    )


def test_overlaps_by_hand():
    found = overlaps(boxes([0, 0, 10, 10]), boxes([5, 0, 15, 10], [0, 0, 10, 10], [20, 0, 30, 10]), flags(0, 0, 0))
    assert found[0] == pytest.approx([50 / 150, 1.0, 0.0])


def test_of_a_crowd_the_share_of_the_detection_counts():
    assert overlaps(boxes([0, 0, 10, 10]), boxes([5, 0, 105, 100]), flags(1))[0] == pytest.approx([0.5])


def test_boxes_without_area_overlap_nothing():
    assert overlaps(boxes([3, 3, 3, 3]), boxes([3, 3, 3, 3]), flags(0)).tolist() == [[0.0]]


def test_the_surest_detection_takes_the_label_and_the_second_is_wrong():
    result = matched([[0, 0, 10, 9], [0, 0, 10, 10]], [0.9, 0.8], [[0, 0, 10, 10]])
    assert result.found.tolist() == [[True, False]]
    assert result.label_found.tolist() == [[0]]


def test_detections_come_in_order_of_their_scores_and_labels_keep_the_detections_own_number():
    result = matched([[50, 0, 60, 10], [0, 0, 10, 10]], [0.2, 0.7], [[0, 0, 10, 10], [50, 0, 60, 10]])
    assert result.scores.tolist() == [0.7, 0.2]
    assert result.label_found.tolist() == [[1, 0]]


def test_each_overlap_is_matched_for_itself():
    # the first detection overlaps the label by 0.6, the second by 0.8
    result = matched([[0, 0, 6, 10], [0, 0, 8, 10]], [0.9, 0.8], [[0, 0, 10, 10]], at=(0.5, 0.75, 0.95))
    assert result.found.tolist() == [[True, False], [False, True], [False, False]]


def test_the_better_of_two_free_labels_is_taken_and_of_equals_the_last():
    result = matched([[0, 0, 10, 10]], [0.9], [[0, 0, 10, 8], [0, 0, 10, 9], [0, 1, 10, 10]])
    assert result.label_found.tolist() == [[-1, -1, 0]]


def test_a_label_that_counts_goes_before_one_to_be_passed_over():
    result = matched([[0, 0, 10, 10]], [0.9], [[0, 0, 10, 10], [0, 0, 10, 6]], passed=[True, False])
    assert result.label_found.tolist() == [[-1, 0]]
    assert result.passed.tolist() == [[False]]
    assert result.counting == 1


def test_any_number_of_detections_in_a_crowd_is_passed_over():
    crowd = [[0, 0, 100, 100]]
    result = matched([[0, 0, 10, 10], [20, 0, 30, 10], [95, 0, 115, 10]], [0.9, 0.8, 0.7], crowd, crowd=[True])
    assert result.passed.tolist() == [[True, True, False]]
    assert result.counting == 0


def test_one_detection_on_a_thing_to_be_ignored_is_passed_over_and_the_second_is_wrong():
    result = matched([[0, 0, 10, 10], [0, 0, 10, 9]], [0.9, 0.8], [[0, 0, 10, 10]], passed=[True])
    assert result.passed.tolist() == [[True, False]]


def test_a_small_detection_is_passed_over_only_when_it_is_on_nothing():
    result = matched([[0, 0, 10, 10], [50, 0, 60, 10]], [0.9, 0.8], [[0, 0, 10, 10]], small=[True, True])
    assert result.found.tolist() == [[True, False]]
    assert result.passed.tolist() == [[False, True]]


@pytest.mark.parametrize(("detections", "labels"), [([], []), ([[0, 0, 1, 1]], []), ([], [[0, 0, 1, 1]])])
def test_nothing_matches_nothing(detections, labels):
    result = matched(detections, [0.5] * len(detections), labels)
    assert not result.found.any()
    assert result.found.shape == (1, len(detections))
    assert result.label_found.shape == (1, len(labels))
