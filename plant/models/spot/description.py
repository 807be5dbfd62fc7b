"""Spot's model as URDF text, made of the facts in `spot.yaml` and of primitive shapes.

Visual meshes come from a data package, where it is installed; without it the collision shapes are drawn.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import yaml

FACTS = Path(__file__).with_name("spot.yaml")
CAMERAS = Path(__file__).with_name("cameras.yaml")
GRIPPER_JOINT = "arm_f1x"
LEGS = ("fl", "fr", "hl", "hr")
VISUALS_PACKAGE = "spot_visuals"
_SIDES = {"fl": (1, 1), "fr": (1, -1), "hl": (-1, 1), "hr": (-1, -1)}
_MESH_PREFIX = {"fl": "front_left", "fr": "front_right", "hl": "rear_left", "hr": "rear_right"}


@cache
def spot_facts() -> Mapping[str, Any]:
    """The facts in `spot.yaml`."""
    facts: Mapping[str, Any] = yaml.load(FACTS.read_text(), Loader=yaml.CSafeLoader)
    return facts


def spot_urdf(*, visuals: bool = False) -> str:
    """URDF text of Spot with arm and LiDAR; root link `body`, free.

    With `visuals` they are meshes under `package://spot_visuals/`, else the collision shapes.
    """
    facts = spot_facts()
    robot = ElementTree.Element("robot", name="spot")
    for name, rgba in facts["colours"].items():
        material = ElementTree.SubElement(robot, "material", name=name)
        ElementTree.SubElement(material, "color", rgba=_text(rgba))
    _add_link(robot, "body", facts["body"], visuals=visuals)
    for leg in LEGS:
        _add_leg(robot, leg, facts["legs"], visuals=visuals)
    parent = "body"
    for part in facts["arm"]:
        _add_link(robot, part["link"], part, visuals=visuals)
        _add_joint(robot, part["link"], parent, part["link"], part)
        parent = "arm_wr1" if part["link"] == "arm_wr1" else part["link"]
    _add_lidar(robot, facts["lidar"])
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _text(values: Iterable[float]) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _add_leg(robot: ElementTree.Element, leg: str, facts: Mapping[str, Any], *, visuals: bool) -> None:
    parent = "body"
    for link, name in (("hip", "hip"), ("upper_leg", "uleg"), ("lower_leg", "lleg")):
        part = _mirrored(facts[link], leg, flip_x=link == "hip")
        if link == "lower_leg":
            part["foot"] = facts["foot"]
        part["visuals"] = _leg_visuals(leg, link)
        _add_link(robot, f"{leg}_{name}", part, visuals=visuals)
        _add_joint(robot, f"{leg}_{part['joint']}", parent, f"{leg}_{name}", part)
        parent = f"{leg}_{name}"


def _mirrored(part: Mapping[str, Any], leg: str, *, flip_x: bool) -> dict[str, Any]:
    """A left (front) leg's part for another leg."""
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
    link = ElementTree.SubElement(robot, "link", name=name)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_text(part["com"]))
    ElementTree.SubElement(inertial, "mass", value=str(part["mass"]))
    moments = {key: str(value) for key, value in part["inertia"].items()}
    ElementTree.SubElement(inertial, "inertia", {**moments, "ixy": "0", "ixz": "0", "iyz": "0"})
    shapes = list(_shapes(part))
    for index, (shape, contact) in enumerate(shapes):
        _add_collision(link, f"{name}_{index}", shape, contact)
    if visuals:
        for index, mesh in enumerate(part.get("visuals", ())):
            _add_mesh(link, f"{name}_visual_{index}", mesh)
    else:
        for index, (shape, _) in enumerate(shapes):
            visual = _add_shape(ElementTree.SubElement(link, "visual", name=f"{name}_shape_{index}"), shape)
            ElementTree.SubElement(visual, "material", name="grey")


