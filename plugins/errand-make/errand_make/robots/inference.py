"""Infers a robot's parts from its URDF, for the first text of its `robot.yaml`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydrake.math import RigidTransform

from plant.robots.urdf_robot.kind import urdf_kind
from plant.robots.urdf_robot.robot_file import CameraFile, LidarFile
from plant.robots.urdf_robot.urdf_file import UrdfFile, UrdfJoint
from skills.inputs.yaml_source import yaml_of
from skills.robot import Capabilities, FloatArray

_LIDAR: Final = re.compile(r"lidar|laser|scan|hokuyo|velodyne|rplidar|ouster|sick", re.IGNORECASE)
_CAMERA: Final = re.compile(r"camera|kinect|realsense|rgbd|d4[35]5|zed|xtion", re.IGNORECASE)
_LEAST_ARM: Final = 4
_TURNS: Final = ("revolute", "continuous")
_NEAR_M: Final = 0.03
_ROUND: Final = 0.08
_CORNERS: Final = 12
ROBOT_FILE: Final = "robot.yaml"
Notes = dict[str, str]


class Inference:
    """Inference from a URDF: `data` of the robot's file, and `notes` by its keys on a person's decisions."""

    def __init__(self, urdf: UrdfFile, source: UrdfFile, name: str) -> None:
        """`urdf` is what `copy_meshes` wrote, without the simulated sensors of `source`."""
        self.urdf, self.notes, self._sensors = urdf, Notes(), source.sensors
        self._X = urdf.poses({})
        self._moving = {joint.child: joint for joint in urdf.order if joint.moves}
        self._fixed = self._fixed_to(urdf.root)
        self._base = next((link for link in ("base_link", "base_footprint") if link in self._fixed), urdf.root)
        self._wheels = [joint for joint in self._moving.values() if self._is_wheel(joint)]
        self._arm = self._arm_joints()
        head = self._head()
        camera_links = self._cameras()
        self.data: dict[str, Any] = {"name": name, "urdf": "robot.urdf", "base": self._base_data()}
        self.data["lidar"] = LidarFile(link=self._lidar()).model_dump(mode="json")
        if camera_links:
            self.data["cameras"] = camera_links
        if head:
            self.data["head"] = head
        if self._arm:
            self._add_arm()
        driven = {*(head or ()), *(joint.name for joint in self._arm), *self.data.get("gripper", {}).get("joints", ())}
        rest = [each for each in self._moving.values() if each.name not in driven and each not in self._wheels]
        if rest:
            self.data["held"] = {joint.name: round(joint.clipped(0.0), 4) for joint in rest}
            self.notes["held"] = "joints that no part names are fixed here (rad, m)"

    # -- geometry -------------------------------------------------------------------------------------------------

    def _fixed_to(self, link: str) -> set[str]:
        """A link and all that is fixed to it."""
        found = {link}
        for joint in self.urdf.order:
            if joint.parent in found and not joint.moves:
                found.add(joint.child)
        return found

    def _points(self, links: Iterable[str], of: str) -> FloatArray:
        """Corners (N, 3) of the collision shapes of links, else of what is drawn, in the frame of a link."""
        X_OR = self._X[of].inverse()
        found = [np.empty((0, 3))]
        for link in links:
            for shape in self.urdf.shapes(link, "collision") or self.urdf.shapes(link, "visual"):
                X = X_OR @ self._X[link] @ self.urdf.origin(shape)
                found.append((X @ self._corners(shape).T).T)
        return np.concatenate(found)

    def _corners(self, shape: Any) -> FloatArray:
        geometry, numbers = shape.find("geometry"), self.urdf.numbers
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
        return self.urdf.mesh_points(geometry.find("mesh"))

    # -- base -----------------------------------------------------------------------------------------------------

    def _is_wheel(self, joint: UrdfJoint) -> bool:
        axis = (self._X[self._base].inverse() @ self._X[joint.parent] @ joint.X_PF).rotation() @ joint.axis
        leaf = not any(each.parent in self._fixed_to(joint.child) for each in self._moving.values())
        return joint.kind == "continuous" and joint.parent in self._fixed and leaf and abs(float(axis[1])) > 0.9

    def _base_data(self) -> dict[str, Any]:
        wheels = [each for joint in self._wheels for each in self._fixed_to(joint.child)]
        points = self._points([*self._fixed, *wheels], self._base)
        if not len(points):
            points = np.array([[-0.25, -0.25, 0.0], [0.25, 0.25, 0.3]])
            self.notes["base"] = "its links have no shapes: write footprint and height"
        data: dict[str, Any] = {"link": self._base, "motion": "differential" if self._wheels else "omnidirectional"}
        data["height"] = _rounded(max(0.0, -float(points[:, 2].min())))
        data["footprint"] = _outline(points[:, :2])
        data |= {"max_speed": 0.6, "max_turn_rate": 1.0, "runtime": 7200.0}
        note = f"{len(self._wheels)} wheels were found; speeds (m/s, rad/s) and the battery's time (s) are a guess"
        self.notes.setdefault("base", note)
        return data

    # -- sensors --------------------------------------------------------------------------------------------------

    def _sensor_links(self, kinds: re.Pattern[str], names: re.Pattern[str]) -> list[str]:
        """Links with a simulated sensor of a kind, then links with such a name."""
        found = [link for link, kind in self._sensors if link in self.urdf.links and kinds.search(kind)]
        return [*found, *(link for link in self.urdf.links if names.search(link) and link not in found)]

    def _lidar(self) -> str:
        found = [link for link in self._sensor_links(re.compile("ray|lidar"), _LIDAR) if link in self._fixed]
        self.notes["lidar"] = "its field of view (rad), range (m) and rate (Hz) are not in a URDF, and are a guess"
        if not found:
            self.notes["lidar"] = "no link looks like a LiDAR: name one, whose x is ahead and z up"
        return found[0] if found else self._base

    def _cameras(self) -> dict[str, Any]:
        found = self._sensor_links(re.compile("camera|depth"), _CAMERA)
        found.sort(key=lambda link: ("optical" not in link, "depth" in link))
        cameras = dict[str, Any]()
        taken = list[FloatArray]()
        for link in found:
            p = self._X[link].translation()
            if all(float(np.linalg.norm(p - other)) > 3.0 * _NEAR_M for other in taken):
                taken.append(p)
                file = CameraFile(link=link, axes="optical" if "optical" in link else "link")
                cameras[f"camera_{len(cameras)}"] = file.model_dump(mode="json")
        self.notes["cameras"] = "pixels, field of view (rad) and depth (m) are not in a URDF, and are a guess"
        return cameras

    def _head(self) -> list[str] | None:
        """Joints of pan and tilt, in this order."""
        for tilt in self._moving.values():
            before = [joint for joint in self.urdf.chain(tilt.parent) if joint.moves]
            if not before or tilt in self._arm or before[-1] in self._arm or before[-1] in self._wheels:
                continue
            axes = [(self._X[each.parent] @ each.X_PF).rotation() @ each.axis for each in (before[-1], tilt)]
            if all(each.kind in _TURNS for each in (before[-1], tilt)) and np.allclose(axes, [[0, 0, 1], [0, 1, 0]]):
                return [before[-1].name, tilt.name]
        return None

    # -- arm ------------------------------------------------------------------------------------------------------

    def _after(self, joint: UrdfJoint) -> list[UrdfJoint]:
        """Moving joints that come next behind a joint."""
        links = self._fixed_to(joint.child)
        return [each for each in self._moving.values() if each.parent in links]

    def _arm_joints(self) -> list[UrdfJoint]:
        """The longest chain of revolute joints without branches."""
        runs = list[list[UrdfJoint]]()
        for first in self._moving.values():
            run = [first]
            while run[-1].kind in _TURNS and len(after := self._after(run[-1])) == 1 and after[0].kind in _TURNS:
                run.append(after[0])
            runs.append(run)
        runs.sort(key=len, reverse=True)
        best = runs[0] if runs else []
        if sum(len(run) == len(best) for run in runs) > 1:
            self.notes["arm"] = "there are several arms; this is the first"
        return best if len(best) >= _LEAST_ARM else []

    def _add_arm(self) -> None:
        last = self._arm[-1]
        fingers = [each for each in self._after(last) if each.kind == "prismatic"]
        hand: dict[str, Any] = {"link": last.child, "along": "x", "closing": "z"}
        tip_m = 0.0
        if 1 <= len(fingers) <= 2:
            hand, gripper = self._gripper(fingers)
            self.data["gripper"], tip_m = gripper, gripper["tip_x"]
            self.notes["gripper"] = (
                "measured at the shapes of the fingers, in the hand frame (x along them, z their closing)"
            )
        else:
            self.notes["hand"] = "no fingers that slide were found: the axes of the hand are a guess"
        p_BJ = [self._frame(joint, self._base).translation() for joint in self._arm]
        reach = float(np.linalg.norm(np.diff(p_BJ, axis=0), axis=1).sum())
        gripper_data = self.data.pop("gripper", None)
        places = arm_places(float(p_BJ[0][0]), float(p_BJ[0][2]), reach, tip_m, self._front_m())
        self.data["arm"] = {
            "joints": [joint.name for joint in self._arm],
            "stowed": [0.0] * len(self._arm),
            "hand": hand,
        }
        self.data["arm"] |= places
        self.data |= {} if gripper_data is None else {"gripper": gripper_data}
        note = "stowed was found by a search; max_payload (kg) is a guess; distances (m) follow from the reach"
        self.notes["arm"] = f"{self.notes['arm']}; {note}" if "arm" in self.notes else note

    def _frame(self, joint: UrdfJoint, link: str) -> RigidTransform:
        """Frame of a joint in the frame of a link."""
        return self._X[link].inverse() @ self._X[joint.parent] @ joint.X_PF

    def _front_m(self) -> float:
        return max(float(x) for x, _ in self.data["base"]["footprint"])

    def _gripper(self, fingers: Sequence[UrdfJoint]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Hand frame and gripper of one or two fingers that slide; F is the frame of the first finger's link."""
        link = fingers[0].child
        X_FA = self._frame(self._arm[-1], link)
        shapes = [self._points(self._fixed_to(each.child), link) for each in fingers]
        shapes = [each if len(each) else np.zeros((1, 3)) for each in shapes]
        axes_F = [self._frame(each, link).rotation() @ each.axis for each in fingers]
        closing = int(np.argmax(np.abs(axes_F[0])))
        apart = float((shapes[0].mean(axis=0) - shapes[-1].mean(axis=0))[closing]) or float(axes_F[0][closing])
        ahead = np.concatenate(shapes).mean(axis=0) - X_FA.translation()
        ahead[closing] = 0.0
        along = int(np.argmax(np.abs(ahead)))
        x_F, z_F = np.sign(ahead[along]) * np.eye(3)[along], np.sign(apart) * np.eye(3)[closing]
        ways = [float(np.sign(side * axis @ z_F)) for side, axis in zip((1.0, -1.0), axes_F, strict=False)]
        closed = [each.lower if way > 0.0 else each.upper for each, way in zip(fingers, ways, strict=True)]
        R_HF = np.stack([x_F, np.cross(z_F, x_F), z_F])
        moves = [(at - each.clipped(0.0)) * axis for at, each, axis in zip(closed, fingers, axes_F, strict=True)]
        shut = [(each + move - X_FA.translation()) @ R_HF.T for each, move in zip(shapes, moves, strict=True)]
        tip_m = min(float(each[:, 0].max()) for each in shut)
        palm = ((self._points(self._fixed_to(self._arm[-1].child), link) - X_FA.translation()) @ R_HF.T)[:, 0]
        behind = palm[palm < tip_m - _NEAR_M / 3.0]
        tip = shut[0][shut[0][:, 0] > tip_m - _NEAR_M]
        widest = len(fingers) * min(each.upper - each.lower for each in fingers)
        gripper = {
            "joints": {each.name: way / len(fingers) for each, way in zip(fingers, ways, strict=True)},
            "closed": {each.name: round(at, 5) for each, at in zip(fingers, closed, strict=True)},
            "widest": _rounded(widest),
            "max_opening": _rounded(widest),
            "max_force": _rounded(min(max(min(each.effort for each in fingers), 5.0), 200.0)),
            "palm_x": _rounded(max(behind, default=min(float(each[:, 0].min()) for each in shut))),
            "tip_x": _rounded(tip_m),
            "closing_z": _rounded(tip[:, 2].min()),
            "half_breadth": _rounded(max(0.003, float(np.ptp(tip[:, 1])) / 2.0)),
            "tip_thickness": _rounded(max(0.003, float(np.ptp(tip[:, 2])))),
        }
        names = [("-" if sign < 0 else "") + "xyz"[k] for k, sign in ((along, ahead[along]), (closing, apart))]
        return {"link": link, "along": names[0], "closing": names[1]}, gripper


