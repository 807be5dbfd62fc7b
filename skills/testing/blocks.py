"""A small world of upright blocks, with LiDAR scans and depth images rendered by ray casting."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from skills.compiled import compiled
from skills.grid_map import GridMap
from skills.robot import CameraCapabilities, FloatArray, FrameTree, Image, Intrinsics, Mount, Scan, unit_rays

Colour = tuple[int, int, int]
FLOOR_COLOUR: Colour = (150, 140, 130)
NOTHING_COLOUR: Colour = (20, 20, 20)


@dataclass(frozen=True)
class Block:
    """Upright block from (x0, y0) to (x1, y1) in the world frame (m), from height z0 to z1, of one colour (RGB).

    A robot can grasp a `loose` block. The constructor raises ValueError for a block without extent.
    """

    x0: float
    y0: float
    x1: float
    y1: float
    z0: float = 0.0
    z1: float = 2.5
    colour: Colour = (200, 195, 185)
    loose: bool = False

    def __post_init__(self) -> None:
        if not (self.x0 < self.x1 and self.y0 < self.y1 and self.z0 < self.z1):
            raise ValueError(f"{self}: x0 < x1, y0 < y1 and z0 < z1 must hold")

    def holds(self, point_W: FloatArray, margin_m: float = 0.0) -> bool:
        """Returns whether a point (3,) lies in the block grown by margin_m."""
        low, high = np.array([self.x0, self.y0, self.z0]), np.array([self.x1, self.y1, self.z1])
        return bool(np.all(point_W >= low - margin_m) and np.all(point_W <= high + margin_m))

    def standing_at(self, x: float, y: float, z: float) -> Block:
        """Returns the block moved so that the centre of its base is at (x, y, z)."""
        dx, dy = 0.5 * (self.x1 - self.x0), 0.5 * (self.y1 - self.y0)
        return replace(self, x0=x - dx, y0=y - dy, x1=x + dx, y1=y + dy, z0=z, z1=z + self.z1 - self.z0)


def can_at(x: float, y: float, z: float, colour: Colour = (200, 20, 25)) -> Block:
    """Makes a can, 66 mm across and 115 mm high, that stands at (x, y) on a surface at height z; red by default."""
    return Block(x - 0.033, y - 0.033, x + 0.033, y + 0.033, z, z + 0.115, colour, loose=True)


ROOM: tuple[Block, ...] = (
    Block(-2.1, -2.6, 4.1, -2.5),
    Block(-2.1, 2.5, 4.1, 2.6),
    Block(-2.1, -2.5, -2.0, 2.5),
    Block(4.0, -2.5, 4.1, 2.5),
    Block(1.2, -0.6, 1.8, 0.6, 0.70, 0.75, (130, 90, 60)),  # a table's top, and its four legs
    *(Block(x, y, x + 0.05, y + 0.05, 0.0, 0.70, (90, 60, 40)) for x in (1.2, 1.75) for y in (-0.6, 0.55)),
)
"""A room of 6 m by 5 m with a table 0.75 m high in front of the origin."""

TABLE_CAN: Block = can_at(1.38, 0.0, 0.75)
"""A red can near the edge of the room's table that faces the origin."""


def block_array(blocks: Sequence[Block]) -> FloatArray:
    """Rows x0, y0, z0, x1, y1, z1 (B, 6), one per block."""
    return np.array([(b.x0, b.y0, b.z0, b.x1, b.y1, b.z1) for b in blocks], dtype=np.float64).reshape(-1, 6)


