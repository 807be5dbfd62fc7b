"""Analytic scenes: a table top with upright cylinders, ray-cast into colour and depth."""

from dataclasses import dataclass

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


def _rays(X_WC):
    u, v = np.meshgrid(np.arange(LENS.width), np.arange(LENS.height))
    rays_C = np.stack([(u - LENS.cx) / LENS.fx, (v - LENS.cy) / LENS.fy, np.ones_like(u, dtype=float)], axis=-1)
    return rays_C @ X_WC.rotation().matrix().T


def _level(rays, eye, height_m):
    """Depth along the optical axis to a level plane; rays have unit length along it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (height_m - eye[2]) / rays[..., 2]
    return np.where(depth > 0, depth, np.inf)


def _can_depth(rays, eye, can):
    """Depth to the side or the lid of an upright can."""
    base, top = can.base, can.base + can.height
    p = eye[:2] - [can.x, can.y]
    a = np.sum(rays[..., :2] ** 2, axis=-1)
    b = rays[..., 0] * p[0] + rays[..., 1] * p[1]
    root = b**2 - a * (p @ p - can.radius**2)
    side = np.where(root >= 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
    z = eye[2] + side * rays[..., 2]
    side = np.where((z >= base) & (z <= top) & (side > 0), side, np.inf)
    lid = _level(rays, eye, top)
    at = eye[:2] + np.where(np.isfinite(lid), lid, 0.0)[..., None] * rays[..., :2]
    lid = np.where(np.linalg.norm(at - [can.x, can.y], axis=-1) <= can.radius, lid, np.inf)
    return np.minimum(side, lid)


def taken(X_WC, things, noise_m=0.0015):
    """Colour and depth of the table with things on it, seen from X_WC, depth noise included."""
    rays, eye = _rays(X_WC), X_WC.translation()
    colour = np.full((LENS.height, LENS.width, 3), GREY, dtype=np.uint8)
    table = _level(rays, eye, TABLE.height_m)
    at = eye[:2] + np.where(np.isfinite(table), table, 0.0)[..., None] * rays[..., :2]
    on_table = (at[..., 0] > 0.8) & (at[..., 0] < 1.4) & (np.abs(at[..., 1]) < 0.6)
    depth = np.where(on_table, table, np.minimum(_level(rays, eye, 0.0), 3.9))
    for thing in things:
        nearer = _can_depth(rays, eye, thing)
        colour[nearer < depth] = thing.colour
        depth = np.minimum(depth, nearer)
    depth = depth + np.random.default_rng(7).normal(0.0, noise_m, depth.shape)
    return colour, depth.astype(np.float32)


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
