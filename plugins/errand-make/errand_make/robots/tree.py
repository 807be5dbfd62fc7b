"""Kinematic tree of a URDF: bodies of links that no joint moves apart, the joints between them, and their points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final
from xml.etree.ElementTree import Element

import numpy as np
from pydrake.math import RigidTransform
from scipy.spatial import ConvexHull, QhullError

from plant.robots.urdf_robot.urdf_file import UrdfFile, UrdfJoint
from skills.robot import FloatArray

TURNS: Final = ("revolute", "continuous")
_MOST_POINTS: Final = 60
_FLAT: Final = 0.1


@dataclass(frozen=True)
class KinematicTree:
    """Tree of the bodies of a robot; B is the frame of its base: x ahead, z up. A body has the name of its first link.

    `X_LB` is the pose of B in the link `base`; `posture` has the positions of joints that are not at 0. `text`
    is the robot's description as its maker gives it.
    """

    urdf: UrdfFile
    base: str
    X_LB: RigidTransform
    posture: Mapping[str, float] = field(default_factory=dict)
    text: str = ""
    _local: dict[str, FloatArray] = field(default_factory=dict, repr=False, compare=False)
    """Corners of links that are known already; a tree at another posture has the same."""

    # -- bodies and joints ----------------------------------------------------------------------------------------

    @cached_property
    def body_of(self) -> Mapping[str, str]:
        """Body of each link."""
        body = {self.urdf.root: self.urdf.root}
        for joint in self.urdf.order:
            body[joint.child] = joint.child if joint.moves and joint.name not in self._planar else body[joint.parent]
        return body

    @cached_property
    def links_of(self) -> Mapping[str, Sequence[str]]:
        """Links of each body."""
        found = dict[str, list[str]]()
        for link, body in self.body_of.items():
            found.setdefault(body, []).append(link)
        return found

    @cached_property
    def joint_of(self) -> Mapping[str, UrdfJoint]:
        """Joint that moves each body but the root."""
        return {each.child: each for each in self.urdf.order if self.body_of[each.child] == each.child}

    @cached_property
    def _after(self) -> Mapping[str, Sequence[UrdfJoint]]:
        found = dict[str, list[UrdfJoint]]()
        for joint in self.joint_of.values():
            found.setdefault(self.body_of[joint.parent], []).append(joint)
        return found

    @property
    def root(self) -> str:
        """Body of the base."""
        return self.urdf.root

    def after(self, body: str) -> Sequence[UrdfJoint]:
        """Joints on a body."""
        return self._after.get(body, ())

    def before(self, joint: UrdfJoint) -> list[UrdfJoint]:
        """Joints between the base and a joint, the nearest to the base first."""
        found = list[UrdfJoint]()
        while (body := self.body_of[joint.parent]) != self.root:
            joint = self.joint_of[body]
            found.append(joint)
        return found[::-1]

    def below(self, joint: UrdfJoint) -> list[UrdfJoint]:
        """A joint and all joints that it carries."""
        found = [joint]
        for each in found:
            found += self.after(each.child)
        return found

    def depth(self, joint: UrdfJoint) -> int:
        """Number of joints of the longest chain from a joint on, without those that mimic."""
        below = max((self.depth(each) for each in self.after(joint.child)), default=0)
        return below + (not joint.mimics)

    def links_below(self, joint: UrdfJoint) -> list[str]:
        """Links that a joint carries."""
        return [link for each in self.below(joint) for link in self.links_of[each.child]]

    @cached_property
    def _planar(self) -> frozenset[str]:
        """Names of the joints by which a simulator moves the whole robot over the floor: two slide, one turns."""
        return frozenset(each.name for each in planar_joints(self.urdf))

    @property
    def drives_by_joints(self) -> bool:
        """True when the file has such joints, or a floating one, between the world and the base."""
        return bool(self._planar) or any(each.kind in ("planar", "floating") for each in self.urdf.order[:1])

    # -- geometry, at the posture ------------------------------------------------------------------------------------

    @cached_property
    def X_BL(self) -> Mapping[str, RigidTransform]:
        """Poses of the links, with joints at the posture, else at 0 or the nearest limit."""
        X_RL = self.urdf.poses(self.posture)
        X_BR = (X_RL[self.base] @ self.X_LB).inverse()
        return {link: X_BR @ X for link, X in X_RL.items()}

    def frame(self, joint: UrdfJoint) -> RigidTransform:
        """Frame F of a joint in B."""
        return self.X_BL[joint.parent] @ joint.X_PF

    def axis(self, joint: UrdfJoint) -> FloatArray:
        """Axis (3,) of a joint in B."""
        return np.asarray(self.frame(joint).rotation() @ joint.axis)

    def place(self, joint: UrdfJoint) -> FloatArray:
        """Origin (3,) of a joint in B."""
        return np.asarray(self.frame(joint).translation())

    def local_points(self, link: str) -> FloatArray:
        """Corners (N, 3) of a link's collision shapes, else of what is drawn, in its own frame."""
        if link not in self._local:
            shapes = self.urdf.shapes(link, "collision") or self.urdf.shapes(link, "visual")
            found = [_few((self.urdf.origin(shape) @ shape_points(self.urdf, shape).T).T) for shape in shapes]
            self._local[link] = np.concatenate([np.empty((0, 3)), *found])
        return self._local[link]

    def points(self, links: Iterable[str]) -> FloatArray:
        """Corners (N, 3) of links in B."""
        return np.concatenate([np.empty((0, 3)), *((self.X_BL[each] @ self.local_points(each).T).T for each in links)])

    def body_points(self, body: str) -> FloatArray:
        """Corners (N, 3) of a body in B."""
        return self.points(self.links_of[body])

    def is_vertical(self, joint: UrdfJoint) -> bool:
        """True for a joint whose axis is vertical."""
        return abs(float(self.axis(joint)[2])) > 1.0 - _FLAT

    def is_horizontal(self, joint: UrdfJoint) -> bool:
        """True for a joint whose axis is horizontal."""
        return abs(float(self.axis(joint)[2])) < _FLAT


