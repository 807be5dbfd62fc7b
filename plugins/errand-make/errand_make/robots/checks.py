"""Checks of a maker's URDF: joints that mimic or stand still, limits of driven joints, and leftovers of xacro."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Final
from xml.etree.ElementTree import Element

from plant.robots.urdf_robot.urdf_file import UrdfFile
from skills.inputs.errors import listing, suggestion

_XACRO: Final = re.compile(r"<xacro:[\w.]+|\$\{[^}\"']*\}?|\$\([^)\"']*\)?")
_COMMENT: Final = re.compile(r"<!--.*?-->", re.DOTALL)
LONGEST_SLIDE_M: Final = 5.0
_STILL: Final = 1e-3
"""Limit (rad, m) below which a joint cannot be seen to move."""


def first_xacro(text: str) -> tuple[int, str]:
    """Line (from 1) and text of the first element or substitution of xacro outside comments; 1 and "" without any."""
    bare = _COMMENT.sub(lambda comment: "\n" * comment.group().count("\n"), text)
    found = _XACRO.search(bare)
    return (1, "") if found is None else (bare.count("\n", 0, found.start()) + 1, found.group()[:60])


def check_mimics(urdf: UrdfFile) -> None:
    """Raises InputError for a joint that mimics itself, or a joint that does not exist."""
    for element in urdf.robot.findall("joint"):
        mimic, name = element.find("mimic"), element.get("name", "")
        other = None if mimic is None else mimic.get("joint", "")
        if other is not None and (other == name or other not in urdf.joints):
            others = [each for each, joint in urdf.joints.items() if joint.moves and each != name]
            why = "which is itself" if other == name else "which does not exist"
            what, hint = f"joint {name} mimics joint '{other}', {why}", suggestion(other, others)
            raise urdf.error(element, what, hint or "name a joint of the file, or remove <mimic>")


def fix_still_joints(urdf: UrdfFile) -> list[str]:
    """Gives joints with limits of 0 to 0, as force sensors have them, the type fixed; returns their names.

    Joints that mimic others keep their type. Raises InputError when no joint is left that moves.
    """
    elements = {each.get("name", ""): each for each in urdf.robot.findall("joint")}
    still = list[str]()
    for name, joint in urdf.joints.items():
        limit = elements[name].find("limit")
        given = limit is not None and {"lower", "upper"} <= limit.attrib.keys()
        if given and joint.kind != "continuous" and joint.moves and not joint.mimics:
            still += [name] if max(abs(joint.lower), abs(joint.upper)) < _STILL else []
    if still and not any(each.moves for name, each in urdf.joints.items() if name not in still):
        what = f"no joint moves: lower and upper of {listing(still)} are both 0"
        raise urdf.error(elements[still[0]], what, "write the ranges of the joints that move")
    for name in still:
        elements[name].set("type", "fixed")
    return still


def check_limits(urdf: UrdfFile, driven: Collection[str]) -> None:
    """Raises InputError for the first driven joint with impossible limits; missing limits are not checked."""
    elements = {each.get("name", ""): each for each in urdf.robot.findall("joint")}
    for name in driven:
        limit = elements[name].find("limit")
        if limit is not None and (fault := _limit_fault(urdf, name, limit)) is not None:
            raise urdf.error(limit, f"joint {name}: {fault[0]}", fault[1])


def _limit_fault(urdf: UrdfFile, name: str, limit: Element) -> tuple[str, str] | None:
    """What is wrong with the limits of a joint, and its mend; None when nothing is."""
    joint = urdf.joints[name]
    if joint.kind != "continuous" and {"lower", "upper"} <= limit.attrib.keys():
        if joint.lower > joint.upper:
            return f"lower {joint.lower:g} is above upper {joint.upper:g}", "exchange the two"
        if joint.lower == joint.upper:
            what = f"lower and upper are both {joint.lower:g}, so it cannot move"
            return what, "write its range, or make it a joint of type fixed"
        if joint.kind == "prismatic" and joint.upper - joint.lower > LONGEST_SLIDE_M:
            return f"it slides from {joint.lower:g} to {joint.upper:g} m, probably millimetres", "write metres"
    for key in ("effort", "velocity"):
        value = getattr(joint, key)
        if key in limit.attrib and value <= 0.0:
            return f"its limit of {key} is {value:g}, so it cannot move", f"write its largest {key}, above 0"
    return None
