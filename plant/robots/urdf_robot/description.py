"""Description of a robot by its URDF and its `robot.yaml`: its capabilities, sensors and links."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from plant.robots.urdf_robot.robot_file import CameraFile, RobotFile, read_robot_file
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


class Description:
    """A robot's file and URDF, read when they are first used, and what follows from them."""

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
        """Links of hand and fingers, none without an arm."""
        assembly, gripper = self.assembly, self.file.gripper
        if assembly.hand_link is None:
            return ()
        fingers = (assembly.urdf.joints[name].child for name in (gripper.joints if gripper is not None else ()))
        return (assembly.hand_link, *map(assembly.carrier, fingers))

    @cached_property
    def head_links(self) -> tuple[str, ...]:
        """Links of pan and tilt, none without a head."""
        return tuple(self.assembly.carrier(self.assembly.urdf.joints[name].child) for name in self.file.head or ())

    @cached_property
    def capabilities(self) -> Capabilities:
        """Capabilities of the robot. Raises InputError for parts that no skill can use."""
        base, assembly = self.file.base, self.assembly
        arm, gripper = self.file.arm, self.file.gripper
        return Capabilities(
            footprint_m=base.footprint,
            max_speed_m_s=base.max_speed,
            max_turn_rate_rad_s=base.max_turn_rate,
            standing_height_m=base.height,
            height_range_m=(base.height, base.height),
            pitch_range_rad=(0.0, 0.0),
            arm=None
            if arm is None
            else ArmCapabilities(
                arm.joints,
                arm.max_reach,
                arm.stowed,
                arm.max_payload,
                standing_m=arm.standing,
                nearer_m=arm.nearer,
                carry_x_m=arm.carry_x,
                carry_z_m=arm.carry_z,
                carry_best_x_m=arm.carry_x[0],
                tuck_x_m=arm.tuck_x,
            ),
            gripper=None
            if gripper is None
            else GripperCapabilities(
                finger_joints=tuple(gripper.joints.items()),
                widest=gripper.widest,
                max_opening_m=gripper.max_opening,
                max_force_n=gripper.max_force,
                depth_m=gripper.tip_x - gripper.palm_x,
                palm_x_m=gripper.palm_x,
                tip_x_m=gripper.tip_x,
                fixed_tip_x_m=gripper.tip_x,
                fixed_z_m=gripper.closing_z,
                half_breadth_m=gripper.half_breadth,
                tip_thickness_m=gripper.tip_thickness,
                grip_x_m=(gripper.palm_x + gripper.tip_x) / 2.0,
                max_grasp_m=_MOST_OF_OPENING * gripper.max_opening,
                length_m=gripper.tip_x + _BEYOND_TIP_M,
                kind=gripper.kind,
            ),
            cameras=tuple(self._camera(name) for name in self.file.cameras),
            description=assembly.text(meshes=False),
            base_kind=base.motion,
            lidar_height_m=base.height + float(self.X_BL().translation()[2]),
            head=self._head(),
        )

    def X_BL(self) -> RigidTransform:
        """Pose of the LiDAR in the body frame. Raises InputError when a driven joint moves it."""
        link = self.file.lidar.link
        if self.assembly.carrier(link) != "body":
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
            tuple(p_BP.tolist()),
            tuple((p_BT - p_BP).tolist()),
            (pan.lower, pan.upper),
            (tilt.lower, tilt.upper),
        )
