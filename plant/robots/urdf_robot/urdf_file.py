"""URDF files of robots: their links, joints and poses, with the line of each error."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from skills.inputs.errors import InputError, suggestion
from skills.inputs.outside import read_text
from skills.robot import FloatArray

PACKAGE: Final = "robot"
"""Package of the robot's own folder in the names of its meshes: `package://robot/meshes/..`."""
MOVING: Final = ("revolute", "continuous", "prismatic")
MOST_BYTES: Final = 20_000_000
_LINE: Final = "line"
_XACRO: Final = re.compile(r"""<xacro:|=\s*(?:"[^"]*|'[^']*)\$[{(]""")
_COMMENT: Final = re.compile(r"<!--.*?-->", re.DOTALL)
_EXPAND: Final = "expand it by `xacro FILE > robot.urdf`, and give that file"
_LIMIT: Final = 'write <limit lower="..." upper="..." effort="..." velocity="..."/> into it'


@dataclass(frozen=True)
class UrdfJoint:
    """Joint: X_PF is its frame in the parent link, `axis` (3,) a unit vector in F; limits in rad or m.

    `mimics` says whether it follows another joint.
    """

    name: str
    kind: str
    parent: str
    child: str
    X_PF: RigidTransform
    axis: FloatArray
    lower: float
    upper: float
    effort: float
    velocity: float
    mimics: bool
    line: int

    @property
    def moves(self) -> bool:
        """Returns whether the joint has one degree of freedom."""
        return self.kind in MOVING

    def X_FC(self, position: float) -> RigidTransform:
        """Pose of the child link in F at a position (rad, m)."""
        if self.kind == "prismatic":
            return RigidTransform(position * self.axis)
        if not self.moves:
            return RigidTransform()
        return RigidTransform(RotationMatrix(AngleAxis(position, self.axis)), np.zeros(3))

    def clipped(self, position: float) -> float:
        """Position clipped to the joint's limits."""
        return min(max(position, self.lower), self.upper)


