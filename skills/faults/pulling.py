"""What the joints of an arm feel when somebody pulls at what the hand holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skills.manipulation.arm.kinematics import arm_model
from skills.manipulation.arm.pull import levers_m
from skills.robot import Capabilities, Joints

PULL_N = 15.0


def pulled(joints: Joints, capabilities: Capabilities, force_n: float = PULL_N) -> Joints:
    """The same readings with the efforts that hold against a force straight ahead."""
    model, gripper = arm_model(capabilities), capabilities.gripper
    p_HT = np.array([0.0 if gripper is None else gripper.grip_x_m, 0.0, 0.0])
    q_rad = np.array([joints.position_rad[name] for name in model.names])
    extra_nm = -force_n * levers_m(model, q_rad, p_HT)[0]
    added = dict(zip(model.names, extra_nm.tolist(), strict=True))
    return replace(joints, effort_nm={name: nm + added.get(name, 0.0) for name, nm in joints.effort_nm.items()})
