"""Pictures of AprilTags by a pinhole camera: warped by their homography, with depth and noise."""

import cv2
import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from skills.robot import FrameTree, Image, Intrinsics

HAND = Intrinsics(640, 480, 552.0, 552.0, 320.0, 240.0)
_CELLS, _CELL_PX, _FINE = 8, 16, 4
"""Cells along a tag's black square, pixels of a cell, and pixels drawn for one of the picture."""


def facing(distance_m, tilt_deg, turn_deg=0.0, aside_m=(0.0, 0.0)):
    """Pose X_CT of a tag before the camera, tilted about the vertical and turned in its plane."""
    away = RotationMatrix(np.diag([1.0, -1.0, -1.0]))
    tilt = RotationMatrix.MakeYRotation(np.radians(tilt_deg))
    return RigidTransform(tilt @ away @ RotationMatrix.MakeZRotation(np.radians(turn_deg)), [*aside_m, distance_m])


def picture_of(tags, lens=HAND, *, depth=True, seed=4801, ground=150):
    """Image of tags, rows of id, size (m) and X_CT, before a grey ground at 3.5 m."""
    rng = np.random.default_rng(seed)
    grey = np.full((lens.height * _FINE, lens.width * _FINE), ground, np.uint8)
    depth_m = np.full((lens.height, lens.width), 3.5)
    for tag, size_m, X_CT in tags:
        grey, depth_m = _drawn(grey, depth_m, lens, _sheet(tag), size_m * (_CELLS + 2) / _CELLS, X_CT)
    small = cv2.resize(grey, (lens.width, lens.height), interpolation=cv2.INTER_AREA)
    noisy = np.clip(small + rng.normal(0.0, 2.5, small.shape), 0, 255).astype(np.uint8)
    depth_m += rng.normal(0.0, 1.0, depth_m.shape) * (0.0015 + 0.0012 * depth_m**2)
    frames = FrameTree({"hand_camera": ("odom", RigidTransform())})
    seen = depth_m.astype(np.float32) if depth else np.zeros((0, 0), np.float32)
    return Image(2.5, "hand", "hand_camera", lens, lens, np.repeat(noisy[..., None], 3, axis=2), noisy, seen, frames)


def _sheet(tag):
    """Picture of a tag of the family 36h11 with a white margin of one cell."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    square = cv2.aruco.generateImageMarker(family, tag, _CELLS * _CELL_PX)
    return np.pad(square, _CELL_PX, constant_values=255)


def _drawn(grey, depth_m, lens, sheet, side_m, X_CT):
    h, n = 0.5 * side_m, sheet.shape[0]
    corners = np.array([[-h, h, 0.0], [h, h, 0.0], [h, -h, 0.0], [-h, -h, 0.0]])
    p_C = (X_CT @ corners.T).T
    uv = p_C[:, :2] / p_C[:, 2:] * [lens.fx, lens.fy] + [lens.cx, lens.cy]
    fine = ((uv + 0.5) * _FINE - 0.5).astype(np.float32)
    warp = cv2.getPerspectiveTransform(np.array([[0, 0], [n, 0], [n, n], [0, n]], np.float32) - np.float32(0.5), fine)
    size = grey.shape[::-1]
    drawn = cv2.warpPerspective(sheet, warp, size, flags=cv2.INTER_AREA)
    mask = cv2.warpPerspective(np.full_like(sheet, 255), warp, size) > 127
    normal = X_CT.rotation().matrix()[:, 2]
    u, v = np.meshgrid(np.arange(lens.width), np.arange(lens.height))
    rays = np.stack([(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, np.ones_like(u)], axis=-1)
    plane = (normal @ X_CT.translation()) / (rays @ normal)
    inside = mask[_FINE // 2 :: _FINE, _FINE // 2 :: _FINE]
    return np.where(mask, drawn, grey), np.where(inside, plane, depth_m)