class UrdfFile:
    """URDF file whose errors name file and line."""

    def __init__(self, path: Path, text: str | None = None) -> None:
        """Reads the file, or `text` in its place. Raises InputError when it is no URDF, or its links form no tree."""
        self.path = path
        text = read_urdf_text(path) if text is None else text
        if is_xacro(text):
            raise InputError("it is a xacro file, not URDF", hint=_EXPAND, file=path)
        robot = _parse(path, text)
        if robot.tag != "robot":
            raise self.error(robot, f"it begins with <{robot.tag}>, not with <robot>", "give the URDF of a robot")
        self.robot, self.text = robot, text
        self.links = self._by_name(robot.findall("link"))
        self.joints = {name: self._joint(each) for name, each in self._by_name(robot.findall("joint")).items()}
        self._to = {joint.child: joint for joint in self.joints.values()}
        for joint in (each for each in self.joints.values() if each is not self._to[each.child]):
            what = f"joints {joint.name} and {self._to[joint.child].name} have the same child {joint.child}"
            raise self.error(self._to[joint.child].line, what, "a link hangs on one joint: remove one of the two")
        if len(roots := [name for name in self.links if name not in self._to]) > 1 or not self.links:
            what = f"links {' and '.join(roots[:8])} have no parent" if roots else "it has no links"
            raise self.error(self.links[roots[1]] if roots else robot, what, "join them by joints to a single base")
        self.root = next(iter(roots), "")
        _ = self.order
        simulated = ((each.get("reference", ""), each.iter("sensor")) for each in robot.findall("gazebo"))
        self.sensors = [(link, sensor.get("type", "")) for link, sensors in simulated for sensor in sensors]

    def error(self, where: Element | int, message: str, hint: str) -> InputError:
        """Error at an element or a line."""
        line = where if isinstance(where, int) else int(where.get(_LINE, "1"))
        return InputError(message, hint=hint, file=self.path, line=line)

    def _by_name(self, elements: Iterable[Element]) -> dict[str, Element]:
        found = dict[str, Element]()
        for each in elements:
            name = each.get("name", "")
            if not name or name in found:
                what = f"two of <{each.tag}> are named '{name}'" if name else f"<{each.tag}> has no name"
                raise self.error(each, what, "give each a name of its own")
            found[name] = each
        return found

    def _joint(self, element: Element) -> UrdfJoint:
        name, kind = element.get("name", ""), element.get("type", "")
        parent, child = (self._named(element, tag, "link") for tag in ("parent", "child"))
        limit, axis = element.find("limit"), element.find("axis")
        axis_F = np.array(self.numbers(axis, "xyz", "1 0 0"))
        known, length = (*MOVING, "fixed", "floating", "planar"), float(np.linalg.norm(axis_F))
        if kind not in known or (kind in MOVING and not length):
            what = f"joint {name} has type '{kind}'" if kind not in known else f"joint {name} has a zero axis"
            raise self.error(element, what, f"use one of {', '.join(MOVING)} and fixed, with an axis")
        ends = {key: self.numbers(limit, key, "0")[0] for key in ("lower", "upper", "effort", "velocity")}
        if kind not in ("revolute", "prismatic"):
            ends |= {"lower": -math.inf, "upper": math.inf}
        mimics, line = element.find("mimic") is not None, int(element.get(_LINE, "1"))
        X_PF, axis_F = self.origin(element), axis_F / (length or 1.0)
        return UrdfJoint(name, kind, parent, child, X_PF, axis_F, **ends, mimics=mimics, line=line)

    def _named(self, element: Element, tag: str, key: str) -> str:
        """Link to which a joint refers. Raises InputError when it does not exist."""
        found = element.find(tag)
        name = "" if found is None else found.get(key, "")
        if name not in self.links:
            what = f"joint {element.get('name')}: there is no link '{name}' for its {tag}"
            raise self.error(element, what, suggestion(name, self.links))
        return name

    def numbers(self, element: Element | None, key: str, default: str) -> list[float]:
        """Numbers in an attribute, as many as the default has. Raises InputError for any other content."""
        text = default if element is None else element.get(key, default)
        try:
            found = [float(word) for word in text.split()]
        except ValueError:
            found = []
        if (count := len(default.split())) != len(found) or not np.isfinite(found).all():
            assert element is not None
            what = f"<{element.tag} {key}='{text[:60]}'> is not {'a number' if count == 1 else f'{count} numbers'}"
            raise self.error(element, what, "correct it")
        return found

    def origin(self, element: Element) -> RigidTransform:
        """Pose in the `origin` of an element."""
        origin = element.find("origin")
        xyz, rpy = (np.array(self.numbers(origin, key, "0 0 0")) for key in ("xyz", "rpy"))
        return RigidTransform(RollPitchYaw(rpy), xyz)

    @cached_property
    def order(self) -> Sequence[UrdfJoint]:
        """All joints, parents first. Raises InputError when joints form a loop."""
        below = dict[str, list[UrdfJoint]]()
        for joint in self.joints.values():
            below.setdefault(joint.parent, []).append(joint)
        order = list(below.get(self.root, ()))
        for joint in order:
            order += below.get(joint.child, ())
        reached = {joint.child for joint in order}
        for joint in (each for each in self.joints.values() if each.child not in reached):
            raise self.error(joint.line, f"joint {joint.name} is in a loop", "turn or remove a joint of the loop")
        return tuple(order)

    def chain(self, link: str) -> list[UrdfJoint]:
        """Joints from the root to a link."""
        joints = list[UrdfJoint]()
        while (joint := self._to.get(link)) is not None:
            joints.append(joint)
            link = joint.parent
        return joints[::-1]

    def poses(self, positions: Mapping[str, float]) -> dict[str, RigidTransform]:
        """Poses of all links in the root link, at joint positions (rad, m); other joints at 0 or the nearest limit."""
        X = {self.root: RigidTransform()}
        for joint in self.order:
            position = positions.get(joint.name, joint.clipped(0.0)) if joint.moves else 0.0
            X[joint.child] = X[joint.parent] @ joint.X_PF @ joint.X_FC(position)
        return X

    def need_limits(self, names: Collection[str]) -> None:
        """Raises InputError for the first of these joints that lacks limits."""
        for joint in (self.joints[name] for name in names):
            lacking = [key for key in ("effort", "velocity") if getattr(joint, key) <= 0.0]
            if not joint.lower < joint.upper:
                lacking.insert(0, "lower and upper")
            if lacking:
                raise self.error(joint.line, f"joint {joint.name} has no limit of {', '.join(lacking)}", _LIMIT)

    def shapes(self, link: str, role: str) -> list[Element]:
        """The `visual` or `collision` elements of a link."""
        return [each for each in self.links[link].findall(role) if each.find("geometry") is not None]

    def mesh_path(self, mesh: Element) -> Path:
        """File of a mesh in the robot's folder. Raises InputError when it is missing."""
        name = mesh.get("filename", "")
        path = self.path.parent / name.removeprefix(f"package://{PACKAGE}/")
        if not name.startswith(f"package://{PACKAGE}/") or not path.is_file():
            raise self.error(mesh, f"there is no mesh {name[:100]}", "make the package by `errand new robot`")
        return path

    def mesh_points(self, mesh: Element) -> FloatArray:
        """Vertices (N, 3) of a mesh's OBJ file, scaled. Raises InputError when it has none."""
        lines = self.mesh_path(mesh).read_text(encoding="utf-8").splitlines()
        points = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], dtype=np.float64)
        return np.asarray(points * self.numbers(mesh, "scale", "1 1 1"))


def read_urdf_text(path: Path) -> str:
    """Text of a URDF or xacro file. Raises InputError."""
    return read_text(path, most_bytes=MOST_BYTES, hint="check the path")


def is_xacro(text: str) -> bool:
    """True for text with elements or substitutions of xacro outside its comments."""
    return _XACRO.search(_COMMENT.sub("", text)) is not None


def _parse(path: Path, text: str) -> Element:
    """Parses XML; each element has its line as attribute `line`. Raises InputError."""
    parser, builder = expat.ParserCreate(), TreeBuilder()

    def begin(tag: str, attributes: dict[str, str]) -> None:
        builder.start(tag, {**attributes, _LINE: str(parser.CurrentLineNumber)})

    parser.StartElementHandler, parser.EndElementHandler = begin, builder.end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(text.encode(), True)
        return builder.close()
    except expat.ExpatError as wrong:
        what = f"broken XML: {expat.ErrorString(wrong.code)}"
        raise InputError(what, hint="correct it here", file=path, line=wrong.lineno) from wrong
