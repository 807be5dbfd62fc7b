"""Pictures of the plans of worlds: rooms, doors, walls, surfaces, zones and the start."""

import cv2
import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from executive.words.knowledge import Knowledge
from plant.scene_pictures import MapView, draw_map
from plant.worlds.world import World
from skills.estimate.grid_map import load_grid_map
from skills.navigate.zone_map import zone_messages
from skills.robot import FloatArray, Intrinsics, Picture, Pose2D

WIDTH_PX = 1400
_ABOVE_M = 10.0
_TINTS = ((214, 232, 246), (250, 228, 208), (220, 242, 214), (246, 216, 226), (238, 234, 200), (226, 216, 244))
_SURFACE, _INK, _START = (196, 160, 110), (25, 25, 25), (225, 60, 30)
_ARROW_M = 0.8


def draw_world(world: World, knowledge: Knowledge) -> Picture:
    """Draws the plan of a world over its surveyed map.

    Rooms are tinted and named, surfaces outlined, doors are circles of their width, and the start is an arrow.
    """
    grid = load_grid_map(world.surveyed.keepout_map_path)
    cells = grid.grey(free=255, unknown=150, occupied=0)
    rows, columns = cells.shape
    scale = WIDTH_PX / max(columns, rows)
    size = (round(columns * scale), round(rows * scale))
    grey = cv2.resize(np.ascontiguousarray(cells[::-1]), size, interpolation=cv2.INTER_AREA)
    view = _view(np.repeat(grey[..., None], 3, axis=2), grid.origin_m, scale / grid.resolution_m)
    ground = np.full_like(view.picture, 255)
    for index, polygon in enumerate(world.rooms.values()):
        cv2.fillPoly(ground, [view.whole_pixels(polygon)], _TINTS[index % len(_TINTS)])
    picture = np.asarray(np.minimum(view.picture, ground), np.uint8)
    for surface in world.surfaces.values():
        cv2.polylines(picture, [view.whole_pixels(surface.polygon_W)], True, _SURFACE, 3, cv2.LINE_AA)
    for door in knowledge.doors:
        radius = max(3, round(door.width / 2.0 * view.pixels_per_m))
        x, y = view.whole_pixels([door.at])[0]
        cv2.circle(picture, (int(x), int(y)), radius, _INK, 2, cv2.LINE_AA)
    labels = {name: (place.pose.x, place.pose.y) for name, place in knowledge.places.items()}
    start = {"start and its direction": (_arrow(world.start), _START)}
    zones = zone_messages(knowledge.known_zones())
    return draw_map(MapView(picture, view.X_WC, view.intrinsics), start, labels=labels, zones=zones)


def _view(picture: Picture, origin_m: tuple[float, float], pixels_per_m: float) -> MapView:
    """Returns the grid as the picture of a camera high above the centre of the floor."""
    height, width = picture.shape[:2]
    focal = pixels_per_m * _ABOVE_M
    down = RotationMatrix(np.diag([1.0, -1.0, -1.0]))
    middle = np.array([width, height]) / 2.0 / pixels_per_m + origin_m
    X_WC = RigidTransform(down, np.array([*middle, _ABOVE_M]))
    return MapView(picture, X_WC, Intrinsics(width, height, focal, focal, width / 2.0 - 0.5, height / 2.0 - 0.5))


def _arrow(start: Pose2D) -> FloatArray:
    ahead = np.array([np.cos(start.yaw_rad), np.sin(start.yaw_rad)])
    steps = np.array([[0.0], [_ARROW_M / 2.0], [_ARROW_M]])
    return np.asarray(np.array([start.x_m, start.y_m]) + steps * ahead)
