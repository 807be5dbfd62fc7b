"""Wheels, casters, legs and rotors of a base by structure, and how it drives."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

import numpy as np

from errand_make.robots.tree import TURNS, KinematicTree
from plant.robots.urdf_robot.urdf_file import UrdfJoint
from skills.inputs.errors import listing
from skills.robot import FloatArray

_ROUND: Final = 0.85
"""Least share of a wheel's radius to which it reaches on each side of its axis."""
_GROUND_M: Final = 0.03
_MOST_CARRIERS: Final = 2
"""Most joints between the base and a wheel: a swivel, or rocker and bogie."""
_TRAIL: Final = 0.1
"""Least trail of a caster over its wheel's radius."""
_LEGS: Final = 4
_ANGLES_RAD: Final = (0.0, math.pi / 2.0, -math.pi / 2.0, math.pi)
_ROLLERS: Final = re.compile(r"mecanum|omni_?(wheel|base|drive)|swedish|planar_move", re.IGNORECASE)
_DRIVEN: Final = re.compile(r"planar_?move|(diff(erential)?|skid|omni)_?(drive|steer)", re.IGNORECASE)
"""Plugins by which a simulator drives a base over the floor."""
_MOST_LEG: Final = 3
"""Most joints of a leg that lies at zero."""
_PROPELLER: Final = re.compile(r"(^|_)(prop|propeller|thruster)s?(_|\d|$)", re.IGNORECASE)
_ROTOR: Final = re.compile(r"(^|_)rotors?(_|\d|$)", re.IGNORECASE)
"""Names of propellers, or of rotors of motors."""
_FLIES: Final = re.compile(r"(quad|multi|hexa|octo)_?(rotor|copter)|(^|_)(drone|uav)(_|$)", re.IGNORECASE)
_ABOVE: Final = 0.2
"""Least height of a rotor above the ground, as a part of the robot's."""


class Drive(Enum):
    """Kind of motion of a base over the floor."""

    AXLE = "axle"
    STEERED = "steered"
    ROLLERS = "rollers"
    SWERVE = "swerve"
    LEGS = "legs"
    ROTORS = "rotors"
    FREE = "free"
    NOTHING = "nothing"


@dataclass(frozen=True)
class Wheel:
    """Wheel on a joint; `swivel` is the vertical joint that carries it, and `trail_m` its distance behind that.

    `is_round` is False for a shape that is not round about the joint's axis.
    """

    joint: UrdfJoint
    radius_m: float
    p_B: FloatArray
    axis_B: FloatArray
    swivel: UrdfJoint | None = None
    trail_m: float = 0.0
    is_round: bool = True

    @property
    def is_caster(self) -> bool:
        """True for a wheel that trails behind its swivel."""
        return self.swivel is not None and self.trail_m > _TRAIL * self.radius_m


def find_wheels(tree: KinematicTree) -> tuple[Wheel, ...]:
    """Joints that turn about a horizontal axis, and whose round body touches the ground."""
    found = [wheel for joint in tree.joint_of.values() if (wheel := _wheel(tree, joint)) is not None]
    if not found:
        return ()
    ground_m = min(float(each.p_B[2]) - each.radius_m for each in found)
    low = tuple(each for each in found if float(each.p_B[2]) - each.radius_m < ground_m + _GROUND_M)
    return low if len(low) > 1 else ()


