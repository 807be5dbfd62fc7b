"""Figures of people: where their hands are, how they lie and sit, and colours of clothes by the seed."""

import numpy as np
import pytest

from plant.models.person_figure import CLOTHES, SEAT_M, Figure, shade


@pytest.mark.parametrize(
    ("gesture", "side", "at"),
    [
        ("none", 1, [0.06, 0.25, 0.8]),
        ("raising_left_arm", 1, [0.06, 0.27, 1.98]),
        ("raising_left_arm", -1, [0.06, -0.25, 0.8]),
        ("pointing_right", -1, [0.16, -0.78, 1.4]),
    ],
)
def test_a_gesture_moves_the_hand_of_its_side(gesture, side, at):
    assert Figure(gesture=gesture).hand(side, 0.0) == pytest.approx(at, abs=0.01)


def test_a_waving_hand_moves_sideways_over_time():
    hands = np.array([Figure(gesture="waving").hand(-1, time_s) for time_s in np.arange(0.0, 1.25, 0.1)])
    assert np.ptp(hands[:, 1]) > 0.35
    assert np.all(hands[:, 2] > 1.6)


@pytest.mark.parametrize(("posture", "head_m"), [("standing", 1.76), ("sitting", SEAT_M + 0.99), ("lying", 0.115)])
def test_the_head_is_as_high_as_the_posture_says(posture, head_m):
    assert (Figure(posture).X_PT @ np.array([0.0, 0.0, 1.76]))[2] == pytest.approx(head_m)


def test_clothes_dye_the_model_and_leave_skin_and_trousers():
    plain, dyed = Figure().sdf(), Figure(clothes=(0.1, 0.2, 0.3)).sdf()
    assert dyed.count("0.100 0.200 0.300 1") == plain.count("0.58 0.48 0.6 1") > 4
    assert dyed.count("0.8 0.62 0.5 1") == plain.count("0.8 0.62 0.5 1") > 4


@pytest.mark.parametrize("colour", CLOTHES)
def test_a_shade_is_near_its_colour(colour):
    off = np.abs(np.subtract(shade(colour, np.random.default_rng(1)), CLOTHES[colour]))
    assert 0.0 < off.max() < 0.18
