"""Spot's URDF text, built from the parameters in `spot.yaml` and primitive shapes.

Visual meshes come from a data package if it is installed; else the collision shapes are drawn.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from plant.models import urdf
from skills.inputs.yaml_source import read_yaml

FACTS = Path(__file__).with_name("spot.yaml")
CAMERAS = Path(__file__).with_name("cameras.yaml")
GRIPPER_JOINT = "arm_f1x"
HAND_LINK, FINGER_LINK = "arm_wr1", "arm_f1x"
LEGS = ("fl", "fr", "hl", "hr")
VISUALS_PACKAGE = "spot_visuals"
_SIDES = {"fl": (1, 1), "fr": (1, -1), "hl": (-1, 1), "hr": (-1, -1)}
_MESH_PREFIX = {"fl": "front_left", "fr": "front_right", "hl": "rear_left", "hr": "rear_right"}


@cache
def spot_facts() -> Mapping[str, Any]:
    """Parameters in `spot.yaml`."""
    facts: Mapping[str, Any] = read_yaml(FACTS).data
    return facts


def spot_urdf(*, visuals: bool = False, pads: bool = True) -> str:
    """URDF text of Spot with arm and LiDAR; root link `body`, with a floating base.

    With `visuals` it is drawn with meshes under `package://spot_visuals/`, else with the collision shapes. Motion
    planning omits the rubber `pads`, which protrude a few millimetres from the jaws.
    """
    facts = spot_facts()
    robot = ElementTree.Element("robot", name="spot")
    urdf.add_materials(robot, facts["colours"])
    _add_link(robot, "body", facts["body"], visuals=visuals)
    for leg in LEGS:
        _add_leg(robot, leg, facts["legs"], visuals=visuals)
    parent = "body"
    for part in facts["arm"]:
        bare = {key: value for key, value in part.items() if pads or key != "pads"}
        _add_link(robot, part["link"], bare, visuals=visuals)
        urdf.add_joint(robot, part["link"], parent, part["link"], part)
        parent = part["link"]
    _add_lidar(robot, facts["lidar"])
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _add_leg(robot: ElementTree.Element, leg: str, facts: Mapping[str, Any], *, visuals: bool) -> None:
    parent = "body"
    for link, name in (("hip", "hip"), ("upper_leg", "uleg"), ("lower_leg", "lleg")):
        part = _mirrored(facts[link], leg, flip_x=link == "hip")
        if link == "lower_leg":
            part["foot"] = facts["foot"]
        part["visuals"] = _leg_visuals(leg, link)
        _add_link(robot, f"{leg}_{name}", part, visuals=visuals)
        urdf.add_joint(robot, f"{leg}_{part['joint']}", parent, f"{leg}_{name}", part)
        parent = f"{leg}_{name}"


def _mirrored(part: Mapping[str, Any], leg: str, *, flip_x: bool) -> dict[str, Any]:
    """Mirrors a part of the front left leg for another leg."""
    x, y = _SIDES[leg]
    signs = (x if flip_x else 1, y, 1)
    mirrored = dict(part)
    mirrored["offset"] = [s * v for s, v in zip(signs, part["offset"], strict=True)]
    mirrored["com"] = [s * v for s, v in zip(signs, part["com"], strict=True)]
    return mirrored


def _leg_visuals(leg: str, link: str) -> list[dict[str, str]]:
    prefix = _MESH_PREFIX[leg]
    if link == "upper_leg":
        return [
            {"mesh": f"{prefix}_upper_leg_0.obj", "colour": "yellow"},
            {"mesh": f"{prefix}_upper_leg_1.obj", "colour": "black"},
        ]
    return [{"mesh": f"{prefix}_{link}.obj", "colour": "black"}]


def _add_link(robot: ElementTree.Element, name: str, part: Mapping[str, Any], *, visuals: bool) -> None:
    link = urdf.add_link(robot, name, part)
    shapes = list(_shapes(part))
    for index, (shape, contact) in enumerate(shapes):
        urdf.add_collision(link, f"{name}_{index}", shape, contact)
    if visuals:
        for index, mesh in enumerate(part.get("visuals", ())):
            _add_mesh(link, f"{name}_visual_{index}", mesh)
    else:
        for index, (shape, _) in enumerate(shapes):
            urdf.add_visual(link, f"{name}_shape_{index}", shape, "grey")


def _shapes(part: Mapping[str, Any]) -> Iterable[tuple[Mapping[str, Any], Mapping[str, float]]]:
    """Collision shapes of a link with their proximity properties."""
    for shape in part.get("collision", ()):
        yield shape, {}
    if "foot" in part:
        foot = part["foot"]
        yield {"sphere": foot["radius"], "xyz": foot["xyz"]}, urdf.friction(foot["friction"])
    if "pads" in part:
        facts = spot_facts()
        yield from urdf.pad_shapes(part["pads"], facts["pad_friction"], facts["pad_stiffness_n_m"])


def _add_mesh(link: ElementTree.Element, name: str, mesh: Mapping[str, str]) -> None:
    visual = ElementTree.SubElement(link, "visual", name=name)
    geometry = ElementTree.SubElement(visual, "geometry")
    ElementTree.SubElement(geometry, "mesh", filename=f"package://{VISUALS_PACKAGE}/{mesh['mesh']}")
    ElementTree.SubElement(visual, "material", name=mesh["colour"])


def _add_lidar(robot: ElementTree.Element, lidar: Mapping[str, Any]) -> None:
    radius, height, mass = lidar["radius"], lidar["height"], lidar["mass"]
    around, along = mass * (3 * radius**2 + height**2) / 12, mass * radius**2 / 2
    mast = lidar["mast"]
    part = {
        "mass": mass,
        "com": (0, 0, 0),
        "inertia": {"ixx": around, "iyy": around, "izz": along},
        "collision": [
            {"cylinder": (radius, height), "xyz": (0, 0, 0)},
            {"box": mast, "xyz": (0, 0, -(height + mast[2]) / 2)},
        ],
    }
    _add_link(robot, "lidar", part, visuals=False)
    urdf.add_fixed(robot, "lidar_mount", "body", "lidar", lidar["xyz"])


def arm_joint_names() -> Sequence[str]:
    """Names of the six arm joints from the shoulder on, without the gripper."""
    return tuple(part["link"] for part in spot_facts()["arm"][:-1])


def leg_joint_names(leg: str) -> Sequence[str]:
    """Names of the three joints of a leg: hip x, hip y, knee."""
    return tuple(f"{leg}_{joint}" for joint in ("hx", "hy", "kn"))