def _wheel(tree: KinematicTree, joint: UrdfJoint) -> Wheel | None:
    rollers, turns = tree.after(joint.child), _is_endless(joint) and not _PROPELLER.search(joint.child)
    if not turns or not tree.is_horizontal(joint) or (rollers and len(rollers) < 4):
        return None
    links = [link for each in tree.below(joint) for link in tree.links_of[each.child]]
    p_B, axis_B, points = tree.place(joint), tree.axis(joint), tree.points(links)
    if not len(points):
        return None
    offset = points - p_B
    across = np.linalg.norm(offset - np.outer(offset @ axis_B, axis_B), axis=1)
    radius_m, below_m = float(across.max()), -float(offset[:, 2].min())
    if radius_m < _GROUND_M / 3.0 or np.ptp(offset @ axis_B) > 4.0 * radius_m:
        return None
    is_round = _least_share(offset, axis_B) > _ROUND
    level = float(offset[:, 2].max()) > _ROUND * below_m
    if not is_round and (tree.before(joint) or rollers or not level or joint.kind != "continuous"):
        return None
    p_B = p_B + axis_B * float(np.mean([np.max(offset @ axis_B), np.min(offset @ axis_B)]))
    carriers = tree.before(joint)
    turning = [each for each in carriers if each.kind in TURNS]
    swivel = turning[-1] if turning and tree.is_vertical(turning[-1]) else None
    if len(turning) > _MOST_CARRIERS:
        return None
    trail_m = 0.0
    if swivel is not None:
        ahead = np.cross(axis_B, [0.0, 0.0, 1.0])
        trail_m = abs(float((p_B - tree.place(swivel)) @ ahead))
    return Wheel(joint, below_m, p_B, axis_B, swivel, trail_m, is_round)


def standing_legs(tree: KinematicTree) -> dict[str, float]:
    """Positions of the first joints of four or more chains at which these reach lowest; empty for fewer chains."""
    chains = [each for each in tree.after(tree.root) if len(tree.below(each)) >= 2 and each.kind in TURNS]
    if len(chains) < _LEGS or any(tree.depth(each) > _MOST_LEG for each in chains):
        return {}

    def low_m(joint: UrdfJoint, angle: float) -> float:
        points = replace(tree, posture={joint.name: angle}).points(tree.links_below(joint))
        return round(float(points[:, 2].min(initial=0.0)), 3)

    return {each.name: min(_ANGLES_RAD, key=lambda angle: low_m(each, each.clipped(angle))) for each in chains}


def _least_share(offset: FloatArray, axis_B: FloatArray) -> float:
    """Least distance to which points (N, 3) about a wheel's axis reach up, down, ahead or back, over the largest."""
    ahead, up = np.cross(axis_B, [0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0])
    reached = [float((offset @ way).max()) for way in (ahead, -ahead, up, -up)]
    return min(reached) / max(reached)


def find_legs(tree: KinematicTree) -> tuple[UrdfJoint, ...]:
    """First joints of the chains on the base that touch the ground, at least two; empty when there are none."""
    chains = [each for each in tree.after(tree.root) if len(tree.below(each)) >= 2]
    points = {each.name: tree.points(tree.links_below(each)) for each in chains}
    lows = {each.name: float(points[each.name][:, 2].min()) for each in chains if len(points[each.name])}
    own = tree.body_points(tree.root)
    ground_m = min([*lows.values(), math.inf])
    if len(own) and float(own[:, 2].min()) < ground_m + _GROUND_M:
        return ()
    height_m = float(np.ptp(tree.points(tree.urdf.links)[:, 2])) if lows else 0.0
    legs = tuple(each for each in chains if lows.get(each.name, math.inf) < ground_m + max(_GROUND_M, 0.1 * height_m))
    return legs if len(legs) >= 2 else ()


def has_fixed_wheels(tree: KinematicTree) -> bool:
    """True for a base that stands on the round shapes of several links, whose joints its file does not move."""
    points = {link: tree.points([link]) for link in tree.links_of[tree.root]}
    lows = {link: float(each[:, 2].min()) for link, each in points.items() if len(each)}
    ground_m = min(lows.values(), default=0.0)
    standing = [points[link] for link, low in lows.items() if low < ground_m + _GROUND_M]
    return sum(_is_upright_disc(each) for each in standing) >= 2