def _shapes(part: Mapping[str, Any]) -> Iterable[tuple[Mapping[str, Any], Mapping[str, float]]]:
    """Each collision shape of a link with its proximity properties."""
    for shape in part.get("collision", ()):
        yield shape, {}
    if "foot" in part:
        foot = part["foot"]
        yield {"sphere": foot["radius"], "xyz": foot["xyz"]}, _friction(foot["friction"])
    if "pads" in part:
        pads, facts = part["pads"], spot_facts()
        contact = {**_friction(facts["pad_friction"]), "point_contact_stiffness": facts["pad_stiffness_n_m"]}
        for x, z in pads["xz"]:
            for y in pads["y"]:
                yield {"sphere": pads["radius"], "xyz": [x, y, z]}, contact


def _friction(coefficient: float) -> Mapping[str, float]:
    return {"mu_dynamic": coefficient, "mu_static": coefficient}


def _add_shape(element: ElementTree.Element, shape: Mapping[str, Any]) -> ElementTree.Element:
    ElementTree.SubElement(element, "origin", xyz=_text(shape["xyz"]), rpy=_text(shape.get("rpy", (0, 0, 0))))
    geometry = ElementTree.SubElement(element, "geometry")
    if "box" in shape:
        ElementTree.SubElement(geometry, "box", size=_text(shape["box"]))
    elif "cylinder" in shape:
        radius, length = shape["cylinder"]
        ElementTree.SubElement(geometry, "cylinder", radius=str(radius), length=str(length))
    else:
        ElementTree.SubElement(geometry, "sphere", radius=str(shape["sphere"]))
    return element


def _add_collision(
    link: ElementTree.Element, name: str, shape: Mapping[str, Any], contact: Mapping[str, float]
) -> None:
    collision = _add_shape(ElementTree.SubElement(link, "collision", name=name), shape)
    if contact:
        properties = ElementTree.SubElement(collision, "drake:proximity_properties")
        for key, value in contact.items():
            ElementTree.SubElement(properties, f"drake:{key}", value=str(value))


def _add_mesh(link: ElementTree.Element, name: str, mesh: Mapping[str, str]) -> None:
    visual = ElementTree.SubElement(link, "visual", name=name)
    geometry = ElementTree.SubElement(visual, "geometry")
    ElementTree.SubElement(geometry, "mesh", filename=f"package://{VISUALS_PACKAGE}/{mesh['mesh']}")
    ElementTree.SubElement(visual, "material", name=mesh["colour"])


def _add_joint(robot: ElementTree.Element, name: str, parent: str, child: str, part: Mapping[str, Any]) -> None:
    joint = ElementTree.SubElement(robot, "joint", name=name, type="revolute")
    ElementTree.SubElement(joint, "origin", xyz=_text(part["offset"]))
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    ElementTree.SubElement(joint, "axis", xyz=_text(part["axis"]))
    lower, upper = part["range"]
    ElementTree.SubElement(joint, "limit", lower=str(lower), upper=str(upper), effort=str(part["effort"]))
    transmission = ElementTree.SubElement(robot, "transmission", name=f"{name}_transmission")
    ElementTree.SubElement(transmission, "type").text = "transmission_interface/SimpleTransmission"
    ElementTree.SubElement(transmission, "joint", name=name)
    ElementTree.SubElement(transmission, "actuator", name=name)


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
    joint = ElementTree.SubElement(robot, "joint", name="lidar_mount", type="fixed")
    ElementTree.SubElement(joint, "origin", xyz=_text(lidar["xyz"]))
    ElementTree.SubElement(joint, "parent", link="body")
    ElementTree.SubElement(joint, "child", link="lidar")


def arm_joint_names() -> Sequence[str]:
    """The six arm joints from the shoulder on, without the gripper."""
    return tuple(part["link"] for part in spot_facts()["arm"][:-1])


def leg_joint_names(leg: str) -> Sequence[str]:
    """The three joints of a leg: hip x, hip y, knee."""
    return tuple(f"{leg}_{joint}" for joint in ("hx", "hy", "kn"))