def arm_places(x_m: float, z_m: float, reach_m: float, tip_m: float, front_m: float) -> dict[str, Any]:
    """Working distances of an arm with its shoulder at x_m and z_m of the body, as parts of its length.

    They are those of Spot and Fetch: stands, nearer stands, carrying positions, and positions close to the body.
    """
    whole = reach_m + tip_m

    def ahead(shares: Sequence[float]) -> list[float]:
        return [_rounded(max(front_m + 0.1, x_m + share * whole)) for share in shares]

    return {
        "max_reach": _rounded(reach_m),
        "max_payload": 2.0,
        "standing": ahead((0.64, 0.675, 0.605, 0.71, 0.57, 0.535, 0.745, 0.78)),
        "nearer": ahead((0.53, 0.495, 0.46, 0.425)),
        "carry_x": [_rounded(x_m + share * whole) for share in (0.42, 0.375, 0.33, 0.465, 0.51)],
        "carry_z": [_rounded(z_m + each) for each in (0.07, 0.13, 0.19, 0.25, 0.31, 0.39, 0.47)],
        "tuck_x": [_rounded(front_m + each) for each in (0.02, 0.07)],
    }


def _rounded(value: float) -> float:
    return round(float(value), 4)


def _outline(points: FloatArray) -> list[list[float]]:
    """Footprint of points (N, 2) seen from above: a circle's polygon where they fit one well, else their rectangle."""
    (left, back), (right, front) = points.min(axis=0), points.max(axis=0)
    middle, half = np.array([(left + right) / 2.0, (back + front) / 2.0]), (right - left + front - back) / 4.0
    radius = float(np.linalg.norm(points - middle, axis=1).max())
    if radius < half * (1.0 + _ROUND) and float(np.linalg.norm(middle)) < _NEAR_M:
        out = radius / math.cos(math.pi / _CORNERS)
        turns = (np.arange(_CORNERS) + 0.5) * math.tau / _CORNERS
        return [[_rounded(out * math.cos(a)), _rounded(out * math.sin(a))] for a in turns]
    return [[_rounded(x), _rounded(y)] for x, y in ((right, front), (left, front), (left, back), (right, back))]