def find_rotors(tree: KinematicTree) -> list[str]:
    """Links that are rotors or propellers by their names, or that turn upright above the ground, three or more.

    Where rotors are no links, the names of the robot and its meshes count.
    """
    leaves = [each for each in tree.after(tree.root) if _is_endless(each) and not tree.after(each.child)]
    heights = [(float(points[:, 2].min()), each) for each in leaves if len(points := tree.body_points(each.child))]
    own_m = tree.points(tree.urdf.links)[:, 2]
    least_m = float(own_m.min() + _ABOVE * np.ptp(own_m)) if len(own_m) else math.inf
    upright = [each.child for low_m, each in heights if low_m > least_m and tree.is_vertical(each)]
    if len(upright) >= 3:
        return upright
    motors = {each.child for each in leaves} if any(tree.depth(each) > 1 for each in tree.after(tree.root)) else None
    rotors = [each for each in tree.urdf.links if _ROTOR.search(each) and (motors is None or each in motors)]
    named = [link for link in tree.urdf.links if link in rotors or _PROPELLER.search(link)]
    flies = _FLIES.search(tree.urdf.robot.get("name", "")) or (not _stands(tree) and _FLIES.search(tree.text))
    return named if len(named) >= 2 else ["rotors"] if flies else []


def _is_endless(joint: UrdfJoint) -> bool:
    """True for a joint that turns without end; wheels of some files are revolute, and have no limits."""
    free = joint.upper - joint.lower > math.tau or joint.lower == joint.upper == 0.0
    return joint.kind == "continuous" or (joint.kind == "revolute" and free)


def why_nothing_drives(tree: KinematicTree, drive: Drive) -> tuple[str, str]:
    """Reason why a robot does not drive, and the mend; texts are empty for one that does."""
    if drive is Drive.ROTORS:
        what = f"it flies or swims by {listing(find_rotors(tree)[:4])}: no wheel turns and no leg stands on the floor"
        return what, "give a robot that drives or walks on floors"
    if drive is not Drive.NOTHING:
        return "", ""
    what = "nothing drives: no wheel turns and no leg stands on the floor, so nothing moves it over the floor"
    return what, "give a base: fix it to the URDF of a mobile base, and let the wheels turn (type continuous)"


def _is_upright_disc(points: FloatArray) -> bool:
    size = np.ptp(points, axis=0)
    flat = np.sort(size[:2])
    return bool(abs(size[2] - flat[1]) < 0.1 * size[2] and size[2] < 0.5 and flat[0] < 0.95 * size[2])


def find_drive(tree: KinematicTree, wheels: Sequence[Wheel], legs: Sequence[UrdfJoint], reaches: bool) -> Drive:
    """Drive of a base; `reaches` says whether joints on it move an arm or a part of a machine."""
    mounted = [each for each in wheels if each.swivel is None]
    steered = [each for each in wheels if each.swivel is not None and not each.is_caster]
    if steered and mounted:
        return Drive.STEERED
    if wheels and not mounted:
        return Drive.SWERVE
    if mounted:
        named = len(mounted) > 2 and _ROLLERS.search(tree.text) is not None
        skew = any(abs(float(each.axis_B @ mounted[0].axis_B)) < 0.95 for each in mounted)
        rollers = any(tree.after(each.joint.child) for each in mounted)
        return Drive.ROLLERS if skew or rollers or named else Drive.AXLE
    if legs:
        return Drive.LEGS
    if find_rotors(tree):
        return Drive.ROTORS
    return Drive.FREE if _stands(tree) or not reaches else Drive.NOTHING


def _stands(tree: KinematicTree) -> bool:
    """True for a base that a file names, moves over the floor or puts on wheels that do not turn."""
    plugins = {each.get("filename", "") for each in tree.urdf.robot.iter("plugin")}
    named = "base_footprint" in tree.links_of[tree.root] or any(map(_DRIVEN.search, plugins))
    return named or tree.drives_by_joints or has_fixed_wheels(tree)
