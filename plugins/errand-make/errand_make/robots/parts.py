"""Parts of a kinematic tree by structure: its drive, arms, fingers, heads and lifts."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from errand_make.robots.drive import Drive, Wheel, find_drive, find_legs, find_wheels
from errand_make.robots.tree import TURNS, KinematicTree
from plant.robots.urdf_robot.urdf_file import UrdfJoint
from skills.inputs.errors import listing

LEAST_ARM: Final = 4
"""Fewest joints that turn in an arm."""
_HAND: Final = 0.5
"""Largest size of a hand whose fingers have joints in a row, as a part of the arm's reach; else it is the reach."""
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


def is_camera(link: str) -> bool:
    """True for a link with the name of a camera."""
    return _CAMERA.search(link) is not None and _NO_CAMERA.search(link) is None


@dataclass(frozen=True)
class Arm:
    """Chain of joints that turn, from the shoulder on, and the joints on its tip; `fingers` move against each other."""

    joints: tuple[UrdfJoint, ...]
    fingers: tuple[UrdfJoint, ...]
    reach_m: float


@dataclass(frozen=True)
class Parts:
    """Parts of a robot: `sliding` are chains of telescopic arms, which no part drives."""

    drive: Drive
    wheels: tuple[Wheel, ...]
    legs: tuple[UrdfJoint, ...]
    arms: tuple[Arm, ...]
    head: tuple[UrdfJoint, UrdfJoint] | None
    lifts: tuple[UrdfJoint, ...]
    sliding: tuple[tuple[UrdfJoint, ...], ...]
    no_arm: str = ""
    """Why the longest chain without a camera is no arm, when there is no arm and such a chain."""

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
    arms, sliding, others = list[Arm](), list[tuple[UrdfJoint, ...]](), list[tuple[int, str]]()
    for run in _runs(tree, tree.root, frozenset(ground)):
        arm = _arm(tree, run)
        others += [(len(run), arm)] if isinstance(arm, str) and arm else []
        if isinstance(arm, Arm):
            arms.append(arm)
        elif sum(each.kind == "prismatic" and not tree.is_vertical(each) for each in run) >= 2:
            sliding.append(tuple(run))
    taken = ground | {each.name for arm in arms for joint in arm.joints for each in tree.below(joint)}
    lifts = tuple(each for each in tree.joint_of.values() if each.name not in ground and _is_lift(tree, each))
    drive = find_drive(tree, wheels, legs, bool(arms or sliding or others))
    no_arm = "" if arms or sliding or not others else max(others)[1]
    return Parts(drive, wheels, legs, tuple(arms), _head(tree, taken), lifts, tuple(sliding), no_arm)


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
        if not isinstance(_arm(tree, run), Arm):
            yield from _runs(tree, run[-1].child, ground)


def _next(tree: KinematicTree, joint: UrdfJoint, ground: frozenset[str]) -> UrdfJoint | None:
    """The joint that continues a chain: the only one, or the only one with a chain of its own."""
    after = [each for each in tree.after(joint.child) if each.name not in ground]
    long = [each for each in after if not each.mimics and tree.depth(each) >= LEAST_ARM - 1]
    if len(after) == 1:
        return None if after[0].mimics else after[0]
    others = [each for each in after if len(long) == 1 and each is not long[0]]
    looks = any(is_camera(link) for each in others for link in tree.links_below(each))
    return long[0] if others and not looks and all(tree.depth(each) <= 1 for each in others) else None


def _arm(tree: KinematicTree, run: Sequence[UrdfJoint]) -> Arm | str:
    """The arm of a serial chain, or why it is none: "" for a neck, and for a single joint."""
    slides = [k for k, each in enumerate(run) if each.kind not in TURNS]
    turning = list(run[slides[-1] + 1 :] if slides else run)
    fingers = list(tree.after(run[-1].child)) if turning else []
    if slides and not turning and len(run) > LEAST_ARM:
        turning, fingers = list(run[slides[-2] + 1 : -1] if len(slides) > 1 else run[:-1]), [run[-1]]
    spindles = [each for each in fingers if each.kind == "continuous" and not tree.after(each.child)]
    if any(each.kind == "prismatic" for each in fingers):
        fingers = [each for each in fingers if each not in spindles]  # they show the motor of fingers that slide
    if len(turning) > LEAST_ARM and not fingers and is_jaw(tree, turning[-1]):
        fingers = [turning.pop()]
    places = [tree.place(each) for each in turning]
    looks = any(is_camera(link) for link in tree.links_below(run[-1])) and not fingers
    if looks and places and float(np.linalg.norm(places[-1] - places[0])) < _HEAD_M:
        return ""
    names = listing([each.name for each in run])
    if len(turning) < LEAST_ARM:
        return f"{names} have {len(turning)} joints in a row that turn" if len(run) > 1 else ""
    reach_m = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    hand = [tree.place(each) for finger in fingers for each in tree.below(finger)]
    hand_m = max((float(np.linalg.norm(each - places[-1])) for each in hand), default=0.0)
    most = _HAND if any(tree.depth(each) > 1 for each in fingers) else 1.0
    if hand_m > most * max(reach_m, 0.05):
        return f"what moves behind {run[-1].name} is {hand_m:.2f} m long, too large for the hand of {names}"
    if any(tree.depth(each) >= LEAST_ARM for each in fingers) and len(run) < 5:
        return f"{names} carry {len(fingers)} chains of their own, as a trunk does"
    return Arm(tuple(turning), tuple(fingers), reach_m)


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
