"""Fetch as a kind of robot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from plant.fetch.capabilities import fetch_capabilities
from plant.fetch.wheels import WheelLimits
from plant.kinds import BodyOptions, PlantRobot, RobotBody, RobotKind, SensorOptions
from plant.models.fetch.description import (
    BASE_LINK,
    BODY_LINK,
    CASTERS_LINK,
    FACTS,
    FINGERS,
    HAND_LINK,
    HEAD_JOINTS,
    WHEELS,
)

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant


def _add(plant: MultibodyPlant, name: str, options: BodyOptions) -> RobotBody:
    from plant.fetch.model import FetchModel

    limits = options.locomotion if isinstance(options.locomotion, WheelLimits) else WheelLimits()
    return FetchModel(plant, name, kind=FETCH, limits=limits)


def _drive(body: RobotBody, options: SensorOptions) -> PlantRobot:
    from plant.fetch.model import FetchModel
    from plant.fetch.robot import FetchRobot
    from plant.fetch.sensing import FetchSensors

    assert isinstance(body, FetchModel)
    return FetchRobot(body, FetchSensors(body, options), options.context)


FETCH = RobotKind(
    name="fetch",
    gripper_links=(HAND_LINK, *FINGERS),
    trunk_links=(BASE_LINK, BODY_LINK, *HEAD_JOINTS),
    leg_links=(*WHEELS, CASTERS_LINK),
    facts=FACTS,
    capabilities=fetch_capabilities,
    add=_add,
    drive=_drive,
    stack=Path(__file__).with_name("stack.yaml"),
)
