"""Kind of robot built from a URDF and a `robot.yaml`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from plant.robots.robot_kind import PlacedRobot, PlantRobot, RobotBody, RobotKind, SensorOptions
from plant.robots.urdf_robot.description import Description

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant


def urdf_kind(path: Path) -> RobotKind:
    """Returns the kind of robot that a `robot.yaml` describes. Raises InputError at the location in its files."""
    description = Description(path)

    def add(plant: MultibodyPlant, robot: PlacedRobot, visuals: bool) -> RobotBody:
        from plant.robots.urdf_robot.robot import FloatingBody
        from plant.robots.urdf_robot.wheeled import WheeledBody

        rolls = description.file.base.wheels is not None
        return (WheeledBody if rolls else FloatingBody)(plant, robot, description)

    def drive(body: RobotBody, options: SensorOptions) -> PlantRobot:
        from plant.robots.urdf_robot.robot import FloatingBody, FloatingRobot
        from plant.robots.urdf_robot.wheeled import WheeledBody, WheeledRobot

        if isinstance(body, WheeledBody):
            return WheeledRobot(body, options)
        assert isinstance(body, FloatingBody)
        return FloatingRobot(body, options)

    stack = path.with_name("stack.yaml")
    return RobotKind(
        name=description.file.name,
        gripper_links=description.gripper_links,
        trunk_links=description.trunk_links,
        leg_links=description.wheel_links,
        facts=path,
        capabilities=lambda: description.capabilities,
        add=add,
        drive=drive,
        stack=stack if stack.is_file() else None,
    )
