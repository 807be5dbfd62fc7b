"""Fetch's URDF text, made from the facts in `fetch.yaml` and primitive shapes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from pydrake.math import RollPitchYaw, RotationMatrix

from plant.models import urdf
from plant.sensors.camera_spec import CameraSpec
from skills.inputs.yaml_source import read_yaml

FACTS = Path(__file__).with_name("fetch.yaml")
BASE_LINK, BODY_LINK, CASTERS_LINK, HAND_LINK, HEAD_LINK = "base_link", "body", "casters", "wrist_roll", "head_tilt"
WHEELS = ("left_wheel", "right_wheel")
FINGERS = ("left_finger", "right_finger")
LIFT_JOINT = "torso_lift"
HEAD_JOINTS = ("head_pan", "head_tilt")
HEAD_CAMERA = "head"


@cache
def fetch_facts() -> Mapping[str, Any]:
    """Facts in `fetch.yaml`."""
    facts: Mapping[str, Any] = read_yaml(FACTS).data
    return facts


@cache
def head_camera() -> CameraSpec:
    """Camera of the head: a colour picture, and depth of the same view."""
    camera = fetch_facts()["camera"]
    width, height = camera["width"], camera["height"]
    focal = width / 2.0 / math.tan(math.radians(camera["horizontal_field_of_view_deg"]) / 2.0)
    ahead = RotationMatrix(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]))
    rpy = np.degrees(RollPitchYaw(ahead).vector())
    return CameraSpec(
        name=HEAD_CAMERA,
        link=camera["link"],
        colour=True,
        rpy_deg=(float(rpy[0]), float(rpy[1]), float(rpy[2])),
        xyz_m=tuple(camera["xyz"]),
        width=width,
        height=height,
        fx=focal,
        fy=focal,
        cx=(width - 1) / 2.0,
        cy=(height - 1) / 2.0,
        depth_shrink=camera["depth_shrink"],
        depth_range_m=tuple(camera["depth"]),
    )


def fetch_urdf(*, root: str = BASE_LINK, pads: bool = True) -> str:
    """URDF text of Fetch with the free root link `base_link`, or `body`, below which the base then hangs.

    The lift's joint reads the same either way: 0 with the torso down. Motions are planned without the rubber `pads`.
    """
    facts = fetch_facts()
    robot = ElementTree.Element("robot", name="fetch")
    urdf.add_materials(robot, facts["colours"])
    _add(robot, BASE_LINK, _base(facts))
    _add(robot, BODY_LINK, facts["body"])
    _add_lift(robot, facts["lift"], root)
    _add_casters(robot, facts["casters"])
    for name, side in zip(WHEELS, (1, -1), strict=True):
        _add_wheel(robot, name, side, facts["wheel"])
    for chain in (facts["head"], facts["arm"]):
        parent = BODY_LINK
        for part in chain:
            _add(robot, part["link"], part)
            kind = "continuous" if part["range"] is None else "revolute"
            urdf.add_joint(robot, part["link"], parent, part["link"], part, kind)
            parent = part["link"]
    for name, side in zip(FINGERS, (1, -1), strict=True):
        _add_finger(robot, name, side, facts["finger"], pads=pads)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")


def _base(facts: Mapping[str, Any]) -> Mapping[str, Any]:
    """Facts of the base and its column as one link."""
    base, column = facts["base"], facts["column"]
    offset = np.array(column["xyz"])
    parts = [({**base, "mass": base["mass"] - facts["casters"]["mass"]}, np.zeros(3)), (column, offset)]
    mass = sum(part["mass"] for part, _ in parts)
    com = sum(part["mass"] * (np.array(part["com"]) + at) for part, at in parts) / mass
    moments = np.zeros(3)
    for part, at in parts:
        x, y, z = np.array(part["com"]) + at - com
        own = [part["inertia"][key] for key in ("ixx", "iyy", "izz")]
        moments += np.array(own) + part["mass"] * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    return {
        "mass": mass,
        "com": com.tolist(),
        "inertia": dict(zip(("ixx", "iyy", "izz"), moments.tolist(), strict=True)),
        "shapes": [*base["shapes"], *(_moved(shape, offset) for shape in column["shapes"])],
        "visuals": [*base["visuals"], *(_moved(shape, offset) for shape in column["visuals"])],
    }


def _moved(shape: urdf.Shape, offset: Any) -> urdf.Shape:
    return {**shape, "xyz": [a + float(b) for a, b in zip(shape["xyz"], offset, strict=True)]}


def _add(robot: ElementTree.Element, name: str, part: Mapping[str, Any]) -> None:
    """Adds a link with its collision and visual shapes."""
    link = urdf.add_link(robot, name, part)
    for index, shape in enumerate(part["shapes"]):
        urdf.add_collision(link, f"{name}_{index}", shape, {})
    for index, shape in enumerate(part["visuals"]):
        urdf.add_visual(link, f"{name}_visual_{index}", shape, shape["colour"])
    if "pads" in part:
        facts = fetch_facts()
        pads = urdf.pad_shapes(part["pads"], facts["pad_friction"], facts["pad_stiffness_n_m"])
        for index, (shape, contact) in enumerate(pads):
            urdf.add_collision(link, f"{name}_pad_{index}", shape, contact)


def _add_casters(robot: ElementTree.Element, casters: Mapping[str, Any]) -> None:
    """Adds the casters as a link of their own, because their contact with the floor is no collision."""
    radius = casters["radius"]
    link = urdf.add_link(robot, CASTERS_LINK, {**casters, "com": (0, 0, radius)})
    urdf.add_fixed(robot, CASTERS_LINK, BASE_LINK, CASTERS_LINK, (0, 0, 0))
    for index, (x, y) in enumerate(casters["places"]):
        shape = {"sphere": radius, "xyz": [x, y, radius + casters["lift"]]}
        urdf.add_collision(link, f"caster_{index}", shape, urdf.friction(0.0))
        urdf.add_visual(link, f"caster_visual_{index}", shape, "black")


def _add_wheel(robot: ElementTree.Element, name: str, side: int, wheel: Mapping[str, Any]) -> None:
    x, y, z = wheel["offset"]
    part = {
        **wheel,
        "com": (0, 0, 0),
        "offset": (x, side * y, z),
        "axis": (0, 1, 0),
    }
    link = urdf.add_link(robot, name, part)
    ball = {"sphere": wheel["radius"], "xyz": (0, 0, 0)}
    urdf.add_collision(link, f"{name}_0", ball, urdf.friction(wheel["friction"]))
    tyre = {"cylinder": (wheel["radius"], wheel["width"]), "xyz": (0, 0, 0), "rpy": (math.pi / 2, 0, 0)}
    urdf.add_visual(link, f"{name}_visual_0", tyre, "black")
    urdf.add_joint(robot, name, BASE_LINK, name, part, "continuous")


def _add_lift(robot: ElementTree.Element, lift: Mapping[str, Any], root: str) -> None:
    up = 1 if root == BASE_LINK else -1
    parent, child = (BASE_LINK, BODY_LINK) if root == BASE_LINK else (BODY_LINK, BASE_LINK)
    part = {**lift, "offset": (0, 0, up * lift["height"]), "axis": (0, 0, up)}
    urdf.add_joint(robot, lift["joint"], parent, child, part, "prismatic")


def _add_finger(robot: ElementTree.Element, name: str, side: int, finger: Mapping[str, Any], *, pads: bool) -> None:
    """Adds a finger; the finger of side -1 is mirrored along z, the direction of closing."""
    part = {
        **{key: value for key, value in finger.items() if key != "pads"},
        "com": _mirrored(finger["com"], side),
        "shapes": [{**shape, "xyz": _mirrored(shape["xyz"], side)} for shape in finger["shapes"]],
        "visuals": [{**shape, "xyz": _mirrored(shape["xyz"], side)} for shape in finger["visuals"]],
        **({"pads": [_mirrored_grid(grid, side) for grid in finger["pads"]]} if pads else {}),
        "axis": (0, 0, side),
        "range": (0.0, finger["travel"]),
    }
    _add(robot, name, part)
    urdf.add_joint(robot, name, HAND_LINK, name, part, "prismatic")


def _mirrored_grid(grid: Mapping[str, Any], side: int) -> Mapping[str, Any]:
    return {**grid, "xz": [[x, side * z] for x, z in grid["xz"]]}


def _mirrored(xyz: Sequence[float], side: int) -> list[float]:
    x, y, z = xyz
    return [x, y, side * z]


def arm_joint_names() -> Sequence[str]:
    """Names of the seven arm joints from the shoulder on, without the gripper."""
    return tuple(part["link"] for part in fetch_facts()["arm"])
