"""A world drawn from above as a plan: free ground, walls, rooms, doors, surfaces and the start."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from plant.scene_pictures import INK, MapView, draw_map
from plant.worlds.world import Point, World
from skills.robot import FloatArray, Intrinsics, Picture, Pose2D

WIDTH_PX = 1400
_ABOVE_M = 10.0
_TINTS = ((214, 232, 246), (250, 228, 208), (220, 242, 214), (246, 216, 226), (238, 234, 200), (226, 216, 244))
_SURFACE = (196, 160, 110)
_ARROW_M = 0.8

Door = tuple[Point, float]
"""Its middle and its width (m)."""


def draw_world(
    world: World,
    cells: Picture,
    origin_m: tuple[float, float],
    resolution_m: float,
    *,
    labels: Mapping[str, Point],
    doors: Iterable[Door],
) -> Picture:
    """The plan over a grid's grey values (rows from the south).

    Rooms are tinted and surfaces outlined, doors are circles as wide as they, the start is an arrow. `labels` are
    written at their points.
    """
    rows, columns = cells.shape
    scale = WIDTH_PX / max(columns, rows)
    size = (round(columns * scale), round(rows * scale))
    grey = cv2.resize(np.ascontiguousarray(cells[::-1]), size, interpolation=cv2.INTER_AREA)
    view = _view(np.repeat(grey[..., None], 3, axis=2), origin_m, scale / resolution_m)
    ground = np.full_like(view.picture, 255)
    for index, polygon in enumerate(world.rooms.values()):
        cv2.fillPoly(ground, [_pixels(view, polygon)], _TINTS[index % len(_TINTS)])
    picture = np.asarray(np.minimum(view.picture, ground), np.uint8)
    for surface in world.surfaces.values():
        cv2.polylines(picture, [_pixels(view, surface.polygon_W)], True, _SURFACE, 3, cv2.LINE_AA)
    for at, width in doors:
        radius = max(3, round(width / 2.0 * view.pixels_per_m))
        x, y = _pixels(view, [at])[0]
        cv2.circle(picture, (int(x), int(y)), radius, INK, 2, cv2.LINE_AA)
    return draw_map(MapView(picture, view.X_WC, view.intrinsics), _arrow(world.start), labels=labels)


def _view(picture: Picture, origin_m: tuple[float, float], pixels_per_m: float) -> MapView:
    """A camera high above the floor's middle that saw the grid as it is."""
    height, width = picture.shape[:2]
    focal = pixels_per_m * _ABOVE_M
    down = RotationMatrix(np.diag([1.0, -1.0, -1.0]))
    middle = np.array([width, height]) / 2.0 / pixels_per_m + origin_m
    X_WC = RigidTransform(down, np.array([*middle, _ABOVE_M]))
    return MapView(picture, X_WC, Intrinsics(width, height, focal, focal, width / 2.0 - 0.5, height / 2.0 - 0.5))


def _pixels(view: MapView, points: Sequence[Point]) -> NDArray[np.int32]:
    return np.asarray(np.round(view.pixels(np.array(points))), dtype=np.int32)


def _arrow(start: Pose2D) -> FloatArray:
    ahead = np.array([np.cos(start.yaw_rad), np.sin(start.yaw_rad)])
    steps = np.array([[0.0], [_ARROW_M / 2.0], [_ARROW_M]])
    return np.asarray(np.array([start.x_m, start.y_m]) + steps * ahead)
