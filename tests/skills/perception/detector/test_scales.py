"""Parts of a picture at another size and place."""

import numpy as np
import pytest

from skills.perception.detector.letterbox import PADDING
from skills.perception.detector.scales import Scales, halved


@pytest.fixture
def scales():
    picture = np.zeros((120, 160, 3), np.uint8)
    picture[40:80, 60:100] = (200, 100, 50)
    return Scales(picture, halved(picture))


def scaled(scale, u, v):
    """The map that brings the point (u, v) to the middle of a canvas of 64 x 64."""
    return np.array([[scale, 0.0, 32 - scale * u], [0.0, scale, 32 - scale * v]])


@pytest.mark.parametrize(("scale", "side"), [(2.0, 64), (1.0, 40), (0.5, 20), (0.25, 10)])
def test_a_thing_is_as_large_as_the_map_says_and_in_its_place(scales, scale, side):
    shown = scales.cut(scaled(scale, 80, 60), (64, 64))[..., 0] > 150
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    low, high = 32 - side // 2, 31 + side // 2
    assert (rows[0], rows[-1], columns[0], columns[-1]) == (low, high, low, high)


def test_beyond_the_picture_is_padding(scales):
    assert (scales.cut(scaled(1.0, -200, -200), (64, 64)) == PADDING).all()


def test_what_is_made_small_shows_no_grain():
    grain = np.zeros((128, 128, 3), np.uint8)
    grain[::2, ::2] = grain[1::2, 1::2] = 200
    shown = Scales(grain, halved(grain)).cut(np.array([[0.5, 0.0, 0.0], [0.0, 0.5, 0.0]]), (64, 64))
    assert shown[4:60, 4:60].astype(int).std() < 1.0
