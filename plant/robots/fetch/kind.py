"""Fetch as a kind of robot: its capabilities, and how it is built in a plant."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from plant.robots.fetch.description import (
    BASE_LINK,
    BODY_LINK,
    CASTERS_LINK,
    FACTS,
    FINGERS,
    HAND_LINK,
    HEAD_CAMERA,
    HEAD_JOINTS,
    LIFT_JOINT,
    WHEELS,
    arm_joint_names,
    fetch_facts,
    fetch_urdf,
    head_camera,
)
from plant.robots.robot_kind import PlacedRobot, PlantRobot, RobotBody, RobotKind, SensorOptions
from skills.robot import (
    ArmCapabilities,
    BaseKind,
    CameraCapabilities,
    Capabilities,
    GripperCapabilities,
    GripperKind,
    HeadCapabilities,
    Mount,
)

if TYPE_CHECKING:
    from pydrake.multibody.plant import MultibodyPlant

_CORNERS = 12


@cache
def fetch_capabilities() -> Capabilities:
    """Capabilities of Fetch."""
    facts = fetch_facts()
    body, arm, head = facts["capabilities"], facts["arm"], facts["head"]
    arm_space = facts["arm_space"]
    height_m, (down_m, up_m) = facts["lift"]["height"], facts["lift"]["range"]
    return Capabilities(
        footprint_m=_round(body["footprint_radius"]),
        max_speed_m_s=body["max_speed"],
        max_turn_rate_rad_s=body["max_turn_rate"],
        standing_height_m=height_m + body["travelling_lift"],
        height_range_m=(height_m + down_m, height_m + up_m),
        pitch_range_rad=(0.0, 0.0),
        arm=ArmCapabilities(
            tuple(arm_joint_names()),
            body["max_reach"],
            tuple(facts["stowed"][part["link"]] for part in arm),
            body["max_payload"],
            standing_m=tuple(arm_space["standing"]),
            nearer_m=tuple(arm_space["nearer"]),
            carry_x_m=tuple(arm_space["carry_x"]),
            carry_z_m=tuple(arm_space["carry_z"]),
            carry_best_x_m=arm_space["carry_best_x"],
            tuck_x_m=tuple(arm_space["tuck_x"]),
        ),
        gripper=_gripper(),
        cameras=(CameraCapabilities(HEAD_CAMERA, head_camera().X_link_camera(), Mount.HEAD),),
        description=fetch_urdf(root="body", pads=False),
        base_kind=BaseKind.DIFFERENTIAL,
        lift_joint=LIFT_JOINT,
        lidar_height_m=facts["lidar"]["xyz"][2],
        head=HeadCapabilities(
            HEAD_JOINTS,
            tuple(head[0]["offset"]),
            tuple(head[1]["offset"]),
            tuple(head[0]["range"]),
            tuple(head[1]["range"]),
        ),
    )


def _gripper() -> GripperCapabilities:
    gripper = fetch_facts()["gripper"]
    return GripperCapabilities(
        finger_joints=tuple((finger, 0.5) for finger in FINGERS),
        widest=gripper["max_opening"],
        max_opening_m=gripper["max_opening"],
        max_force_n=gripper["max_force"],
        depth_m=gripper["depth"],
        kind=GripperKind.PARALLEL,
        **{f"{name}_m": value for name, value in gripper["in_hand"].items()},
    )


def _round(radius_m: float) -> tuple[tuple[float, float], ...]:
    """Polygon that circumscribes a circle, counter-clockwise."""
    out_m = radius_m / math.cos(math.pi / _CORNERS)
    angles = [(k + 0.5) * math.tau / _CORNERS for k in range(_CORNERS)]
    return tuple((out_m * math.cos(a), out_m * math.sin(a)) for a in angles)


def _add(plant: MultibodyPlant, robot: PlacedRobot, visuals: bool) -> RobotBody:
    from plant.robots.fetch.model import FetchModel

    return FetchModel(plant, robot)


def _drive(body: RobotBody, options: SensorOptions) -> PlantRobot:
    from plant.robots.fetch.model import FetchModel
    from plant.robots.fetch.robot import FetchRobot

    assert isinstance(body, FetchModel)
    return FetchRobot(body, options)


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
