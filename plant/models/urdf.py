"""Builds parts of URDF text from parameters: links with primitive shapes, joints with motors."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any
from xml.etree import ElementTree

Shape = Mapping[str, Any]
"""A `box`, `cylinder` (radius, length) or `sphere` (radius) with `xyz` and, for a rotated shape, `rpy`."""


def text(values: Iterable[float]) -> str:
    """Formats numbers as the value of an attribute."""
    return " ".join(f"{value:.9g}" for value in values)


def add_materials(robot: ElementTree.Element, colours: Mapping[str, Sequence[float]]) -> None:
    """Adds materials by name."""
    for name, rgba in colours.items():
        ElementTree.SubElement(ElementTree.SubElement(robot, "material", name=name), "color", rgba=text(rgba))


def add_link(robot: ElementTree.Element, name: str, part: Mapping[str, Any]) -> ElementTree.Element:
    """Adds a link with its `mass`, `com` and `inertia`."""
    link = ElementTree.SubElement(robot, "link", name=name)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=text(part["com"]))
    ElementTree.SubElement(inertial, "mass", value=str(part["mass"]))
    moments = {key: str(value) for key, value in part["inertia"].items()}
    ElementTree.SubElement(inertial, "inertia", {**moments, "ixy": "0", "ixz": "0", "iyz": "0"})
    return link


def add_shape(element: ElementTree.Element, shape: Shape) -> ElementTree.Element:
    """Adds the pose and geometry of a shape to a `visual` or `collision`."""
    ElementTree.SubElement(element, "origin", xyz=text(shape["xyz"]), rpy=text(shape.get("rpy", (0, 0, 0))))
    geometry = ElementTree.SubElement(element, "geometry")
    if "box" in shape:
        ElementTree.SubElement(geometry, "box", size=text(shape["box"]))
    elif "cylinder" in shape:
        radius, length = shape["cylinder"]
        ElementTree.SubElement(geometry, "cylinder", radius=str(radius), length=str(length))
    else:
        ElementTree.SubElement(geometry, "sphere", radius=str(shape["sphere"]))
    return element


def add_collision(link: ElementTree.Element, name: str, shape: Shape, contact: Mapping[str, float]) -> None:
    """Adds a collision shape with its proximity properties to a link."""
    collision = add_shape(ElementTree.SubElement(link, "collision", name=name), shape)
    if contact:
        properties = ElementTree.SubElement(collision, "drake:proximity_properties")
        for key, value in contact.items():
            ElementTree.SubElement(properties, f"drake:{key}", value=str(value))


def add_visual(link: ElementTree.Element, name: str, shape: Shape, material: str) -> None:
    """Adds a visual shape to a link."""
    visual = add_shape(ElementTree.SubElement(link, "visual", name=name), shape)
    ElementTree.SubElement(visual, "material", name=material)


def friction(coefficient: float) -> Mapping[str, float]:
    """Proximity properties of a dry surface."""
    return {"mu_dynamic": coefficient, "mu_static": coefficient}


def pad_shapes(
    pads: Sequence[Mapping[str, Any]], coefficient: float, stiffness_n_m: float
) -> Iterable[tuple[Shape, Mapping[str, float]]]:
    """Rubber pads: grids of spheres of a `radius` at each of `xz` and `y`, each with its proximity properties."""
    contact = {**friction(coefficient), "point_contact_stiffness": stiffness_n_m}
    for grid in pads:
        for (x, z), y in itertools.product(grid["xz"], grid["y"]):
            yield {"sphere": grid["radius"], "xyz": [x, y, z]}, contact


def add_joint(
    robot: ElementTree.Element, name: str, parent: str, child: str, part: Mapping[str, Any], kind: str = "revolute"
) -> None:
    """Adds a joint with a motor: `offset`, `axis`, `range` (unless continuous), `effort` and optionally `rpy`."""
    joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    ElementTree.SubElement(joint, "origin", xyz=text(part["offset"]), rpy=text(part.get("rpy", (0, 0, 0))))
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    ElementTree.SubElement(joint, "axis", xyz=text(part["axis"]))
    ends = {} if kind == "continuous" else dict(zip(("lower", "upper"), map(str, part["range"]), strict=True))
    ElementTree.SubElement(joint, "limit", ends, effort=str(part["effort"]))
    transmission = ElementTree.SubElement(robot, "transmission", name=f"{name}_transmission")
    ElementTree.SubElement(transmission, "type").text = "transmission_interface/SimpleTransmission"
    ElementTree.SubElement(transmission, "joint", name=name)
    ElementTree.SubElement(transmission, "actuator", name=name)


def add_fixed(robot: ElementTree.Element, name: str, parent: str, child: str, xyz: Sequence[float]) -> None:
    """Adds a fixed joint."""
    joint = ElementTree.SubElement(robot, "joint", name=name, type="fixed")
    ElementTree.SubElement(joint, "origin", xyz=text(xyz))
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
