"""Parts of a kinematic tree by structure: wheels, casters, legs, arms, fingers, heads and lifts."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

import numpy as np

from errand_make.robots.tree import TURNS, KinematicTree
from plant.robots.urdf_robot.urdf_file import UrdfJoint
from skills.robot import FloatArray

LEAST_ARM: Final = 4
"""Fewest joints that turn in an arm."""
_ROUND: Final = 0.85
"""Least share of a wheel's radius to which it reaches on each side of its axis."""
_GROUND_M: Final = 0.03
_MOST_CARRIERS: Final = 2
"""Most joints between the base and a wheel: a swivel, or rocker and bogie."""
_TRAIL: Final = 0.1
"""Least trail of a caster over its wheel's radius."""
_HAND: Final = 0.5
"""Largest size of a hand behind an arm, as a part of the arm's reach."""
_HEAD_M: Final = 0.35
"""Longest neck."""
_JAW: Final = 0.5
"""Least length of a fixed jaw beside a finger that turns, as a part of the finger's."""
_CAMERA: Final = re.compile(
    r"camera|kinect|realsense|rgbd|d4[0-9]5|zed|xtion|stereo|optical|webcam|astra|orbbec|imager|(^|_)cam(_|\d|$)",
    re.IGNORECASE,
)
_NO_CAMERA: Final = re.compile(
    r"imu|gyro|accel|screw|mount|laser|lidar|scan|infra|plug|aruco|apriltag|marker", re.IGNORECASE
)
_LEGS: Final = 4
_ANGLES_RAD: Final = (0.0, math.pi / 2.0, -math.pi / 2.0, math.pi)
_ROLLERS: Final = re.compile(r"mecanum|omni_?(wheel|base|drive)|swedish|planar_move", re.IGNORECASE)


def is_camera(link: str) -> bool:
    """True for a link with the name of a camera."""
    return _CAMERA.search(link) is not None and _NO_CAMERA.search(link) is None


class Drive(Enum):
    """Kind of motion of a base over the floor."""

    AXLE = "axle"
    STEERED = "steered"
    ROLLERS = "rollers"
    SWERVE = "swerve"
    LEGS = "legs"
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


@dataclass(frozen=True)
class Arm:
    """Chain of joints that turn, from the shoulder on, and the joints on its tip; `fingers` move against each other."""

    joints: tuple[UrdfJoint, ...]
    fingers: tuple[UrdfJoint, ...]
    reach_m: float


@dataclass(frozen=True)
class Parts:
    """Parts of a robot: `chains` are those that no part drives, each with its first joint."""

    drive: Drive
    wheels: tuple[Wheel, ...]
    legs: tuple[UrdfJoint, ...]
    arms: tuple[Arm, ...]
    head: tuple[UrdfJoint, UrdfJoint] | None
    lifts: tuple[UrdfJoint, ...]
    sliding: tuple[tuple[UrdfJoint, ...], ...]

    @property
    def mounted(self) -> tuple[Wheel, ...]:
        """Wheels on the base itself."""
        return tuple(each for each in self.wheels if each.swivel is None)

    @property
    def casters(self) -> tuple[Wheel, ...]:
        """Wheels that trail behind a swivel."""
        return tuple(each for each in self.wheels if each.is_caster)


def find_parts(tree: KinematicTree) -> Parts:
    """Finds the parts of a robot by its kinematic tree."""
    wheels = find_wheels(tree)
    legs = () if wheels else find_legs(tree)
    ground = {joint.name for each in wheels for joint in (*tree.before(each.joint), each.joint)}
    ground |= {joint.name for leg in legs for joint in tree.below(leg)}
    arms, sliding = list[Arm](), list[tuple[UrdfJoint, ...]]()
    for run in _runs(tree, tree.root, frozenset(ground)):
        arm = _arm(tree, run)
        if arm is not None:
            arms.append(arm)
        elif sum(each.kind == "prismatic" and not tree.is_vertical(each) for each in run) >= 2:
            sliding.append(tuple(run))
    taken = ground | {each.name for arm in arms for joint in arm.joints for each in tree.below(joint)}
    lifts = tuple(each for each in tree.joint_of.values() if each.name not in ground and _is_lift(tree, each))
    drive = _drive(tree, wheels, legs, bool(arms or sliding))
    return Parts(drive, wheels, legs, tuple(arms), _head(tree, taken), lifts, tuple(sliding))


# -- base ---------------------------------------------------------------------------------------------------------


def find_wheels(tree: KinematicTree) -> tuple[Wheel, ...]:
    """Joints that turn about a horizontal axis, and whose round body touches the ground."""
    found = [wheel for joint in tree.joint_of.values() if (wheel := _wheel(tree, joint)) is not None]
    if not found:
        return ()
    ground_m = min(float(each.p_B[2]) - each.radius_m for each in found)
    low = tuple(each for each in found if float(each.p_B[2]) - each.radius_m < ground_m + _GROUND_M)
    return low if len(low) > 1 else ()


def _wheel(tree: KinematicTree, joint: UrdfJoint) -> Wheel | None:
    turns = joint.kind == "continuous" or (joint.kind == "revolute" and joint.upper - joint.lower > math.tau)
    rollers = tree.after(joint.child)
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
    if len(chains) < _LEGS or any(_depth(tree, each) >= LEAST_ARM for each in chains):
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


