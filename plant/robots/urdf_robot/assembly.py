"""URDF text of a robot for the plant and for arm planning: few links, connected by the driven joints.

All links that no driven joint moves form one link `body`, whose frame is B. Those below a lift form a link with the
name of the root, whose frame is on the floor below B. The arm's frames are parallel to B at zero where the axes allow
it; the last one is the hand frame H.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from plant.models import urdf as urdf_text
from plant.robots.urdf_robot.robot_file import DIGITS, GripperFile, HandFile, PadsFile, RobotFile
from plant.robots.urdf_robot.urdf_file import UrdfFile, UrdfJoint
from skills.inputs.errors import InputError, suggestion
from skills.inputs.yaml_source import KeyPath
from skills.robot import FloatArray, GripperKind

BODY: Final = "body"
_STRAIGHT: Final = 1e-4
_OFF_AXLE_M: Final = 0.01
_CONTACT: Final = "drake:proximity_properties"
_PAD_RADIUS_M: Final = 0.0025
_PAD_STEP_M: Final = 0.006
_PAD_FRICTION: Final = 1.0
_PAD_STIFFNESS_N_M: Final = 8000.0
_PAD_LENGTH_M: Final = 0.045


@dataclass(frozen=True)
class _Mass:
    """Mass (kg), centre of mass (3,) and moments of inertia (3, 3) about it, in one frame."""

    mass_kg: float
    com: FloatArray
    moments: FloatArray


class Assembly:
    """A robot's URDF, with the names in its file resolved; `carriers` are the links of the generated text."""

    def __init__(self, file: RobotFile) -> None:
        """Reads the URDF and merges links. Raises InputError at the location in either file."""
        self.file = file
        self.urdf = UrdfFile(file.source.path.parent / file.urdf)
        self._check_names()
        closed = {} if file.gripper is None else dict.fromkeys(file.gripper.joints, 0.0) | file.gripper.closed
        self._zero: Mapping[str, float] = dict.fromkeys(file.moving, 0.0) | file.held | closed
        X_RL = self.urdf.poses(self._zero)
        X_BR = X_RL[file.base.link].inverse()
        self.X_BL = {link: X_BR @ X for link, X in X_RL.items()}
        moving = set(file.moving)
        self.casters = () if file.base.wheels is None else file.base.wheels.casters
        self.joints = {
            each.child: each for each in self.urdf.joints.values() if each.name in moving or each.child in self.casters
        }
        self.root = BODY if file.lift is None else self._name(self.urdf.root)
        self._carrier = {self.urdf.root: self.root}
        for joint in self.urdf.order:
            own = joint.child in self.joints
            self._carrier[joint.child] = self._name(joint.child) if own else self._carrier[joint.parent]
        self._X_BC = {self.root: RigidTransform([0.0, 0.0, self.base_height_m - file.base.height])}
        for joint in self.joints.values():
            X_BF = self.X_BL[joint.parent] @ joint.X_PF
            self._X_BC[self._name(joint.child)] = RigidTransform(self._rotation(joint, X_BF), X_BF.translation())
        self._X_BC[BODY] = RigidTransform()
        self._check_lift()
        self._check_hand()

    def _name(self, link: str) -> str:
        lift = None if self.file.lift is None else self.urdf.joints[self.file.lift.joint].child
        if link == lift:
            return BODY
        return f"{link}_link" if link == BODY else link

    def carrier(self, link: str) -> str:
        """Link of the generated text that contains a link of the file."""
        return self._carrier[link]

    def X_CL(self, link: str) -> RigidTransform:
        """Pose of a link of the file in its carrier."""
        X = self._X_BC[self.carrier(link)].inverse() @ self.X_BL[link]
        clean = RigidTransform(X.rotation(), np.round(X.translation(), DIGITS) + 0.0)
        return RigidTransform() if clean.IsNearlyIdentity(1e-12) else clean

    @property
    def base_height_m(self) -> float:
        """Height above the floor of the frame of the link `root`."""
        return self.file.base.height if self.file.lift is None else 0.0

    @property
    def hand_link(self) -> str | None:
        """The arm's last link, whose frame is H; None when there is no arm."""
        arm = self.file.arm
        return None if arm is None else self._name(self.urdf.joints[arm.joints[-1]].child)

    def axle(self) -> tuple[float, float]:
        """Wheel radius, and half the track of the driven wheels. Raises InputError unless B is midway between them."""
        wheels = self.file.base.wheels
        assert wheels is not None
        left, right = (self.X_BL[self.urdf.joints[name].child].translation() for name in wheels.joints)
        if left[1] <= 0.0 or np.max(np.abs((left + right)[:2])) > _OFF_AXLE_M:
            what = f"the middle of the axle is not below the origin of {self.file.base.link}"
            raise self.error(("base", "wheels", "joints"), what, "name the left wheel first, and a link between them")
        return wheels.radius, float(left[1])

    # -- checks ---------------------------------------------------------------------------------------------------

    def error(self, path: KeyPath, message: str, hint: str) -> InputError:
        """Error at a key of the robot's file."""
        return self.file.source.error(path, message, hint)

    def _check_names(self) -> None:
        file = self.file
        links: list[tuple[KeyPath, str]] = [(("base", "link"), file.base.link), (("lidar", "link"), file.lidar.link)]
        links += [(("cameras", name, "link"), camera.link) for name, camera in file.cameras.items()]
        joints: list[tuple[KeyPath, str]] = [(("head", k), name) for k, name in enumerate(file.head or ())]
        if file.base.wheels is not None:
            links += [(("base", "wheels", "casters", k), name) for k, name in enumerate(file.base.wheels.casters)]
            joints += [(("base", "wheels", "joints", k), name) for k, name in enumerate(file.base.wheels.joints)]
        if file.lift is not None:
            joints.append((("lift", "joint"), file.lift.joint))
        if file.arm is not None:
            links.append((("arm", "hand", "link"), file.arm.hand.link))
            joints += [(("arm", "joints", k), name) for k, name in enumerate(file.arm.joints)]
        joints += [(("gripper", "joints", name), name) for name in (file.gripper.joints if file.gripper else ())]
        joints += [(("held", name), name) for name in file.held]
        for what, named, known in (("link", links, self.urdf.links), ("joint", joints, self.urdf.joints)):
            for path, name in named:
                if name not in known:
                    hint = suggestion(name, known)
                    raise self.error(path, f"there is no {what} '{name}' in {file.urdf}", hint)
        self.urdf.need_limits(file.moving)

    def _check_lift(self) -> None:
        lift = self.file.lift
        if lift is None:
            return
        joint = self.urdf.joints[lift.joint]
        axis_B = (self.X_BL[joint.parent] @ joint.X_PF).rotation() @ joint.axis
        if joint.kind != "prismatic" or float(axis_B[2]) < 1.0 - _STRAIGHT:
            raise self.error(("lift", "joint"), f"joint {joint.name} does not slide upwards", "hold it by `held`")
        if self.carrier(self.file.base.link) != BODY:
            what = f"the lift does not carry link {self.file.base.link}"
            raise self.error(("base", "link"), what, f"name a link behind joint {joint.name}")
        if not joint.lower <= lift.travelling <= joint.upper:
            what = f"the joint moves from {joint.lower} to {joint.upper} m"
            raise self.error(("lift", "travelling"), what, "write a position between them")

    def _check_hand(self) -> None:
        arm = self.file.arm
        if arm is None:
            return
        for k, (before, after) in enumerate(zip(arm.joints, arm.joints[1:], strict=False)):
            driven = [each.name for each in self.urdf.chain(self.urdf.joints[after].child) if each.name in arm.joints]
            if driven[-2:-1] != [before]:
                what = f"joint {after} does not follow {before}"
                raise self.error(("arm", "joints", k + 1), what, "list the arm's joints from the shoulder on")
        if self.hand_link not in (self.carrier(arm.hand.link), *self._parents(arm.hand.link)):
            what = f"link {arm.hand.link} is not behind the arm's last joint"
            raise self.error(("arm", "hand", "link"), what, "name a link of the hand")

    def _parents(self, link: str) -> list[str]:
        return [self.carrier(joint.parent) for joint in self.urdf.chain(link)]

    # -- frames ---------------------------------------------------------------------------------------------------

    def _rotation(self, joint: UrdfJoint, X_BF: RigidTransform) -> RotationMatrix:
        """Rotation of a carrier's frame in B: the hand's for the hand and behind it, else B's where the axis allows."""
        if joint.name not in self.file.moving:
            return RotationMatrix()
        arm = self.file.arm
        behind = {each.name for each in self.urdf.chain(joint.child)}
        if arm is not None and arm.joints[-1] in behind:
            return self._hand_rotation(arm.hand)
        axis_B = X_BF.rotation() @ joint.axis
        return RotationMatrix() if np.max(np.abs(axis_B)) > 1.0 - _STRAIGHT else X_BF.rotation()

    def _hand_rotation(self, hand: HandFile) -> RotationMatrix:
        along, closing = (_unit(axis) for axis in (hand.along, hand.closing))
        if abs(along @ closing) > 0.5:
            raise self.error(("arm", "hand", "closing"), "is the same axis as along", "name another axis")
        R_LH = RotationMatrix(np.column_stack([along, np.cross(closing, along), closing]))
        return self.X_BL[hand.link].rotation() @ R_LH

    # -- text -----------------------------------------------------------------------------------------------------

    def text(self) -> str:
        """URDF text of the robot in a plant."""
        return self._text(planned=False)

    def planned_text(self) -> str:
        """URDF text for planners: its root is `body`; without visuals and pads, with boxes in place of meshes."""
        return self._text(planned=True)

    def _text(self, *, planned: bool) -> str:
        robot = Element("robot", name=self.file.name)
        gripper = self.file.gripper
        for carrier, X_BC in self._X_BC.items():
            members = [link for link in self.urdf.links if self._carrier[link] == carrier]
            element = ElementTree.SubElement(robot, "link", name=carrier)
            self._add_inertial(element, carrier, members)
            for link in members:
                self._add_shapes(element, link, planned=planned)
            if not planned and gripper is not None and gripper.pads:
                pads = self._pads(gripper) if gripper.pads is True else gripper.pads
                self._add_pads(element, carrier, X_BC, gripper, pads)
        for joint in self.joints.values():
            self._add_joint(robot, joint, from_body=planned)
        ElementTree.indent(robot)
        return ElementTree.tostring(robot, encoding="unicode")

    def _add_joint(self, robot: Element, joint: UrdfJoint, *, from_body: bool) -> None:
        """Adds a joint; with `from_body`, a lift joint carries the link below it, at the same joint position."""
        parent, child = self.carrier(joint.parent), self._name(joint.child)
        if joint.name not in self.file.moving:
            X_PC = self._X_BC[parent].inverse() @ self._X_BC[child]
            urdf_text.add_fixed(robot, joint.name, parent, child, np.round(X_PC.translation(), DIGITS) + 0.0)
            return
        axis_B = (self.X_BL[joint.parent] @ joint.X_PF).rotation() @ joint.axis
        if child == BODY and from_body:
            parent, child, axis_B = child, parent, -axis_B
        X_PF = self._X_BC[parent].inverse() @ self._X_BC[child]
        zero = self._zero[joint.name] if self._closes(joint) else 0.0
        part = {
            "offset": np.round(X_PF.translation(), DIGITS) + 0.0,
            "rpy": np.round(RollPitchYaw(X_PF.rotation()).vector(), DIGITS) + 0.0,
            "axis": np.round(self._X_BC[child].rotation().inverse() @ axis_B, DIGITS) + 0.0,
            "range": (joint.lower - zero, joint.upper - zero),
            "effort": joint.effort,
        }
        urdf_text.add_joint(robot, joint.name, parent, child, part, joint.kind)

    def _closes(self, joint: UrdfJoint) -> bool:
        return self.file.gripper is not None and joint.name in self.file.gripper.joints

    def _add_shapes(self, element: Element, link: str, *, planned: bool) -> None:
        X_CL = self.X_CL(link)
        for role in ("collision",) if planned else ("visual", "collision"):
            for shape in self.urdf.shapes(link, role):
                geometry, contact, X_CS = shape.find("geometry"), shape.find(_CONTACT), X_CL @ self.urdf.origin(shape)
                assert geometry is not None
                copied = ElementTree.SubElement(element, role, name=f"{link}_{role}_{len(element)}")
                mesh, origin = geometry.find("mesh"), shape.find("origin")
                if mesh is not None and planned:
                    geometry, X_CS = self._box_of(mesh, X_CS)
                elif origin is not None and X_CL.IsExactlyIdentity():
                    copied.append(origin)
                if copied.find("origin") is None:
                    _add_origin(copied, X_CS)
                copied.append(geometry)
                if mesh is None and (material := shape.find("material")) is not None:
                    copied.append(self._with_colour(material))
                if contact is not None:
                    copied.append(contact)

    def _with_colour(self, material: Element) -> Element:
        """A material with its colour, which may be defined at the top of the file."""
        named = (each for each in self.urdf.robot.findall("material") if each.get("name") == material.get("name"))
        return material if len(material) else next(named, material)

    def _box_of(self, mesh: Element, X_CS: RigidTransform) -> tuple[Element, RigidTransform]:
        """Geometry of a mesh's bounding box, and its pose."""
        points = self.urdf.mesh_points(mesh)
        low, high = points.min(axis=0), points.max(axis=0)
        geometry = Element("geometry")
        ElementTree.SubElement(geometry, "box", size=urdf_text.text(np.maximum(high - low, 1e-3)))
        return geometry, X_CS @ RigidTransform((low + high) / 2.0)

    def _pads(self, gripper: GripperFile) -> PadsFile:
        """Default rubber pads at the ends of fingers, from the geometry of the gripper."""
        first = max(gripper.palm_x, gripper.tip_x - _PAD_LENGTH_M) + _PAD_RADIUS_M
        rows = np.arange(first, gripper.tip_x - _PAD_RADIUS_M + 1e-9, _PAD_STEP_M)
        half = max(0.0, gripper.half_breadth - _PAD_RADIUS_M)
        return PadsFile(x=tuple(rows.tolist()), y=(-half, 0.0, half))

    def _add_pads(
        self, element: Element, carrier: str, X_BC: RigidTransform, gripper: GripperFile, pads: PadsFile
    ) -> None:
        """Adds rubber pads to the inner face of a sliding finger: spheres that protrude a little from the face."""
        joint = next((each for each in self.joints.values() if self._name(each.child) == carrier), None)
        if joint is None or joint.name not in gripper.joints or gripper.kind is not GripperKind.PARALLEL:
            return
        assert self.hand_link is not None
        p_HC = (self._X_BC[self.hand_link].inverse() @ X_BC).translation().round(DIGITS)
        opens_C = X_BC.rotation().inverse() @ (self.X_BL[joint.parent] @ joint.X_PF).rotation() @ joint.axis
        side = math.copysign(1.0, float(opens_C[2]) * gripper.joints[joint.name])
        z = gripper.closing_z - float(p_HC[2]) + side * (_PAD_RADIUS_M - pads.proud)
        xz, y = [(x - p_HC[0], z) for x in pads.x], np.array(pads.y) - p_HC[1]
        grid = {"radius": _PAD_RADIUS_M, "xz": np.round(xz, DIGITS) + 0.0, "y": np.round(y, DIGITS) + 0.0}
        for k, (shape, contact) in enumerate(urdf_text.pad_shapes([grid], _PAD_FRICTION, _PAD_STIFFNESS_N_M)):
            urdf_text.add_collision(element, f"{carrier}_pad_{k}", shape, contact)

    # -- masses ---------------------------------------------------------------------------------------------------

    def _add_inertial(self, element: Element, carrier: str, members: list[str]) -> None:
        whole = _joined([mass for link in members if (mass := self._mass(link)) is not None])
        if whole is None:
            if carrier in self.casters:
                return
            link = next((each for each in members if self.urdf.shapes(each, "visual")), members[0])
            what, hint = f"link {link} has no mass", "write <inertial> with mass and inertia into it"
            raise self.urdf.error(self.urdf.links[link], what, hint)
        inertial = ElementTree.SubElement(element, "inertial")
        ElementTree.SubElement(inertial, "origin", xyz=urdf_text.text(whole.com))
        ElementTree.SubElement(inertial, "mass", value=str(whole.mass_kg))
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = whole.moments
        moments = {"ixx": xx, "iyy": yy, "izz": zz, "ixy": xy, "ixz": xz, "iyz": yz}
        ElementTree.SubElement(inertial, "inertia", {key: str(value) for key, value in moments.items()})

    def _mass(self, link: str) -> _Mass | None:
        """Mass of a link in its carrier's frame; None when it has none. Raises InputError when it is not physical."""
        inertial = self.urdf.links[link].find("inertial")
        if inertial is None:
            return None
        (mass_kg,) = self.urdf.numbers(inertial.find("mass"), "value", "0")
        inertia, X_CI = inertial.find("inertia"), self.X_CL(link) @ self.urdf.origin(inertial)
        xx, yy, zz, xy, xz, yz = (
            self.urdf.numbers(inertia, f"i{axes}", "0")[0] for axes in ("xx", "yy", "zz", "xy", "xz", "yz")
        )
        moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        low, middle, high = np.linalg.eigvalsh(moments)
        if mass_kg < 0.0 or (mass_kg > 0.0 and not 0.0 < high <= (low + middle) * (1.0 + 1e-6)):
            what = f"link {link} has a zero inertia" if high <= 0.0 else f"link {link} has an inertia that no body has"
            hint = "write the moments of its mass about its centre; a box has m (y^2 + z^2) / 12 about x"
            raise self.urdf.error(inertial, what, hint)
        R = X_CI.rotation().matrix()
        return _Mass(mass_kg, X_CI.translation(), R @ moments @ R.T) if mass_kg else None

    @property
    def mass_kg(self) -> float:
        """Mass of the whole robot."""
        return sum(mass.mass_kg for link in self.urdf.links if (mass := self._mass(link)) is not None)


def _joined(masses: list[_Mass]) -> _Mass | None:
    """Mass of several bodies that form one; None when there is none."""
    if len(masses) == 1:
        return masses[0]
    total = sum(each.mass_kg for each in masses)
    if not total:
        return None
    com = np.sum([each.mass_kg * each.com for each in masses], axis=0) / total
    moments = np.zeros((3, 3))
    for each in masses:
        d = each.com - com
        moments += each.moments + each.mass_kg * (d @ d * np.eye(3) - np.outer(d, d))
    return _Mass(total, com, moments)


def _unit(axis: str) -> FloatArray:
    """Unit vector (3,) of an axis such as "-y"."""
    return np.asarray((-1.0 if axis.startswith("-") else 1.0) * np.eye(3)["xyz".index(axis[-1])])


def _add_origin(element: Element, X: RigidTransform) -> None:
    rpy = RollPitchYaw(X.rotation()).vector()
    ElementTree.SubElement(element, "origin", xyz=urdf_text.text(X.translation()), rpy=urdf_text.text(rpy))
