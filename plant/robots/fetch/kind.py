"""Fetch as a kind of robot: `robot.urdf`, and `robot.yaml`, which names its parts."""

from pathlib import Path

from plant.robots.urdf_robot.kind import urdf_kind

FETCH = urdf_kind(Path(__file__).with_name("robot.yaml"))
