import pytest

from skills.teleop.keys import AXES, KEYS, axis_values, read_axis_values
from tests.tables import table


def test_keys_add_up_and_opposite_ones_cancel():
    assert axis_values(["w", "a"]) == {"forward": 1.0, "turn": 1.0}
    assert axis_values(["w", "s"]) == {}


def test_a_stick_and_a_key_together_stay_within_one():
    assert axis_values(["w"], {"forward": 0.7, "turn": -0.25}) == {"forward": 1.0, "turn": -0.25}


def test_keys_without_a_meaning_have_no_effect():
    assert axis_values([" ", "p", "\x1b"]) == {}


def test_every_axis_has_a_key_for_each_direction():
    assert {axis for axis, _ in KEYS.values()} == AXES
    assert len(KEYS) == 2 * len(AXES)


def test_a_page_asks_by_keys_and_axes():
    assert read_axis_values({"keys": ["w"], "axes": {"hand_z": -0.5}}) == {"forward": 1.0, "hand_z": -0.5}


@pytest.mark.parametrize(*table(__file__, "invalid"))
def test_invalid_axis_values_are_refused(values):
    with pytest.raises(ValueError, match="must be"):
        read_axis_values(values)
