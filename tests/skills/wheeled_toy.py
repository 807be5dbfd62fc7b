"""A toy robot that is no Spot: wheels, other names of links and cameras, a shorter arm on a turntable, a small claw."""

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from skills.robot import ArmCapabilities, CameraCapabilities, Capabilities, GripperCapabilities, Mount

BODY = ((0.42, 0.24), (-0.42, 0.24), (-0.42, -0.24), (0.42, -0.24))
HEIGHT_M = 0.45
_AHEAD = RotationMatrix(RollPitchYaw(-np.pi / 2, 0.0, -np.pi / 2))
_DOWN = RotationMatrix(RollPitchYaw(0.0, 0.5, 0.0)) @ _AHEAD
# name, place in the parent, axis, limits, then the box of its link: middle and size
_CHAIN = (
    ("turntable", "0.24 0 0.20", "0 0 1", (-3.1, 3.1), "0 0 -0.03", "0.12 0.12 0.06"),
    ("upper", "0 0 0", "0 1 0", (-3.1, 0.6), "0.16 0 0", "0.28 0.06 0.06"),
    ("lower", "0.36 0 0", "0 1 0", (0.0, 3.1), "0.05 0 0.03", "0.14 0.07 0.10"),
    ("roll", "0.40 0 0.06", "1 0 0", (-2.9, 2.9), "-0.14 0 0", "0.20 0.06 0.06"),
    ("tilt", "0 0 0", "0 1 0", (-1.9, 1.9), "0 0 0", "0.07 0.08 0.07"),
    ("flange", "0 0 0", "1 0 0", (-2.9, 2.9), "0.08 0 -0.01", "0.07 0.08 0.08"),
    ("claw", "0.11 0 0.012", "0 1 0", (-1.2, 0.0), "0.055 0 0.012", "0.09 0.03 0.012"),
)
STOWED_RAD = (0.0, -3.05, 3.0, 0.0, 0.0, 0.0)


def _box(middle, size):
    return f'<collision><origin xyz="{middle}"/><geometry><box size="{size}"/></geometry></collision>'


def _urdf():
    links = [f'<link name="body">{_box("0 0 0", "0.84 0.48 0.20")}</link>']
    for parent, (name, place, axis, (low, high), middle, size) in zip(
        ("body", *(part[0] for part in _CHAIN)), _CHAIN, strict=False
    ):
        finger = _box("0.17 0 -0.046", "0.09 0.04 0.012") if name == "flange" else ""
        links.append(
            f'<link name="{name}">{_box(middle, size)}{finger}</link><joint name="{name}" type="revolute">'
            f'<parent link="{parent}"/><child link="{name}"/><origin xyz="{place}"/><axis xyz="{axis}"/>'
            f'<limit lower="{low}" upper="{high}" effort="30" velocity="3"/></joint>'
        )
    return f'<robot name="toy">{"".join(links)}</robot>'


TOY = Capabilities(
    footprint_m=BODY,
    max_speed_m_s=1.0,
    max_turn_rate_rad_s=1.5,
    standing_height_m=HEIGHT_M,
    height_range_m=(HEIGHT_M, HEIGHT_M),
    pitch_range_rad=(0.0, 0.0),
    arm=ArmCapabilities(tuple(part[0] for part in _CHAIN[:-1]), 0.95, STOWED_RAD, max_payload_kg=1.0),
    gripper=GripperCapabilities(
        finger_joints=(("claw", -1.0),),
        widest=1.2,
        max_opening_m=0.14,
        max_force_n=90.0,
        depth_m=0.08,
        palm_x_m=0.125,
        tip_x_m=0.215,
        fixed_tip_x_m=0.215,
        fixed_z_m=-0.040,
        half_breadth_m=0.020,
        tip_thickness_m=0.012,
        grip_x_m=0.165,
        max_grasp_m=0.10,
        length_m=0.30,
    ),
    cameras=(
        CameraCapabilities("wrist_eye", RigidTransform(_AHEAD, np.array([0.12, 0.0, 0.05])), mount=Mount.HAND),
        CameraCapabilities("bow", RigidTransform(_DOWN, [0.4, 0.0, 0.1])),
        CameraCapabilities("stern", RigidTransform(RotationMatrix.MakeZRotation(np.pi) @ _AHEAD, [-0.4, 0.0, 0.1])),
    ),
    description=_urdf(),
)
