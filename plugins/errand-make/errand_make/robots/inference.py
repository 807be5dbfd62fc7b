"""Infers a robot's parts from its URDF, for the first text of its `robot.yaml`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from errand_make.robots.base import LIDAR, NEARBY, floor_m, front_rotation, motion_of, outline_polygon
from errand_make.robots.checks import check_limits
from errand_make.robots.drive import Drive, standing_legs, why_nothing_drives
from errand_make.robots.gripper import arm_places, hand_axes, measure_gripper, rounded, why_no_gripper
from errand_make.robots.inertia import repair_masses
from errand_make.robots.parts import LEAST_ARM, Arm, Parts, find_parts, is_camera
from errand_make.robots.posture import SIDE_WEIGHTS, held_postures, positions
from errand_make.robots.source import edited_text
from errand_make.robots.tree import KinematicTree, planar_joints
from errand_make.robots.units import unit_notes
from plant.robots.urdf_robot.kind import urdf_kind
from plant.robots.urdf_robot.robot_file import CameraFile, LidarFile
from plant.robots.urdf_robot.urdf_file import UrdfFile, UrdfJoint, read_urdf_text
from skills.inputs.errors import InputError, listing
from skills.inputs.yaml_source import yaml_of
from skills.robot import Capabilities, FloatArray

ROBOT_FILE: Final = "robot.yaml"
_NO_LIDAR: Final = re.compile(r"rgbd|depth|camera|tilt|virtual", re.IGNORECASE)
_MOST_CAMERAS: Final = 4
_NEAR_M: Final = 0.1
"""Distance within which two links are one camera."""
_LEAST_LIDAR_M: Final = 0.06
_LIDAR_M: Final = 0.25
"""Height of a LiDAR that the file lacks."""
_SHOULDER_M: Final = 0.9
"""Height at which a lift holds a shoulder for tables and counters."""
_OVERHANG_M: Final = 0.02
_AHEAD: Final = "errand_ahead"
_LIDAR_LINK: Final = "errand_lidar"
_Z_AHEAD: Final = RotationMatrix(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]))
"""R_LB of a link L whose y is up and whose z is ahead."""
Notes = list[tuple[str, str]]


@dataclass(frozen=True)
class Found:
    """The parts of a robot, with the tree that has its lifts and unused chains at their held positions."""

    tree: KinematicTree
    parts: Parts
    arm: Arm | None
    held: Mapping[str, float]
    ground_m: float


class Inference:
    """Inference from a URDF: `data` of the robot's file, and `notes` on a person's decisions, each with its key.

    It repairs the URDF's attributes; `links` is the text of links that it adds.
    """

    def __init__(self, urdf: UrdfFile, source: UrdfFile, name: str) -> None:
        """`urdf` has the copies of the meshes, and lacks the simulated sensors of `source`.

        Raises InputError for a robot that does not drive, and for impossible masses of links that move.
        """
        self.urdf, self.notes, self.links = urdf, Notes(), ""
        self._sensors, self._text = source.sensors, source.text + read_urdf_text(source.path)
        self._base, tree, parts = self._placed()
        what, hint = why_nothing_drives(tree, parts.drive)
        if what:
            raise InputError(what, hint=hint, file=source.path, line=int(urdf.links[urdf.root].get("line", "1")))
        self.found = self._hold(tree, parts)
        self.data: dict[str, Any] = {"name": name, "urdf": "robot.urdf", "base": self._base_data()}
        self.data["lidar"] = LidarFile(link=self._lidar()).model_dump(mode="json")
        head = self._head()
        if cameras := self._cameras(head):
            self.data["cameras"] = cameras
        if head:
            self.data["head"] = [each.name for each in head]
        if self.found.arm is not None:
            self._add_arm(self.found.arm)
        self._add_held()
        driven = [*self.data.get("head", ()), *self.data.get("arm", {}).get("joints", ())]
        driven += self.data.get("gripper", {}).get("joints", ())
        check_limits(urdf, driven)
        wheels = [each.joint.child for each in self.found.parts.wheels]
        self.notes += [("urdf", note) for note in repair_masses(self.found.tree, driven, wheels)]
        self.notes += [("urdf", note) for note in unit_notes(self.found.tree, wheels)]

    def text(self) -> str:
        """Text of the URDF with its repairs and added links."""
        return edited_text(self.urdf, self.links)

    # -- frame and posture ----------------------------------------------------------------------------------------

    def _tree(self, base: str, turn: RotationMatrix) -> KinematicTree:
        return KinematicTree(self.urdf, base, RigidTransform(turn, np.zeros(3)), text=self._text)

    def _placed(self) -> tuple[str, KinematicTree, Parts]:
        """Link of the base, with tree and parts in its frame B; adds a link where x is not ahead and z not up."""
        planar = planar_joints(self.urdf)
        base = planar[-1].child if planar else self.urdf.root
        tree = self._tree(base, RotationMatrix())
        near = [link for link in ("base_link", "base_footprint") if link in tree.links_of[tree.root]]
        if near:
            base = near[0]
            tree = self._tree(base, RotationMatrix())
        parts, turn = find_parts(tree), RotationMatrix()
        if parts.drive in (Drive.FREE, Drive.NOTHING, Drive.LEGS) and len(parts.legs) < 4:
            if len(find_parts(self._tree(base, _Z_AHEAD)).legs) >= 4:
                turn = _Z_AHEAD
                self.notes.append(("base", "its legs stand towards -y: y is taken as up, and z as ahead"))
        elif parts.drive in (Drive.AXLE, Drive.STEERED) and abs(float(parts.mounted[0].axis_B[1])) < 0.95:
            turn = front_rotation(tree, parts)
            yaw_rad = float(RollPitchYaw(turn).yaw_angle())
            front = {90: "y", -90: "-y"}.get(round(math.degrees(yaw_rad)), f"at {math.degrees(yaw_rad):.0f} degrees")
            axis = "x" if abs(float(parts.mounted[0].axis_B[0])) > 0.95 else "a skew axis"
            self.notes.append(("base", f"its wheels turn about {axis}, so the robot's front is {front} of {base}"))
        if parts.drive in (Drive.FREE, Drive.NOTHING) and (posture := standing_legs(tree)):
            tree = replace(tree, posture=posture)
            parts = find_parts(tree)
        for each in parts.wheels:
            if not each.is_round:
                what = f"the shape of {each.joint.child} is not round about the axis of {each.joint.name}"
                self.notes.append(("base", f"{what}: check that axis"))
        if turn.IsExactlyIdentity():
            return base, tree, parts
        rpy = " ".join(f"{each:.7f}" for each in RollPitchYaw(turn).vector())
        self.links += _fixed_link(_AHEAD, base, "0 0 0", rpy)
        tree = self._tree(base, turn)
        return _AHEAD, tree, find_parts(tree)

    def _hold(self, tree: KinematicTree, parts: Parts) -> Found:
        """Chooses the arm, and finds the posture in which all that no part drives is held."""
        ground_m = floor_m(tree, parts)
        arms = sorted(parts.arms, key=lambda arm: (why_no_gripper(tree, arm) != "", -len(arm.joints)))
        arm = arms[0] if arms else None
        held = dict(tree.posture)
        telescopes = {each.name for chain in parts.sliding for each in chain}
        for lift in (each for each in parts.lifts if each.name not in telescopes):
            held |= self._hold_lift(tree, lift, arm, ground_m)
        tree = replace(tree, posture=dict(held))
        chains = [list(each.joints) for each in arms[1:]] + [list(each) for each in parts.sliding]
        away = {link for chain in (arms[0].joints if arms else (), *chains) for link in _carried(tree, chain)}
        own = tree.points(link for link in self.urdf.links if link not in away)
        for chain in chains if len(own) else ():
            q = held_postures(tree, chain, own, ground_m, leave=away)[0]
            held |= {each.name: float(at) for each, at in zip(chain, q, strict=True)}
            tree = replace(tree, posture=dict(held))
        for arm_ in arms[1:]:
            names = ", ".join(each.name for each in arm_.joints)
            self.notes.append(("arm", f"a further arm ({names}) is held; to drive it, name its joints here instead"))
        for slides in parts.sliding:
            self._note_sliding(slides)
        if parts.no_arm:
            why = f"{parts.no_arm}; Errand drives arms of {LEAST_ARM} or more joints that turn, so this one is held"
            self.notes.append(("held", f"no arm is taken: {why}"))
        return Found(tree, parts, arm, held, ground_m)

    def _hold_lift(self, tree: KinematicTree, lift: UrdfJoint, arm: Arm | None, ground_m: float) -> dict[str, float]:
        """Position at which a lift is held, with a note how it is driven instead."""
        at = lift.clipped(0.0)
        if arm is not None and arm.joints[0] in tree.below(lift):
            shoulder_m = float(tree.place(arm.joints[0])[2]) - ground_m
            at = lift.clipped(at + math.copysign(_SHOULDER_M - shoulder_m, float(tree.axis(lift)[2])))
            at = at if abs(at) < 10.0 and shoulder_m < _SHOULDER_M else lift.clipped(0.0)
        words = f"lift: {{joint: {lift.name}, travelling: {rounded(at)}}}"
        what = f"lift {lift.name} is held at {rounded(at)} m; to drive it, write `{words}`"
        self.notes.append(("held", f"{what} and a base.link that it carries, with x ahead and z up"))
        return {lift.name: rounded(at)}

    def _note_sliding(self, chain: Sequence[UrdfJoint]) -> None:
        names = ", ".join(each.name for each in chain if each.kind == "prismatic")
        turn = sum(each.kind != "prismatic" for each in chain)
        what = f"no arm is taken: {names} slide (a telescopic arm), and {turn} of its joints turn"
        self.notes.append(("held", f"{what}; Errand drives arms of 4 or more joints that turn, so this one is held"))

    # -- base -----------------------------------------------------------------------------------------------------

    def _base_data(self) -> dict[str, Any]:
        found, parts = self.found, self.found.parts
        away = set() if found.arm is None else set(_carried(found.tree, found.arm.joints))
        points = found.tree.points(link for link in self.urdf.links if link not in away)
        points = points[points[:, 2] > found.ground_m - 0.01]
        if not len(points):
            points = np.array([[-0.25, -0.25, 0.0], [0.25, 0.25, 0.3]])
            self.notes.append(("base", "its links have no shapes: write footprint and height"))
        motion, note = motion_of(parts)
        data: dict[str, Any] = {"link": self._base, "motion": motion}
        data["height"] = rounded(max(0.0, -found.ground_m))
        data["footprint"] = outline_polygon(points[:, :2])
        data |= {"max_speed": 0.6, "max_turn_rate": 1.0, "runtime": 7200.0}
        self.notes.append(("base", f"{note}; speeds (m/s, rad/s) and the battery's time (s) are a guess"))
        if parts.casters:
            many = len(parts.casters)
            what = f"{many} casters belong to the base and do" if many > 1 else "1 caster belongs to the base and does"
            self.notes.append(("base", f"{what} not turn"))
        return data

    def arm_points(self, angles: FloatArray) -> FloatArray:
        """Corners (N, 3) of the arm and its hand in B at angles (J,)."""
        found = self.found
        assert found.arm is not None
        names = (each.name for each in found.arm.joints)
        tree = replace(found.tree, posture={**found.held, **dict(zip(names, map(float, angles), strict=True))})
        return tree.points(_carried(tree, found.arm.joints))

    def stowed(self, angles: FloatArray, free: Callable[[Sequence[FloatArray]], FloatArray]) -> FloatArray:
        """Angles of the stowed arm: the given ones, unless free ones are found that stick out less."""
        found, polygon = self.found, np.array(self.data["base"]["footprint"])
        if self._overhang_m(self.arm_points(angles)).max() <= _OVERHANG_M or found.arm is None:
            return angles
        corners = np.column_stack([polygon, np.zeros(len(polygon))])
        tries = held_postures(found.tree, found.arm.joints, corners, found.ground_m)
        other = free(list(tries))
        less = self._overhang_m(self.arm_points(other)) @ SIDE_WEIGHTS
        return other if less < self._overhang_m(self.arm_points(angles)) @ SIDE_WEIGHTS else angles

    def _overhang_m(self, points_B: FloatArray) -> FloatArray:
        """Distances (2,) by which points stick out of the footprint along x and y."""
        polygon = np.array(self.data["base"]["footprint"])
        low, high = polygon.min(axis=0), polygon.max(axis=0)
        return np.asarray(np.maximum(points_B[:, :2] - high, low - points_B[:, :2]).max(axis=0, initial=0.0))

    def widen_footprint(self, points_B: FloatArray) -> None:
        """Lets the footprint contain the stowed arm, where it sticks out."""
        beyond_m = float(self._overhang_m(points_B).max())
        if beyond_m > _OVERHANG_M:
            polygon = np.array(self.data["base"]["footprint"])
            self.data["base"]["footprint"] = outline_polygon(np.vstack([polygon, points_B[:, :2]]))
            self.notes.append(("base", f"the stowed arm sticks out by {beyond_m:.2f} m, which the footprint contains"))

    # -- sensors --------------------------------------------------------------------------------------------------

    def _simulated(self, kinds: str) -> list[str]:
        return [link for link, kind in self._sensors if link in self.urdf.links and re.search(kinds, kind)]

    def _lidar(self) -> str:
        tree, ground_m = self.found.tree, self.found.ground_m
        found = [*self._simulated("ray|lidar"), *(link for link in self.urdf.links if LIDAR.search(link))]
        found = [link for link in found if not NEARBY.search(link)]
        fixed = [link for link in dict.fromkeys(found) if tree.body_of[link] == tree.root and not is_camera(link)]
        fixed = [link for link in fixed if float(tree.X_BL[link].translation()[2]) - ground_m > _LEAST_LIDAR_M]
        ahead_m = {link: float(tree.X_BL[link].translation()[0]) for link in fixed}
        fixed.sort(key=lambda link: (_NO_LIDAR.search(link) is not None, "mount" in link, ahead_m[link] < 0.0))
        if fixed:
            self.notes.append(
                ("lidar", "its field of view (rad), range (m) and rate (Hz) are not in a URDF, and are a guess")
            )
            return fixed[0]
        place = f"0 0 {rounded(ground_m + _LIDAR_M)}"
        self.links += _fixed_link(_LIDAR_LINK, self._base, place, "0 0 0")
        what = f"no link looks like a LiDAR: link {_LIDAR_LINK} is added {_LIDAR_M} m above the floor"
        self.notes.append(("lidar", f"{what}; name yours, whose x is ahead and z up"))
        return _LIDAR_LINK

    def _cameras(self, head: Sequence[UrdfJoint]) -> dict[str, Any]:
        found = [*self._simulated("camera|depth"), *(link for link in self.urdf.links if is_camera(link))]
        links = sorted(dict.fromkeys(found), key=lambda link: ("optical" not in link, "depth" in link))
        tree, arm, cameras, places = self.found.tree, self.found.arm, dict[str, Any](), list[FloatArray]()
        behind_tilt = set(tree.links_below(head[1])) if head else set()
        tip = set() if arm is None else set(tree.links_of[arm.joints[-1].child])
        moved = set(tree.links_below(head[0])) if head else set()
        for chain in (*(each.joints for each in self.found.parts.arms), *self.found.parts.sliding):
            moved |= set(_carried(tree, chain))
        links.sort(key=lambda link: (link not in behind_tilt, link not in tip))
        lost = [link for link in links if link in moved - behind_tilt - tip]
        for link in links:
            p = tree.X_BL[link].translation()
            apart = all(float(np.linalg.norm(p - other)) > _NEAR_M for other in places)
            if link in lost or not apart or len(cameras) == _MOST_CAMERAS:
                continue
            places.append(p)
            file = CameraFile(link=link, axes="optical" if "optical" in link else "link")
            cameras[f"camera_{len(cameras)}"] = file.model_dump(mode="json")
        note = "pixels, field of view (rad) and depth (m) are not in a URDF, and are a guess"
        if not cameras and not lost:
            note = "no link looks like a camera, so the robot finds no objects; to give it one, name its link here"
        if cameras or not lost:
            self.notes.append(("cameras", note))
        if lost:
            self.notes.append(("cameras", f"left out, since no part points them: {listing(lost)}"))
        return cameras

    def _head(self) -> tuple[UrdfJoint, ...]:
        """Joints of pan and tilt, with axes turned to z up and y to the left."""
        head, tree = self.found.parts.head, self.found.tree
        if head is None:
            return ()
        lacking = [
            each.name for each in head if not (each.lower < each.upper and each.effort > 0.0 and each.velocity > 0.0)
        ]
        wanted = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
        axes = np.array([tree.axis(each) for each in head])
        if lacking or not np.allclose(np.abs(axes), wanted, atol=1e-3):
            why = f"{lacking[0]} has no limits of effort and velocity" if lacking else "its axes are not z and y"
            self.notes.append(("held", f"the head ({head[0].name}, {head[1].name}) is held: {why}"))
            return ()
        turned = [each for each, axis in zip(head, axes, strict=True) if axis.sum() < 0.0]
        for each in turned:
            self._turn_axis(each)
        if turned:
            names = listing([each.name for each in turned])
            self.notes.append(
                ("head", f"the axis of {names} is turned round in robot.urdf, so that it is z up or y left")
            )
        return head

    def _turn_axis(self, joint: UrdfJoint) -> None:
        """Turns a joint's axis round, with its limits."""
        element = next(each for each in self.urdf.robot.findall("joint") if each.get("name") == joint.name)
        axis, limit = element.find("axis"), element.find("limit")
        if axis is not None and limit is not None:
            axis.set("xyz", " ".join(f"{each:.10g}" for each in -joint.axis))
            limit.set("lower", f"{-joint.upper:.10g}")
            limit.set("upper", f"{-joint.lower:.10g}")

    # -- arm ------------------------------------------------------------------------------------------------------

    def _add_arm(self, arm: Arm) -> None:
        tree, last = self.found.tree, arm.joints[-1]
        hand, tip_m, gripper = hand_axes(tree, last), 0.0, None
        why = why_no_gripper(tree, arm)
        if why:
            self.notes.append(("arm", f"no gripper is taken: {why}; the axes of the hand are a guess"))
        else:
            hand, gripper = measure_gripper(tree, last, arm.fingers)
            tip_m = gripper["tip_x"]
        p_BJ = [tree.place(joint) for joint in arm.joints]
        front_m = max(float(x) for x, _ in self.data["base"]["footprint"])
        self.data["arm"] = {
            "joints": [joint.name for joint in arm.joints],
            "stowed": [rounded(joint.clipped(0.0)) for joint in arm.joints],
            "hand": hand,
        }
        self.data["arm"] |= arm_places(float(p_BJ[0][0]), float(p_BJ[0][2]), arm.reach_m, tip_m, front_m)
        note = "stowed was found by a search; max_payload (kg) is a guess; distances (m) follow from the reach"
        self.notes.append(("arm", note))
        if gripper is not None:
            self.data["gripper"] = gripper
            note = "measured at the shapes of the fingers, in the hand frame (x along them, z their closing)"
            self.notes.append(("gripper", note))

    def _add_held(self) -> None:
        tree, parts = self.found.tree, self.found.parts
        driven = {*self.data.get("head", ()), *self.data.get("arm", {}).get("joints", ())}
        driven |= {*self.data.get("gripper", {}).get("joints", ()), *(each.joint.name for each in parts.wheels)}
        rest = [each for each in tree.joint_of.values() if each.name not in driven]
        if rest:
            self.data["held"] = positions(rest, self.found.held)
            self.notes.append(("held", "joints that no part names are fixed here (rad, m)"))