def _is_upright_disc(points: FloatArray) -> bool:
    size = np.ptp(points, axis=0)
    flat = np.sort(size[:2])
    return bool(abs(size[2] - flat[1]) < 0.1 * size[2] and size[2] < 0.5 and flat[0] < 0.95 * size[2])


def _drive(tree: KinematicTree, wheels: Sequence[Wheel], legs: Sequence[UrdfJoint], reaches: bool) -> Drive:
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
    stands = tree.drives_by_joints or has_fixed_wheels(tree) or "base_footprint" in tree.links_of[tree.root]
    return Drive.FREE if stands or not reaches else Drive.NOTHING


# -- chains -------------------------------------------------------------------------------------------------------


def _runs(tree: KinematicTree, body: str, ground: frozenset[str]) -> Iterator[list[UrdfJoint]]:
    """Serial chains from a body on, without joints that mimic; behind an arm there are none."""
    for first in tree.after(body):
        if first.name in ground or first.mimics:
            continue
        run = [first]
        while (following := _next(tree, run[-1], ground)) is not None:
            run.append(following)
        yield run
        if _arm(tree, run) is None:
            yield from _runs(tree, run[-1].child, ground)


def _next(tree: KinematicTree, joint: UrdfJoint, ground: frozenset[str]) -> UrdfJoint | None:
    """The joint that continues a chain: the only one, or the only one with a chain of its own."""
    after = [each for each in tree.after(joint.child) if each.name not in ground]
    long = [each for each in after if not each.mimics and _depth(tree, each) >= LEAST_ARM - 1]
    if len(after) == 1:
        return None if after[0].mimics else after[0]
    others = [each for each in after if len(long) == 1 and each is not long[0]]
    looks = any(is_camera(link) for each in others for link in tree.links_below(each))
    return long[0] if others and not looks and all(_depth(tree, each) <= 1 for each in others) else None


def _depth(tree: KinematicTree, joint: UrdfJoint) -> int:
    """Number of joints of the longest chain from a joint on, without those that mimic."""
    below = max((_depth(tree, each) for each in tree.after(joint.child)), default=0)
    return below + (not joint.mimics)


def _arm(tree: KinematicTree, run: Sequence[UrdfJoint]) -> Arm | None:
    """The arm of a serial chain; None for a neck, a trunk, or a chain that slides."""
    slides = [k for k, each in enumerate(run) if each.kind not in TURNS]
    turning = list(run[slides[-1] + 1 :] if slides else run)
    fingers = list(tree.after(run[-1].child)) if turning else []
    if slides and not turning and len(run) > LEAST_ARM:
        turning, fingers = list(run[slides[-2] + 1 : -1] if len(slides) > 1 else run[:-1]), [run[-1]]
    if len(turning) > LEAST_ARM and not fingers and is_jaw(tree, turning[-1]):
        fingers = [turning.pop()]
    if len(turning) < LEAST_ARM:
        return None
    places = [tree.place(each) for each in turning]
    reach_m = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    hand = [tree.place(each) for finger in fingers for each in tree.below(finger)]
    hand_m = max((float(np.linalg.norm(each - places[-1])) for each in hand), default=0.0)
    if hand_m > _HAND * max(reach_m, 0.05) or (
        any(_depth(tree, each) >= LEAST_ARM for each in fingers) and len(run) < 5
    ):
        return None
    looks = any(is_camera(link) for link in tree.links_below(run[-1]))
    neck_m = float(np.linalg.norm(places[-1] - places[0]))
    return None if looks and not fingers and neck_m < _HEAD_M else Arm(tuple(turning), tuple(fingers), reach_m)


def is_jaw(tree: KinematicTree, joint: UrdfJoint) -> bool:
    """True for a finger that turns beside a jaw, which its parent has."""
    own, parent = tree.points(tree.links_below(joint)), tree.body_points(tree.body_of[joint.parent])
    if not len(own) or not len(parent):
        return False
    ahead = own.mean(axis=0) - tree.place(joint)
    ahead -= tree.axis(joint) * float(ahead @ tree.axis(joint))
    length_m = float(np.linalg.norm(ahead))
    if length_m < 0.005 or joint.kind == "continuous":
        return False
    reached = [float(((each - tree.place(joint)) @ (ahead / length_m)).max()) for each in (own, parent)]
    return reached[1] > _JAW * reached[0]


def _head(tree: KinematicTree, taken: set[str]) -> tuple[UrdfJoint, UrdfJoint] | None:
    """Joints of pan and tilt of a chain that ends in a camera."""
    for tilt in tree.joint_of.values():
        before = tree.before(tilt)
        if not before or tilt.name in taken or before[-1].name in taken:
            continue
        pan = before[-1]
        if any(each.name in taken for each in tree.below(pan)):
            continue
        turn = all(each.kind in TURNS for each in (pan, tilt))
        looks = any(is_camera(link) for link in tree.links_below(tilt))
        if looks and turn and tree.is_vertical(pan) and abs(float(tree.axis(tilt)[1])) > 0.99:
            return pan, tilt
    return None


def _is_lift(tree: KinematicTree, joint: UrdfJoint) -> bool:
    """True for a joint that raises what has joints of its own."""
    carries = sum(not each.mimics for each in tree.below(joint)) > 1
    return joint.kind == "prismatic" and tree.is_vertical(joint) and carries
