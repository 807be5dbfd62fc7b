"""What the scripted robot sees of its blocks: LiDAR scans and pictures with depth, by casting rays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from skills.robot import CameraCapabilities, FloatArray, FrameTree, Image, Intrinsics, Mount, Scan, unit_rays
from skills.testing.blocks import Block, block_array, cast_rays, colours_of

X_BL = RigidTransform(np.array([-0.2, 0.0, 0.4]))
ELEVATIONS_RAD: FloatArray = np.deg2rad(np.arange(-15.0, 16.0, 2.0))
SCAN_LIMIT_M = 100.0
SCAN_NEAREST_M = 0.5
_AHEAD = RotationMatrix(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]))
_DOWN_30 = RotationMatrix(RollPitchYaw(0.0, math.radians(30.0), 0.0)) @ _AHEAD


@dataclass(frozen=True)
class CameraMount:
    """A camera on a frame of the robot ("body", "hand" or "head"): X_FC, lens, how far depth reaches (m)."""

    frame: str
    X_FC: RigidTransform
    lens: Intrinsics
    reach_m: float = 4.0


_BODY_LENS = Intrinsics(80, 60, 41.0, 41.0, 39.5, 29.5)
_HAND_LENS = Intrinsics(320, 240, 276.0, 276.0, 160.0, 120.0)
_AT_FRONT = RigidTransform(_DOWN_30, np.array([0.42, 0.0, 0.02]))
FRONT_CAMERAS = tuple(CameraCapabilities(name, _AT_FRONT) for name in ("frontleft", "frontright"))
"""The cameras of a body without an arm."""


def mount_of(camera: CameraCapabilities) -> CameraMount:
    """Where a robot's camera sits, with a lens of this module's."""
    lens = _BODY_LENS if camera.mount is Mount.BODY else _HAND_LENS
    return CameraMount(camera.mount.value, camera.X_FC, lens)


def sweep(
    blocks: Sequence[Block],
    X_WB: RigidTransform,
    X_OB: RigidTransform,
    stamp_s: float,
    rng: np.random.Generator,
    *,
    azimuths: int = 360,
    noise_m: float = 0.01,
) -> Scan:
    """A LiDAR revolution at the true pose X_WB."""
    around = np.linspace(-math.pi, math.pi, azimuths, endpoint=False)
    X_WL = X_WB @ X_BL
    rays = unit_rays(ELEVATIONS_RAD, around).reshape(-1, 3)
    rays_W = np.ascontiguousarray(rays @ X_WL.rotation().matrix().T)
    ranges, _ = cast_rays(X_WL.translation(), rays_W, block_array(blocks), SCAN_LIMIT_M)
    ranges = ranges + noise_m * rng.standard_normal(ranges.shape)
    ranges[ranges < SCAN_NEAREST_M] = np.nan
    shaped = ranges.reshape(len(ELEVATIONS_RAD), -1).astype(np.float32)
    return Scan(stamp_s, shaped, ELEVATIONS_RAD, around, X_BL, X_OB)


def picture(
    blocks: Sequence[Block],
    X_WF: RigidTransform,
    mount: CameraMount,
    frames: FrameTree,
    source: str,
    stamp_s: float,
    rng: np.random.Generator,
    *,
    noise_m: float = 0.001,
) -> Image:
    """A picture from a camera on the frame F, which is truly at X_WF."""
    lens = mount.lens
    u, v = np.meshgrid(np.arange(lens.width), np.arange(lens.height))
    rays_C = np.stack([(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, np.ones_like(u, dtype=float)], axis=-1)
    X_WC = X_WF @ mount.X_FC
    rays_W = np.ascontiguousarray(rays_C.reshape(-1, 3) @ X_WC.rotation().matrix().T)
    depth, hits = cast_rays(X_WC.translation(), rays_W, block_array(blocks), mount.reach_m)
    depth = np.nan_to_num(depth + noise_m * rng.standard_normal(depth.shape), nan=0.0)
    colour = colours_of(blocks, hits).reshape(lens.height, lens.width, 3)
    grey = np.ascontiguousarray(colour.mean(axis=2).astype(np.uint8))
    edges = {**frames.edges, f"{source}_camera": (mount.frame, mount.X_FC)}
    depth_m = depth.reshape(grey.shape).astype(np.float32)
    return Image(stamp_s, source, f"{source}_camera", lens, lens, colour, grey, depth_m, FrameTree(edges))