def _fixed_link(name: str, parent: str, place: str, rpy: str) -> str:
    return (
        f'<link name="{name}"/><joint name="{name}_mount" type="fixed"><parent link="{parent}"/><child link="{name}"/>'
        f'<origin xyz="{place}" rpy="{rpy}"/></joint>'
    )


def _carried(tree: KinematicTree, chain: Sequence[UrdfJoint]) -> list[str]:
    return tree.links_below(chain[0]) if chain else []


def write_robot_file(
    source: UrdfFile, name: str, folder: Path, stow: Callable[[Capabilities, Sequence[FloatArray]], FloatArray]
) -> tuple[Capabilities, list[str]]:
    """Writes the `robot.yaml` of a robot whose `robot.urdf` is in a folder; `source` is the file it was made from.

    `stow` finds the angles of the stowed arm, among some that it is given where one of them is free. Returns the
    robot's capabilities and the points for a person to check.
    Raises InputError for impossible values.
    """
    path = folder / "robot.urdf"
    inference = Inference(UrdfFile(path), source, name)
    path.write_text(inference.text(), encoding="utf-8")
    _write(folder / ROBOT_FILE, inference)
    can = urdf_kind(folder / ROBOT_FILE).capabilities()
    arm = inference.found.arm
    if can.arm is not None and arm is not None:
        stowed = inference.stowed(stow(can, []), lambda tries: stow(can, tries))
        inference.data["arm"]["stowed"] = [rounded(angle) for angle in stowed]
        inference.widen_footprint(inference.arm_points(stowed))
        _write(folder / ROBOT_FILE, inference)
        can = urdf_kind(folder / ROBOT_FILE).capabilities()
    return can, [f"{key}: {note}" for key, note in inference.notes]


def _write(path: Path, inference: Inference) -> None:
    """Writes a robot's file, with a comment before each part for a person to check."""
    lines = ["# A robot for Errand. SI units: m, rad, kg, N, s; `docs/how-to/own-robot.md` explains the keys.\n"]
    for key, value in inference.data.items():
        lines += [f"# CHECK: {note}.\n" for at, note in inference.notes if at == key]
        lines.append(yaml_of({key: value}) if isinstance(value, dict) else f"{key}: {value}\n")
    path.write_text("".join(lines), encoding="utf-8")
