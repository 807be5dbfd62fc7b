import math

import numpy as np
import pytest

from errand_train.detector.calibrate import best_threshold, score_offsets
from errand_train.detector.scoring_labels import Label, LabelledPicture
from skills.api import Detection

BOX = (10.0, 10.0, 60.0, 60.0)
AWAY = (200.0, 10.0, 260.0, 60.0)


# scores from high to low, which are right, labels -> threshold
@pytest.mark.parametrize(
    ("scores", "right", "labels", "expected"),
    [
        ([0.9, 0.8, 0.3, 0.2], [1, 1, 0, 0], 2, 0.55),
        ([0.9, 0.3, 0.2], [1, 1, 1], 3, 0.2),
        ([0.4, 0.2], [0, 0], 3, 0.5),
        ([], [], 3, 0.5),
    ],
)
def test_the_threshold_is_halfway_below_the_best_cut(scores, right, labels, expected):
    found = best_threshold(np.array(scores, dtype=np.float64), np.array(right, dtype=bool), labels)
    assert found == pytest.approx(expected)


def pictures(count):
    return [LabelledPicture(f"{k}.jpg", (Label("beer", BOX),)) for k in range(count)]


def test_an_offset_brings_the_best_threshold_to_one_half():
    found = [(Detection("beer", 0.3, BOX), Detection("beer", 0.1, AWAY))] * 30
    offset, none = score_offsets(pictures(30), found, ("beer", "coke"))
    assert 1 / (1 + math.exp(-(math.log(0.2 / 0.8) + offset))) == pytest.approx(0.5)
    assert none == 0.0


def test_few_labels_change_nothing():
    found = [(Detection("beer", 0.3, BOX),)] * 5
    assert score_offsets(pictures(5), found, ("beer",)) == (0.0,)
