"""Models of upright cans, as `errand object import` would describe them, from meshes and from photographs."""

from itertools import product

import cv2
import numpy as np
from table_scene import GREY, TABLE, Can, taken

from skills.manipulation.arm.poses import camera_pose
from skills.perception.object_model import ObjectModel, view_of


def can_model(name, radius, height, colour, points=2000):
    """A can with its origin in the middle, evenly sampled, that stands."""
    rng = np.random.default_rng(3)
    turn, share = rng.uniform(0, 2 * np.pi, points), rng.uniform(-0.5, 0.5, points)
    side = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(points)])
    lid = rng.random(points) < radius / (radius + height)
    up = np.where(share > 0, 1.0, -1.0)[:, None] * [0.0, 0.0, 1.0]
    within = radius * np.sqrt(rng.random(points))[:, None]
    on_lid, on_side = within * side + 0.5 * height * up, radius * side + height * share[:, None] * [0.0, 0.0, 1.0]
    return ObjectModel(
        name,
        np.where(lid[:, None], on_lid, on_side),
        np.where(lid[:, None], up, side),
        np.tile(np.array(colour, np.uint8), (points, 1)),
        np.eye(3)[None],
    )


def photographed_can(name, radius, height, colour):
    """A can that is known by six photographs from some heights, and by its size."""
    can, views = Can(1.0, 0.0, radius, height, colour), []
    middle = np.array([1.0, 0.0, TABLE.height_m + 0.5 * height])
    for rise in np.radians([10, 20, 30, 40, 50, 60]):
        eye = middle - 0.45 * np.array([np.cos(rise), 0.0, -np.sin(rise)])
        photograph, _ = taken(camera_pose(eye, middle), [can])
        mask = np.uint8(255) * (photograph != GREY).any(axis=-1)
        left, top, width, height_px = cv2.boundingRect(mask)
        views.append(view_of(np.dstack([photograph, mask])[top : top + height_px, left : left + width]))
    return viewed_model(name, (2.0 * radius, 2.0 * radius, height), views)


def viewed_model(name, size_m, views):
    """A box of a size that is known by views."""
    steps = np.linspace(-1.0, 1.0, 13)
    box = np.array([p for p in product(steps, steps, steps) if max(map(abs, p)) == 1.0])
    normals = box / np.linalg.norm(box, axis=1)[:, None]
    grey = np.full(box.shape, 128, np.uint8)
    return ObjectModel(name, 0.5 * box * size_m, normals, grey, np.eye(3)[None], np.array(views))
