"""Places to look from."""

import numpy as np
import pytest

from skills.arm.poses import viewpoints_beside

SHOULDER, TARGET = np.array([0.0, 0.0, 0.5]), np.array([1.0, 0.0, 0.3])


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["left", "right"])
def test_places_beside_another_are_first_those_farther_out_on_its_side(side):
    eye = np.array([0.2, 0.3 * side, 0.9])
    places = np.array(viewpoints_beside(SHOULDER, eye, TARGET))
    farther_out = side * (places[:, 1] - eye[1]) > 0.03
    assert farther_out.tolist() == [True, True, False, False, False]


def test_places_beside_another_are_six_centimetres_from_it_across_the_view():
    eye = np.array([0.2, 0.3, 0.9])
    for place in viewpoints_beside(SHOULDER, eye, TARGET)[:2]:
        step = (place - eye)[:2]
        assert np.linalg.norm(step) == pytest.approx(0.06)
        assert step @ (TARGET - eye)[:2] == pytest.approx(0.0, abs=1e-9)
