"""Likeness of views: outline, colours and edges must each agree."""

import numpy as np
import pytest

from skills.perception.object_model import view_of
from skills.perception.view_matching import likeness

RED, BLUE, WHITE = (190, 40, 35), (40, 60, 190), (230, 230, 230)


def drawn(colour=RED, size=(60, 90), label=None, label_rows=(30, 60)):
    """View of a plate of one colour with a label across it."""
    width, height = size
    rgba = np.full((height, width, 4), 255, np.uint8)
    rgba[..., :3] = colour
    if label is not None:
        rgba[label_rows[0] : label_rows[1], :, :3] = label
    return view_of(rgba)


def test_a_view_is_like_itself_among_others():
    views = np.array([drawn(BLUE), drawn(label=WHITE), drawn(size=(90, 60))])
    assert likeness(drawn(label=WHITE), views) == pytest.approx(1.0)


def test_a_darker_picture_is_still_alike():
    darker = drawn(tuple(round(0.75 * each) for each in RED), label=tuple(round(0.75 * each) for each in WHITE))
    assert likeness(darker, drawn(label=WHITE)[None]) > 0.7


def test_a_view_keeps_the_proportions_and_the_middle():
    rows, columns = np.nonzero(drawn(size=(40, 80))[..., 3] > 127)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (0, 23, 6, 17)


@pytest.mark.parametrize(
    "other", [drawn(BLUE), drawn(size=(90, 45)), drawn(label=WHITE)], ids=["colour", "outline", "edges"]
)
def test_one_difference_is_enough_to_be_unlike(other):
    assert likeness(other, drawn()[None]) < 0.35
