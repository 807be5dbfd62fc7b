"""Analytic scenes: a table top with upright cylinders, ray-cast into colour and depth."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from skills.api import Detection, Surface
from skills.manipulation.arm.poses import camera_pose
from skills.robot import FrameTree, Image, Intrinsics

LENS = Intrinsics(320, 240, 276.0, 276.0, 160.0, 120.0)
TABLE = Surface("table", ((0.8, -0.6), (1.4, -0.6), (1.4, 0.6), (0.8, 0.6)), 0.75)
CAMERA = np.array([0.35, 0.05, 1.25])
RED, BLUE, GREY, PINK = (190, 15, 20), (25, 60, 190), (150, 148, 140), (240, 120, 200)
GREEN = (40, 150, 60)


@dataclass(frozen=True)
class Can:
    """An upright cylinder on the table, or on another level (base, m)."""

    x: float
    y: float
    radius: float
    height: float
    colour: tuple[int, int, int]
    base: float = TABLE.height_m


U, V = np.meshgrid((np.arange(LENS.width) - LENS.cx) / LENS.fx, (np.arange(LENS.height) - LENS.cy) / LENS.fy)
RAYS_C = np.stack([U.ravel(), V.ravel(), np.ones(U.size)])
NOISE = np.random.default_rng(7).standard_normal(U.shape)


def _level(z, eye, height_m):
    """Depth along the optical axis to a level plane; z is that of the rays, which have unit length along it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (height_m - eye[2]) / z
    return np.where(depth > 0, depth, np.inf)


def _can_depth(x, y, z, eye, can):
    """Depth to the side or the lid of an upright can."""
    base, top = can.base, can.base + can.height
    dx, dy = eye[0] - can.x, eye[1] - can.y
    a, b = x * x + y * y, x * dx + y * dy
    root = b * b - a * (dx * dx + dy * dy - can.radius**2)
    meets = root >= 0
    x, y, z, a, b = x[meets], y[meets], z[meets], a[meets], b[meets]
    side = (-b - np.sqrt(root[meets])) / a
    at = eye[2] + side * z
    lid = np.minimum(_level(z, eye, top), 99.0)
    on_lid = np.hypot(dx + lid * x, dy + lid * y) <= can.radius
    depth = np.full(meets.shape, np.inf)
    depth[meets] = np.minimum(
        np.where((at >= base) & (at <= top) & (side > 0), side, np.inf), np.where(on_lid, lid, np.inf)
    )
    return depth


def taken(X_WC, things, noise_m=0.0015):
    """Colour and depth of the table with things on it, seen from X_WC, depth noise included."""
    colour, depth = _taken(X_WC.GetAsMatrix34().tobytes(), tuple(things), noise_m)
    return colour.copy(), depth.copy()


@lru_cache(maxsize=32)
def _taken(pose, things, noise_m):
    pose = np.frombuffer(pose).reshape(3, 4)
    (x, y, z), eye = (pose[:, :3] @ RAYS_C).reshape(3, *U.shape), pose[:, 3]
    colour = np.full((LENS.height, LENS.width, 3), GREY, dtype=np.uint8)
    table = np.minimum(_level(z, eye, TABLE.height_m), 99.0)
    at_x, at_y = eye[0] + table * x, eye[1] + table * y
    on_table = (at_x > 0.8) & (at_x < 1.4) & (np.abs(at_y) < 0.6)
    depth = np.where(on_table, table, np.minimum(_level(z, eye, 0.0), 3.9))
    for thing in things:
        nearer = _can_depth(x, y, z, eye, thing)
        colour[nearer < depth] = thing.colour
        depth = np.minimum(depth, nearer)
    return colour, (depth + noise_m * NOISE).astype(np.float32)


def scene(things, noise_m=0.0015, X_WC=None):
    """An Image of the table with things on it, seen from CAMERA unless said."""
    X_WC = X_WC or camera_pose(CAMERA, np.array([1.05, 0.0, TABLE.height_m]))
    colour, depth = taken(X_WC, things, noise_m)
    frames = FrameTree({"hand_camera": ("odom", X_WC)})
    return Image(1.5, "hand", "hand_camera", LENS, LENS, colour, colour.mean(axis=-1).astype(np.uint8), depth, frames)


COKE = Can(0.95, -0.1, 0.033, 0.115, RED)


def box_of(image, colour):
    """The box (u0, v0, u1, v1) about all pixels of a colour."""
    rows, columns = np.nonzero(np.all(image.colour == colour, axis=-1))
    return (float(columns.min()), float(rows.min()), float(columns.max() + 1), float(rows.max() + 1))


def seen_as(name, image, colour=RED, score=0.9):
    """The detection of the thing of a colour."""
    return Detection(name, score, box_of(image, colour))
