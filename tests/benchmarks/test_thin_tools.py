"""Thin tools in the plant: what the robot believes of its gripper is true, and the fingers hit nothing."""

import pytest

from plant.models.catalogue import read_imported
from tests.benchmarks.shapes import TOOLS, written_tool
from tests.benchmarks.thin_tools import run_case

THIN_M, MOST_M = 0.006, 0.025


def test_the_tools_are_as_thin_as_the_gripper_must_feel(tmp_path):
    heights_m = {name: written_height_m(name, tmp_path) for name in TOOLS}
    assert min(heights_m.values()) == pytest.approx(THIN_M, abs=1e-4)
    assert max(heights_m.values()) < MOST_M


def written_height_m(name, folder):
    return min(read_imported(written_tool(name, folder)).size_m)


# lost in the hollow behind the fingertips before, a flat bar of 6 mm, a light rod
@pytest.mark.mission
@pytest.mark.parametrize("name", ["awl", "flat_file", "drift"])
def test_a_thin_tool_that_is_held_is_known_to_be_held(name, tmp_path):
    trial = run_case(name, 9600, tmp_path)
    assert (trial["lifted"], trial["denied"], trial["false"], trial["hits"]) == (True, False, False, [])
