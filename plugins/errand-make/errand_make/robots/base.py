"""The base of a robot: its front, the floor below it, how it drives, and its outline."""

from __future__ import annotations

import math
import re
from typing import Final

import numpy as np
from pydrake.math import RotationMatrix

from errand_make.robots.drive import Drive
from errand_make.robots.gripper import rounded
from errand_make.robots.parts import Parts, is_camera
from errand_make.robots.tree import KinematicTree
from skills.inputs.errors import listing
from skills.robot import FloatArray

LIDAR: Final = re.compile(r"lidar|laser|scan|hokuyo|velodyne|rplidar|ouster|sick|(^|_)lds", re.IGNORECASE)
NEARBY: Final = re.compile(r"sonar|ultraso|cliff|bumper|proximity|(^|_)(ir|tof|us)(_|\d|$)|vl53", re.IGNORECASE)
"""Links of sensors of a single distance, which are simulated as LiDARs are."""
_ROUND: Final = 0.08
_CORNERS: Final = 12
_CENTRED_M: Final = 0.03


def front_rotation(tree: KinematicTree, parts: Parts) -> RotationMatrix:
    """Rotation of the base's frame to the front of wheels that do not turn about y."""
    ahead = np.cross(parts.mounted[0].axis_B, [0.0, 0.0, 1.0])[:2]
    ahead = ahead * (1.0 if ahead[np.argmax(np.abs(ahead))] > 0.0 else -1.0)
    looking = [tree.X_BL[link].translation()[:2] for link in tree.urdf.links if is_camera(link) or LIDAR.search(link)]
    looking += [tree.place(arm.joints[0])[:2] for arm in parts.arms]
    middle = np.mean([each.p_B[:2] for each in parts.mounted], axis=0)
    if looking and float((np.mean(looking, axis=0) - middle) @ ahead) < -0.05:
        ahead = -ahead
    return RotationMatrix.MakeZRotation(math.atan2(float(ahead[1]), float(ahead[0])))


def floor_m(tree: KinematicTree, parts: Parts) -> float:
    """Height of the floor in B: below wheels and legs, else below the body that stands on it."""
    if parts.wheels:
        return min(float(each.p_B[2]) - each.radius_m for each in parts.wheels)
    if parts.legs:
        return min(float(tree.points(tree.links_below(leg))[:, 2].min()) for leg in parts.legs)
    if tree.drives_by_joints:
        return float(tree.X_BL[tree.urdf.root].translation()[2])
    points = tree.body_points(tree.root)
    return float(points[:, 2].min()) if len(points) else 0.0


def motion_of(parts: Parts) -> tuple[str, str]:
    """Motion of a base, with a note on how it is known."""
    count = len(parts.wheels)
    if parts.drive is Drive.AXLE:
        note = f"{len(parts.mounted)} wheels were found"
        if len(parts.mounted) > 2:
            note += ", which turn the base by skidding (with mecanum wheels, write motion: omnidirectional)"
        across = [float(each.p_B[1]) for each in parts.mounted]
        if max(across) - min(across) < 0.03:
            note += ", all in one line, so that the real robot does not turn on the spot as Errand plans"
        return "differential", note
    if parts.drive is Drive.STEERED:
        joints = listing([each.swivel.name for each in parts.wheels if each.swivel is not None and not each.is_caster])
        what = f"{count} wheels were found, steered by {joints} as a car is"
        return (
            "differential",
            f"{what}; Errand has no such base: it plans turns on the spot, which this robot does not make",
        )
    guess = "omnidirectional is a guess (else write motion: differential)"
    if parts.drive is Drive.ROLLERS:
        return "omnidirectional", f"{count} mecanum or omni wheels were found; {guess}"
    if parts.drive is Drive.SWERVE:
        return "omnidirectional", f"{count} wheels were found, all on swivels; {guess}"
    if parts.drive is Drive.LEGS:
        what = f"{len(parts.legs)} legs were found; they are held, and a floating base moves the robot as it does Spot"
        return "omnidirectional", what
    return "omnidirectional", f"0 wheels turn in this file; {guess}"


def outline_polygon(points: FloatArray) -> list[list[float]]:
    """Footprint of points (N, 2) seen from above: a circle's polygon where they fit one well, else their rectangle."""
    (left, back), (right, front) = points.min(axis=0), points.max(axis=0)
    middle, half = np.array([(left + right) / 2.0, (back + front) / 2.0]), (right - left + front - back) / 4.0
    radius = float(np.linalg.norm(points - middle, axis=1).max())
    if radius < half * (1.0 + _ROUND) and float(np.linalg.norm(middle)) < _CENTRED_M:
        out = radius / math.cos(math.pi / _CORNERS)
        turns = (np.arange(_CORNERS) + 0.5) * math.tau / _CORNERS
        return [[rounded(out * math.cos(a)), rounded(out * math.sin(a))] for a in turns]
    return [[rounded(x), rounded(y)] for x, y in ((right, front), (left, front), (left, back), (right, back))]