def write_robot_file(
    source: UrdfFile, name: str, folder: Path, stow: Callable[[Capabilities], FloatArray]
) -> tuple[Capabilities, list[str]]:
    """Writes the `robot.yaml` of a robot whose `robot.urdf` is in a folder; `source` is the file it was made from.

    `stow` finds the angles of the stowed arm. Returns the robot's capabilities and the points for a person to check.
    Raises InputError for impossible values.
    """
    inference = Inference(UrdfFile(folder / "robot.urdf"), source, name)
    _write(folder / ROBOT_FILE, inference)
    can = urdf_kind(folder / ROBOT_FILE).capabilities()
    if can.arm is not None:
        inference.data["arm"]["stowed"] = [_rounded(angle) for angle in stow(can)]
        _write(folder / ROBOT_FILE, inference)
        can = urdf_kind(folder / ROBOT_FILE).capabilities()
    return can, [f"{key}: {note}" for key, note in inference.notes.items() if key in inference.data]


def _write(path: Path, inference: Inference) -> None:
    """Writes a robot's file, with a comment before each part for a person to check."""
    lines = ["# A robot for Errand. SI units: m, rad, kg, N, s; `docs/how-to/own-robot.md` explains the keys.\n"]
    for key, value in inference.data.items():
        lines += [f"# CHECK: {inference.notes[key]}.\n"] if key in inference.notes else []
        lines.append(yaml_of({key: value}) if isinstance(value, dict) else f"{key}: {value}\n")
    path.write_text("".join(lines), encoding="utf-8")