def planar_joints(urdf: UrdfFile) -> list[UrdfJoint]:
    """Joints from the root by which a simulator moves the robot over the floor; none unless two of them slide."""
    found, link = list[UrdfJoint](), urdf.root
    below = dict[str, list[UrdfJoint]]()
    for joint in urdf.order:
        below.setdefault(joint.parent, []).append(joint)
    while not urdf.shapes(link, "collision") and not urdf.shapes(link, "visual") and len(below.get(link, ())) == 1:
        joint = below[link][0]
        axis = joint.axis
        turns = joint.kind in TURNS and abs(float(axis[2])) > 1.0 - _FLAT
        slides = joint.kind == "prismatic" and abs(float(axis[2])) < _FLAT
        if joint.moves and not turns and not slides:
            break
        found += [joint] if joint.moves else []
        link = joint.child
    return found if sum(each.kind == "prismatic" for each in found) >= 2 else []


def _few(points: FloatArray) -> FloatArray:
    """Points that bound a shape: those of its convex hull, the farthest in some directions when they are many."""
    if len(points) <= _MOST_POINTS:
        return points
    try:
        points = points[ConvexHull(points).vertices]
    except QhullError:
        return _box(points)
    if len(points) <= 2 * _MOST_POINTS:
        return points
    step = np.arange(_MOST_POINTS) + 0.5
    height, turn = 1.0 - 2.0 * step / _MOST_POINTS, np.pi * (1.0 + np.sqrt(5.0)) * step
    across = np.sqrt(1.0 - height**2)
    ways = np.vstack([np.column_stack([across * np.cos(turn), across * np.sin(turn), height]), np.eye(3), -np.eye(3)])
    return np.asarray(points[np.unique(np.argmax(points @ ways.T, axis=0))])


def _box(points: FloatArray) -> FloatArray:
    low, high = points.min(axis=0), points.max(axis=0)
    return np.asarray(low + (high - low) * np.stack(np.meshgrid(*[[0.0, 1.0]] * 3), axis=-1).reshape(-1, 3))


def shape_points(urdf: UrdfFile, shape: Element) -> FloatArray:
    """Corners (N, 3) of a shape in its own frame."""
    geometry: Any = shape.find("geometry")
    numbers = urdf.numbers
    ball = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    if (box := geometry.find("box")) is not None:
        return np.asarray(ball * np.array(numbers(box, "size", "0 0 0")) / 2.0)
    if (sphere := geometry.find("sphere")) is not None:
        return np.asarray(ball * numbers(sphere, "radius", "0")[0])
    if (cylinder := geometry.find("cylinder")) is not None:
        radius, length = (numbers(cylinder, key, "0")[0] for key in ("radius", "length"))
        turns = np.linspace(0.0, math.tau, 24, endpoint=False)
        ring = np.column_stack([radius * np.cos(turns), radius * np.sin(turns)])
        return np.vstack([np.column_stack([ring, np.full(24, z)]) for z in (-length / 2.0, length / 2.0)])
    mesh = geometry.find("mesh")
    return np.empty((0, 3)) if mesh is None else urdf.mesh_points(mesh)
