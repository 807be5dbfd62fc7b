"""A scripted robot with its camera on its head: Fetch's arm, gripper and head before a table with things on it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from scripted_robot import ScriptedRobot
from table_scene import LENS, taken

from plant.robots.fetch.description import HEAD_CAMERA
from plant.robots.fetch.kind import fetch_capabilities
from skills.manipulation.arm.kinematics import arm_model
from skills.robot import CommandState, CommandStatus, FrameTree, Image, Joints

HEAD_CAPABILITIES = fetch_capabilities()
HEAD_MODEL = arm_model(HEAD_CAPABILITIES)
assert HEAD_CAPABILITIES.head is not None
assert HEAD_CAPABILITIES.object_camera is not None
HEAD, CAMERA = HEAD_CAPABILITIES.head, HEAD_CAPABILITIES.object_camera


@dataclass
class HeadRobot(ScriptedRobot):
    """`things` are in its pictures as long as nothing is held; `head_refuses` scripts a head that does not turn."""

    height_m: float = HEAD_CAPABILITIES.standing_height_m
    q: Any = field(default_factory=lambda: HEAD_MODEL.stowed_rad.copy())
    head_rad: tuple[float, float] = (0.0, 0.0)
    head_refuses: bool = False
    looked_at: list[tuple[float, float]] = field(default_factory=list)
    stood_m: list[float] = field(default_factory=list)

    def capabilities(self):
        return HEAD_CAPABILITIES

    def joints(self):
        return Joints(self.now_s, dict(zip(HEAD_MODEL.names, self.q.tolist(), strict=True)), {}, {})

    def image(self, source, *, visual=True, depth=True):
        frames = FrameTree(
            {
                "body": ("odom", RigidTransform([0.0, 0.0, self.height_m])),
                "head": ("body", HEAD.X_BF(*self.head_rad)),
                "head_camera": ("head", CAMERA.X_FC),
            }
        )
        colour, depth_m = taken(frames.pose("head_camera"), () if self.holding else self.things or ())
        grey = colour.mean(axis=-1).astype(np.uint8)
        return Image(self.now_s, HEAD_CAMERA, "head_camera", LENS, LENS, colour, grey, depth_m, frames)

    def stand(self, height_m, pitch_rad, *, until_s, lease):
        self.stood_m.append(height_m)
        return super().stand(height_m, pitch_rad, until_s=until_s, lease=lease)

    def point_head(self, pan_rad, tilt_rad, *, until_s, lease):
        if self.head_refuses:
            return self._note(CommandStatus(CommandState.REFUSED, "the head is stuck"))
        self.head_rad = (pan_rad, tilt_rad)
        self.looked_at.append(self.head_rad)
        return self._note(CommandStatus(CommandState.RUNNING))
