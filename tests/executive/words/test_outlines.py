"""Outlines in the plane: containment and distance."""

import pytest

from executive.words.outlines import distance_m, fits, inside, nearest_side

SQUARE = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
NOTCHED = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (2.0, 1.0), (0.0, 4.0))


@pytest.mark.parametrize("outline", [SQUARE, SQUARE[::-1]])
@pytest.mark.parametrize(("point", "metres"), [((1.0, 1.0), 0.0), ((3.0, 1.0), 1.0), ((-3.0, -4.0), 5.0)])
def test_the_distance_counts_from_the_outline(outline, point, metres):
    assert distance_m(outline, point) == pytest.approx(metres)
    assert inside(outline, point) is (metres == 0.0)


@pytest.mark.parametrize(("point", "within"), [((0.5, 2.0), True), ((2.0, 2.0), False), ((3.5, 2.0), True)])
def test_an_outline_may_have_a_notch(point, within):
    assert inside(NOTCHED, point) is within


def test_the_side_along_which_a_line_lies_is_found_in_a_corner_too():
    assert nearest_side(SQUARE, (1.6, 2.05), 0.9).ends == ((2.0, 2.0), (0.0, 2.0))
    assert nearest_side(SQUARE, (2.05, 1.6), 0.9).ends == ((2.0, 0.0), (2.0, 2.0))


def test_outline_fits_within_a_polygon_beside_taken_ones():
    body = ((0.5, 0.5), (1.0, 0.5), (1.0, 1.0), (0.5, 1.0))
    assert fits(body, SQUARE, []) and not fits(SQUARE, body, [])
    assert not fits(body, SQUARE, [((0.9, 0.9), (1.5, 0.9), (1.5, 1.5))])
