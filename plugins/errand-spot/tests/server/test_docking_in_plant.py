"""Docking in the flat from a door and from beside a sideboard, where the straight way to the dock is barred."""

from unittest import mock

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")

from skills.robot import Pose2D
from tests.benchmarks import spot_docking

pytestmark = pytest.mark.mission
DOOR, SIDEBOARD = Pose2D(10.6, 6.6, -1.57), Pose2D(11.1, 4.0, 1.57)


@pytest.fixture
def _patches_end():
    yield
    mock.patch.stopall()


@pytest.mark.usefixtures("_patches_end")
@pytest.mark.parametrize("start", [DOOR, pytest.param(SIDEBOARD, marks=pytest.mark.nightly)], ids=["door", "sideboard"])
def test_the_robot_docks_without_touching_anything(start, tmp_path, monkeypatch):
    monkeypatch.setattr(spot_docking, "drawn", lambda _number: start)
    found = spot_docking.run_case(1, tmp_path)
    assert (found["told"], found["contacts"], found["docked"]) == ("STATUS_DOCKED", 0, True)
