"""The rover of the tests: a URDF with meshes, and the package that `errand new robot` makes of it."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from rover_urdf import write_package

from executive.cli.new_command import render_robot
from plant.robots.urdf_robot.kind import urdf_kind


@pytest.fixture
def rover_urdf(tmp_path):
    return write_package(tmp_path)


@pytest.fixture(scope="session")
def rover_package(tmp_path_factory):
    """Folder with `robot.yaml` of the rover."""
    folder = tmp_path_factory.mktemp("rover")
    render_robot("rover", write_package(folder), folder / "made", packages={})
    return folder / "made/errand_robot_rover"


@pytest.fixture(scope="session")
def rover_kind(rover_package):
    return urdf_kind(rover_package / "robot.yaml")
