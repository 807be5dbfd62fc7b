"""Description of a robot by its URDF and its `robot.yaml`: its capabilities, sensors and links."""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from plant.robots.urdf_robot.robot_file import DIGITS, CameraFile, RobotFile, read_robot_file
from skills.robot import (
    ArmCapabilities,
    CameraCapabilities,
    Capabilities,
    GripperCapabilities,
    HeadCapabilities,
    Mount,
)

if TYPE_CHECKING:
    from pydrake.math import RigidTransform

    from plant.robots.urdf_robot.assembly import Assembly
    from plant.sensors.camera_spec import CameraSpec

_MOST_OF_OPENING = 0.9
"""Widest object that is grasped, as a part of the opening."""
_BEYOND_TIP_M = 0.04
"""Length beyond the fingertips by which a grasped object ends."""
_STRAIGHT = 1e-3
_CORNERS = 12
"""Corners of the polygon that stands for a round footprint."""


class Description:
    """A robot's file and URDF, read when first used, and the data derived from them."""

    def __init__(self, path: Path) -> None:
        """`path` is the robot's `robot.yaml`."""
        self.path = path

    @cached_property
    def file(self) -> RobotFile:
        """The robot's file. Raises InputError with file and line."""
        return read_robot_file(self.path)

    @cached_property
    def assembly(self) -> Assembly:
        """The robot's URDF with its frames. Raises InputError with file and line."""
        from plant.robots.urdf_robot.assembly import Assembly

        return Assembly(self.file)

    @cached_property
    def gripper_links(self) -> tuple[str, ...]:
        """Links of hand and fingers; empty without an arm."""
        assembly, gripper = self.assembly, self.file.gripper
        if assembly.hand_link is None:
            return ()
        fingers = (assembly.urdf.joints[name].child for name in (gripper.joints if gripper is not None else ()))
        return (assembly.hand_link, *map(assembly.carrier, fingers))

    @cached_property
    def wheel_links(self) -> tuple[str, ...]:
        """Links of wheels and casters that touch the floor; empty on a floating base."""
        assembly, wheels = self.assembly, self.file.base.wheels
        if wheels is None:
            return ()
        driven = (assembly.urdf.joints[name].child for name in wheels.joints)
        return tuple(map(assembly.carrier, (*driven, *wheels.casters)))

    @cached_property
    def trunk_links(self) -> tuple[str, ...]:
        """Links of body and head, and the link below a lift."""
        return tuple(dict.fromkeys((self.assembly.root, "body", *self.head_links)))

    @cached_property
    def head_links(self) -> tuple[str, ...]:
        """Links of pan and tilt; empty without a head."""
        return tuple(self.assembly.carrier(self.assembly.urdf.joints[name].child) for name in self.file.head or ())

    @cached_property
    def capabilities(self) -> Capabilities:
        """Capabilities of the robot. Raises InputError when a part is not usable by any skill."""
        base, lift, assembly = self.file.base, self.file.lift, self.assembly
        down_m, up_m = (0.0, 0.0)
        if lift is not None:
            down_m, up_m = assembly.urdf.joints[lift.joint].lower, assembly.urdf.joints[lift.joint].upper
        return Capabilities(
            footprint_m=base.footprint if isinstance(base.footprint, tuple) else _round(base.footprint),
            max_speed_m_s=base.max_speed,
            max_turn_rate_rad_s=base.max_turn_rate,
            standing_height_m=base.height + (0.0 if lift is None else lift.travelling),
            height_range_m=(base.height + down_m, base.height + up_m),
            pitch_range_rad=(0.0, 0.0),
            arm=self._arm(),
            gripper=self._gripper(),
            cameras=tuple(self._camera(name) for name in self.file.cameras),
            description=assembly.planned_text(),
            base_kind=base.motion,
            lift_joint=None if lift is None else lift.joint,
            lidar_height_m=assembly.base_height_m + float(self.X_BaseL().translation()[2]),
            head=self._head(),
        )

    def _arm(self) -> ArmCapabilities | None:
        arm = self.file.arm
        if arm is None:
            return None
        return ArmCapabilities(
            arm.joints,
            arm.max_reach,
            arm.stowed,
            arm.max_payload,
            standing_m=arm.standing,
            nearer_m=arm.nearer,
            carry_x_m=arm.carry_x,
            carry_z_m=arm.carry_z,
            carry_best_x_m=arm.carry_x[0] if arm.carry_best_x is None else arm.carry_best_x,
            tuck_x_m=arm.tuck_x,
        )

    def _gripper(self) -> GripperCapabilities | None:
        gripper = self.file.gripper
        if gripper is None:
            return None
        return GripperCapabilities(
            finger_joints=tuple(gripper.joints.items()),
            widest=gripper.widest,
            max_opening_m=gripper.max_opening,
            max_force_n=gripper.max_force,
            depth_m=gripper.depth or gripper.tip_x - gripper.palm_x,
            palm_x_m=gripper.palm_x,
            tip_x_m=gripper.tip_x,
            fixed_tip_x_m=gripper.tip_x,
            fixed_z_m=gripper.closing_z,
            half_breadth_m=gripper.half_breadth,
            tip_thickness_m=gripper.tip_thickness,
            grip_x_m=round((gripper.palm_x + gripper.tip_x) / 2.0, DIGITS),
            max_grasp_m=round(_MOST_OF_OPENING * gripper.max_opening, DIGITS),
            length_m=gripper.length or gripper.tip_x + _BEYOND_TIP_M,
            kind=gripper.kind,
        )

    def X_BaseL(self) -> RigidTransform:
        """Pose of the LiDAR in the link that stands on the floor. Raises InputError when a driven joint moves it."""
        link = self.file.lidar.link
        if self.assembly.carrier(link) != self.assembly.root:
            hint = "name a link that is fixed to the base"
            raise self.assembly.error(("lidar", "link"), "a driven joint moves the LiDAR", hint)
        return self.assembly.X_CL(link)

    def cameras(self) -> dict[str, CameraSpec]:
        """Specifications of the cameras by name."""
        return {name: self._spec(name, camera) for name, camera in self.file.cameras.items()}

    def _spec(self, name: str, camera: CameraFile) -> CameraSpec:
        from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

        from plant.sensors.camera_spec import CameraSpec

        ahead = RotationMatrix(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]))
        X_LC = RigidTransform() if camera.axes == "optical" else RigidTransform(ahead, np.zeros(3))
        X = self.assembly.X_CL(camera.link) @ X_LC
        focal = camera.width / 2.0 / float(np.tan(camera.field_of_view / 2.0))
        roll, pitch, yaw = np.degrees(RollPitchYaw(X.rotation()).vector()).tolist()
        x, y, z = X.translation().tolist()
        return CameraSpec(
            name=name,
            link=self.assembly.carrier(camera.link),
            colour=True,
            rpy_deg=(roll, pitch, yaw),
            xyz_m=(x, y, z),
            width=camera.width,
            height=camera.height,
            fx=focal,
            fy=focal,
            cx=(camera.width - 1) / 2.0,
            cy=(camera.height - 1) / 2.0,
            depth_shrink=2 if camera.width >= 640 else 1,
            depth_range_m=camera.depth,
        )

    def _camera(self, name: str) -> CameraCapabilities:
        spec = self._spec(name, self.file.cameras[name])
        mounts = {"body": Mount.BODY, self.assembly.hand_link: Mount.HAND} | dict.fromkeys(
            self.head_links[1:], Mount.HEAD
        )
        if spec.link not in mounts:
            hint = "name a link of the base, of the head behind its tilt, or of the hand"
            raise self.assembly.error(("cameras", name, "link"), f"link {spec.link} carries no camera", hint)
        return CameraCapabilities(name, spec.X_link_camera(), mounts[spec.link])

    def _head(self) -> HeadCapabilities | None:
        if self.file.head is None:
            return None
        assembly = self.assembly
        pan, tilt = (assembly.urdf.joints[name] for name in self.file.head)
        axes = [(assembly.X_BL[each.parent] @ each.X_PF).rotation() @ each.axis for each in (pan, tilt)]
        if not np.allclose(axes, [[0, 0, 1], [0, 1, 0]], atol=_STRAIGHT):
            what = "its joints do not turn about z up and y to the left"
            raise assembly.error(("head",), what, "leave the head out, and fix its joints by `held`")
        p_BP = (assembly.X_BL[pan.parent] @ pan.X_PF).translation()
        p_BT = (assembly.X_BL[tilt.parent] @ tilt.X_PF).translation()
        return HeadCapabilities(
            (pan.name, tilt.name),
            tuple(p_BP.round(DIGITS).tolist()),
            tuple((p_BT - p_BP).round(DIGITS).tolist()),
            (pan.lower, pan.upper),
            (tilt.lower, tilt.upper),
        )


def _round(radius_m: float) -> tuple[tuple[float, float], ...]:
    """Polygon that circumscribes a circle, counter-clockwise."""
    out_m = radius_m / math.cos(math.pi / _CORNERS)
    angles = [(k + 0.5) * math.tau / _CORNERS for k in range(_CORNERS)]
    return tuple((out_m * math.cos(a), out_m * math.sin(a)) for a in angles)
