"""Outlines in the plane: what lies within, and how far outside."""

import pytest

from executive.mission.geometry import distance_m, inside

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
