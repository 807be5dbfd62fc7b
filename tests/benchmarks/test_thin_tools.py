"""Thin tools in the plant: what the robot believes of its gripper is true, and the fingers hit nothing."""

import pytest

from tests.benchmarks import thin_tools
from tests.benchmarks.shapes import TOOLS, tool_mesh

THIN_MM, MOST_MM = 6.0, 25.0


def test_the_tools_are_as_thin_as_the_gripper_must_feel():
    heights_mm = [min(tool_mesh(name).extents) for name in TOOLS]
    assert min(heights_mm) == pytest.approx(THIN_MM, abs=0.1)
    assert max(heights_mm) < MOST_MM


# a flat bar of 6 mm, lost in the hollow behind the fingertips before, a light rod
@pytest.mark.mission
@pytest.mark.parametrize(
    "name", ["flat_file", *(pytest.param(each, marks=pytest.mark.nightly) for each in ("awl", "drift"))]
)
def test_a_thin_tool_that_is_held_is_known_to_be_held(name, tmp_path, monkeypatch):
    monkeypatch.setattr(thin_tools, "HELD_S", 4.0)
    trial = thin_tools.run_case(name, 9600, tmp_path)
    assert (trial["lifted"], trial["denied"], trial["false"], trial["hits"]) == (True, False, False, [])
