"""The rover of the tests: the package that `errand new robot` has made of its URDF."""

from pathlib import Path

import pytest

from plant.robots.urdf_robot.kind import urdf_kind


@pytest.fixture(scope="session")
def rover_package():
    """Folder with `robot.yaml` of the rover."""
    return Path(__file__).with_name("errand_robot_rover")


@pytest.fixture(scope="session")
def rover_kind(rover_package):
    return urdf_kind(rover_package / "robot.yaml")
