"""Places to look at again, and where their crops are."""

import numpy as np
import pytest

from skills.perception.detector.proposals import CROP_PX, ProposalOptions, crop_map, logits_of, mapped, proposals_of

WHOLE, MOST, BESIDE, EMPTY = (0, 0, 100, 100), (0, 0, 90, 100), (200, 0, 300, 50), (10, 10, 10, 20)


def found(*rows, **options):
    boxes, scores = zip(*rows, strict=True)
    return proposals_of(np.array(boxes, np.float32), np.array(scores, np.float32), ProposalOptions(**options))


def test_boxes_of_any_class_on_one_place_become_one_with_the_surest_ones_opinion():
    regions = found((MOST, (0.3, 0.1)), (WHOLE, (0.2, 0.8)), (BESIDE, (0.4, 0.0)))
    assert regions.boxes.tolist() == [list(WHOLE), list(BESIDE)]
    assert regions.logits == pytest.approx(logits_of(np.array([[0.2, 0.8], [0.4, 0.0]], np.float32)))


def test_the_unsure_and_the_empty_are_no_places():
    assert len(found((WHOLE, (0.008, 0.002)), (EMPTY, (0.9, 0.0)), ((0, 0, float("nan"), 5), (0.9, 0.0)))) == 0


def test_no_more_than_so_many_places_are_looked_at():
    assert found((WHOLE, (0.3,)), (BESIDE, (0.4,)), most=1).boxes.tolist() == [list(BESIDE)]


@pytest.mark.parametrize(
    ("box", "expected"),
    [
        ((100, 100, 184, 184), (22, 22, 106, 106)),
        ((0, 0, 168, 84), (22, 43, 106, 85)),
        ((50, 50, 60, 60), (43, 43, 85, 85)),
    ],
    ids=["as large as in the chip", "twice as large", "very small"],
)
def test_a_place_is_in_the_middle_of_its_crop_and_fills_two_thirds_of_it(box, expected):
    crop = crop_map(np.array(box, np.float32))
    assert mapped(np.array([box]), crop)[0].tolist() == pytest.approx(expected, abs=1e-3)
    assert CROP_PX == 128


def test_a_mirrored_crop_shows_the_left_at_the_right():
    crop = crop_map(np.array((100, 100, 184, 184), np.float32), mirrored=True)
    assert mapped(np.array([(100, 100, 110, 184)]), crop)[0].tolist() == pytest.approx((96, 22, 106, 106), abs=1e-3)


def test_boxes_under_a_turn_hold_their_corners():
    quarter = np.array([[0.0, -1.0, 50.0], [1.0, 0.0, 0.0]])
    assert mapped(np.array([(0, 0, 10, 20)]), quarter)[0].tolist() == [30.0, 0.0, 50.0, 10.0]


def test_each_box_may_have_a_map_of_its_own():
    boxes = np.array([WHOLE, BESIDE], np.float32)
    maps = np.stack([crop_map(box) for box in boxes])
    one_by_one = [mapped(box[None], one)[0].tolist() for box, one in zip(boxes, maps, strict=True)]
    assert mapped(boxes, maps).tolist() == one_by_one
