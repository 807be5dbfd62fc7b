"""Spot as a kind of robot: its capabilities, and how it is built in a plant."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from plant.robots.robot_kind import PlacedRobot, PlantRobot, RobotBody, RobotKind, SensorOptions
from plant.robots.spot.description import (
    CAMERAS,
    FACTS,
    FINGER_LINK,
    GRIPPER_JOINT,
    HAND_LINK,
    LEGS,
    spot_facts,
    spot_urdf,
)
from plant.sensors.camera_spec import load_cameras
from skills.robot import ArmCapabilities, CameraCapabilities, Capabilities, GripperCapabilities, Mount

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant


@cache
def spot_capabilities() -> Capabilities:
    """Capabilities of Spot with its arm."""
    facts = spot_facts()
    body, gripper = facts["capabilities"], facts["gripper"]
    arm_names = tuple(part["link"] for part in facts["arm"][:-1])
    return Capabilities(
        footprint_m=tuple((float(x), float(y)) for x, y in body["footprint"]),
        max_speed_m_s=body["max_speed"],
        max_turn_rate_rad_s=body["max_turn_rate"],
        standing_height_m=body["standing_height"],
        height_range_m=tuple(body["height_range"]),
        pitch_range_rad=tuple(body["pitch_range"]),
        arm=ArmCapabilities(
            arm_names,
            body["max_reach"],
            tuple(facts["stowed"][name] for name in arm_names),
            body["max_payload"],
        ),
        gripper=GripperCapabilities(
            finger_joints=((GRIPPER_JOINT, -1.0),),
            widest=gripper["open"],
            max_opening_m=gripper["max_opening"],
            max_force_n=gripper["max_force"],
            depth_m=gripper["depth"],
            **{f"{name}_m": value for name, value in gripper["in_hand"].items()},
        ),
        cameras=tuple(
            CameraCapabilities(name, spec.X_link_camera(), Mount.BODY if spec.link == "body" else Mount.HAND)
            for name, spec in load_cameras(CAMERAS).items()
        ),
        description=spot_urdf(pads=False),
        lidar_height_m=body["standing_height"] + facts["lidar"]["xyz"][2],
    )


def _add(plant: MultibodyPlant, robot: PlacedRobot, visuals: bool) -> RobotBody:
    from plant.robots.spot.model import SpotModel

    return SpotModel(plant, robot, visuals)


def _drive(body: RobotBody, options: SensorOptions) -> PlantRobot:
    from plant.robots.spot.model import SpotModel
    from plant.robots.spot.robot import SpotRobot

    assert isinstance(body, SpotModel)
    return SpotRobot(body, options)


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
