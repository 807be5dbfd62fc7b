"""The gripper's pads hold what rubber holds, and let go of what it would not."""

import pytest

from plant.diagram import TIME_STEP_S
from tests.benchmarks.grip import THINGS, held, measure, twisted

BY_NAME = {thing.name: thing for thing in THINGS}


@pytest.mark.parametrize("name", ["hammer bar", "round handle", "25 mm peg", "bottle's neck"])
def test_gripper_holds_a_thing_beside_its_centre_of_mass(name):
    result = held("grid", BY_NAME[name], 100.0, TIME_STEP_S)
    assert result["held"] and result["shaken_deg"] < 12.0, result


@pytest.mark.parametrize(("pads", "name", "force_n"), [("dots", "round handle", 100.0), ("grid", "sledge bar", 40.0)])
def test_a_round_handle_turns_between_sparse_dots_and_a_long_heavy_bar_in_the_gripper(pads, name, force_n):
    assert held(pads, BY_NAME[name], force_n, TIME_STEP_S)["turned_deg"] > 30.0


def test_gripper_lets_a_greasy_bar_slip():
    assert not held("grid", BY_NAME["greasy bar"], 40.0, TIME_STEP_S)["held"]


@pytest.mark.parametrize("name", ["hammer bar", "25 mm peg", "block"])
def test_twist_resistance_is_friction_times_force_times_radius_of_the_patch(name):
    assert 0.7 < twisted("grid", BY_NAME[name], 100.0, TIME_STEP_S)["twist"] < 1.4


def test_hydroelastic_pads_are_measured_beside_the_grid():
    result = measure("hydroelastic", BY_NAME["block"], 40.0, TIME_STEP_S)
    assert result["held"] and result["failed"] == 0, result
