"""Spot as a kind of robot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from plant.kinds import BodyOptions, PlantRobot, RobotBody, RobotKind, SensorOptions
from plant.models.spot.description import FACTS, FINGER_LINK, HAND_LINK, LEGS
from plant.spot.capabilities import spot_capabilities

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant


def _add(plant: MultibodyPlant, name: str, options: BodyOptions) -> RobotBody:
    from plant.locomotion.floating_base import FloatingBaseLimits
    from plant.spot.model import SpotModel

    limits = options.locomotion if isinstance(options.locomotion, FloatingBaseLimits) else None
    return SpotModel(plant, name, kind=SPOT, visuals=options.visuals, carried=options.carried, limits=limits)


def _drive(body: RobotBody, options: SensorOptions) -> PlantRobot:
    from plant.spot.model import SpotModel
    from plant.spot.robot import SpotRobot
    from plant.spot.sensing import SpotSensors

    assert isinstance(body, SpotModel)
    return SpotRobot(body, SpotSensors(body, options), options.context)


SPOT = RobotKind(
    name="spot",
    gripper_links=(HAND_LINK, FINGER_LINK),
    trunk_links=("body", "lidar"),
    leg_links=tuple(f"{leg}_{part}" for leg in LEGS for part in ("hip", "uleg", "lleg")),
    facts=FACTS,
    capabilities=spot_capabilities,
    add=_add,
    drive=_drive,
)