@compiled
def cast_rays(
    origin: FloatArray, directions: FloatArray, blocks: FloatArray, limit: float
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Casts rays in directions (N, 3); returns the distance to the first hit and the index of the block that is hit.

    A ray without a hit up to `limit` gives NaN and -1, and the floor at height 0 the index -2. Distances are multiples
    of the direction's length, so that directions with z = 1 in the camera frame give depth.
    """
    low, high = blocks[:, :3] - origin, blocks[:, 3:] - origin
    inverse = 1.0 / np.where(np.abs(directions) > 1e-12, directions, 1e-12)
    ranges, hits = np.empty(len(directions)), np.empty(len(directions), dtype=np.int64)
    for n in range(len(directions)):
        best, hit = limit, -1
        x, y, z = inverse[n, 0], inverse[n, 1], inverse[n, 2]
        if z < 0.0 and -origin[2] * z < best:
            best, hit = -origin[2] * z, -2
        for b in range(len(blocks)):
            one, other = low[b, 0] * x, high[b, 0] * x
            near, far = max(0.0, min(one, other)), min(best, max(one, other))
            if near >= far:
                continue
            one, other = low[b, 1] * y, high[b, 1] * y
            near, far = max(near, min(one, other)), min(far, max(one, other))
            if near >= far:
                continue
            one, other = low[b, 2] * z, high[b, 2] * z
            near, far = max(near, min(one, other)), min(far, max(one, other))
            if 0.0 < near < far:
                best, hit = near, b
        ranges[n], hits[n] = best if hit != -1 else np.nan, hit
    return ranges, hits


@compiled
def distances_from(blocks: FloatArray, points: FloatArray) -> FloatArray:
    """Distance from each point (x, y) to the nearest block, seen from above (m); negative inside a block."""
    distances = np.empty(len(points))
    for n in range(len(points)):
        nearest, x, y = np.inf, points[n, 0], points[n, 1]
        for b in range(len(blocks)):
            dx, dy = max(blocks[b, 0] - x, x - blocks[b, 3]), max(blocks[b, 1] - y, y - blocks[b, 4])
            nearest = min(nearest, math.sqrt(dx * dx + dy * dy) if dx > 0.0 and dy > 0.0 else max(dx, dy))
        distances[n] = nearest
    return distances


def grid_of(blocks: Sequence[Block], band_m: tuple[float, float], resolution_m: float = 0.05) -> GridMap:
    """Exact grid map of the blocks that reach into a band of heights."""
    x0, y0 = min(b.x0 for b in blocks) - 0.2, min(b.y0 for b in blocks) - 0.2
    columns = math.ceil((max(b.x1 for b in blocks) + 0.2 - x0) / resolution_m)
    rows = math.ceil((max(b.y1 for b in blocks) + 0.2 - y0) / resolution_m)
    x = x0 + (np.arange(columns) + 0.5) * resolution_m
    y = y0 + (np.arange(rows) + 0.5) * resolution_m
    occupied = np.zeros((rows, columns), dtype=np.bool_)
    for b in blocks:
        if b.z0 < band_m[1] and b.z1 > band_m[0]:
            occupied |= ((y > b.y0) & (y < b.y1))[:, None] & ((x > b.x0) & (x < b.x1))[None, :]
    return GridMap(occupied, resolution_m, (x0, y0), height_band_m=band_m)


X_BL = RigidTransform(np.array([-0.2, 0.0, 0.4]))
ELEVATIONS_RAD: FloatArray = np.deg2rad(np.arange(-15.0, 16.0, 2.0))
SCAN_LIMIT_M = 100.0
SCAN_NEAREST_M = 0.5
_AHEAD = RotationMatrix(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]))
_DOWN_30 = RotationMatrix(RollPitchYaw(0.0, math.radians(30.0), 0.0)) @ _AHEAD


@dataclass(frozen=True)
class CameraMount:
    """A camera on a frame of the robot ("body", "hand" or "head"): X_FC, lens, and depth range (m)."""

    frame: str
    X_FC: RigidTransform
    lens: Intrinsics
    reach_m: float = 4.0


_BODY_LENS = Intrinsics(80, 60, 41.0, 41.0, 39.5, 29.5)
_HAND_LENS = Intrinsics(320, 240, 276.0, 276.0, 160.0, 120.0)
_AT_FRONT = RigidTransform(_DOWN_30, np.array([0.42, 0.0, 0.02]))
FRONT_CAMERAS = tuple(CameraCapabilities(name, _AT_FRONT) for name in ("frontleft", "frontright"))
"""Cameras of a body without an arm."""


def mount_of(camera: CameraCapabilities, *, fine: bool = False) -> CameraMount:
    """Mount for a robot's camera with a lens of this module: `fine` for the camera that searches for objects."""
    lens = _HAND_LENS if fine or camera.mount is not Mount.BODY else _BODY_LENS
    return CameraMount(camera.mount.value, camera.X_FC, lens)


def take_scan(
    blocks: Sequence[Block],
    X_WB: RigidTransform,
    X_OB: RigidTransform,
    stamp_s: float,
    rng: np.random.Generator,
    azimuths: int = 360,
    noise_m: float = 0.01,
) -> Scan:
    """Takes a LiDAR scan at the true pose X_WB."""
    around, rays = _lidar_rays(azimuths)
    X_WL = X_WB @ X_BL
    rays_W = np.ascontiguousarray(rays @ X_WL.rotation().matrix().T)
    ranges, _ = cast_rays(X_WL.translation(), rays_W, block_array(blocks), SCAN_LIMIT_M)
    ranges = ranges + noise_m * rng.standard_normal(ranges.shape)
    ranges[ranges < SCAN_NEAREST_M] = np.nan
    shaped = ranges.reshape(len(ELEVATIONS_RAD), -1).astype(np.float32)
    return Scan(stamp_s, shaped, ELEVATIONS_RAD, around, X_BL, X_OB)


@cache
def _lidar_rays(azimuths: int) -> tuple[FloatArray, FloatArray]:
    """Azimuths of a scan, and its rays (N, 3) in the LiDAR's frame."""
    around = np.linspace(-math.pi, math.pi, azimuths, endpoint=False)
    return around, unit_rays(ELEVATIONS_RAD, around).reshape(-1, 3)


def take_picture(
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
    """Takes a picture with a camera on the frame F at its true pose X_WF."""
    lens = mount.lens
    u, v = np.meshgrid(np.arange(lens.width), np.arange(lens.height))
    rays_C = np.stack([(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, np.ones_like(u, dtype=float)], axis=-1)
    X_WC = X_WF @ mount.X_FC
    rays_W = np.ascontiguousarray(rays_C.reshape(-1, 3) @ X_WC.rotation().matrix().T)
    depth, hits = cast_rays(X_WC.translation(), rays_W, block_array(blocks), mount.reach_m)
    palette = np.array([*(b.colour for b in blocks), FLOOR_COLOUR, NOTHING_COLOUR], dtype=np.uint8)
    colour = palette[hits].reshape(lens.height, lens.width, 3)
    grey = ((colour[..., 0].astype(np.uint16) + colour[..., 1] + colour[..., 2]) // 3).astype(np.uint8)
    edges = {**frames.edges, f"{source}_camera": (mount.frame, mount.X_FC)}
    depth_m = np.nan_to_num(depth + noise_m * rng.standard_normal(depth.shape)).reshape(grey.shape).astype(np.float32)
    return Image(stamp_s, source, f"{source}_camera", lens, lens, colour, grey, depth_m, FrameTree(edges))
