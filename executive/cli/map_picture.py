"""A picture of a map in the making: ground, the robot's trajectory, loops, the robot and its goal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import cv2
import numpy as np

from skills.robot import Picture, Pose2D

if TYPE_CHECKING:
    from skills.estimate.grid_map import GridMap
    from skills.mapping.pose_graph import PoseGraph

__all__ = ["map_picture"]

_WIDEST: Final = 1400
_GREY: Final = {"free": 250, "unknown": 190, "occupied": 40}
_TRAJECTORY, _LOOP, _ROBOT, _GOAL = (70, 120, 220), (230, 150, 30), (30, 140, 60), (225, 60, 30)


def map_picture(ground: GridMap, graph: PoseGraph, pose: Pose2D, goal: Pose2D | None) -> Picture:
    """Draw the ground as known so far (north up, RGB), at most _WIDEST pixels wide or high."""
    unknown = np.zeros_like(ground.occupied) if ground.unknown is None else ground.unknown
    grey = np.where(ground.occupied, _GREY["occupied"], np.where(unknown, _GREY["unknown"], _GREY["free"]))
    seen = np.argwhere(~unknown)
    low, high = seen.min(axis=0), seen.max(axis=0) + 1
    scale = max(1, min(4, _WIDEST // int(max(high - low))))
    cut = grey[low[0] : high[0], low[1] : high[1]][::-1].astype(np.uint8)
    picture = cv2.cvtColor(np.kron(cut, np.ones((scale, scale), dtype=np.uint8)), cv2.COLOR_GRAY2RGB)

    def pixel(x_m: float, y_m: float) -> tuple[int, int]:
        column = (x_m - ground.origin_m[0]) / ground.resolution_m - low[1]
        row = high[0] - (y_m - ground.origin_m[1]) / ground.resolution_m
        return round(column * scale), round(row * scale)

    poses = [pixel(each.x_m, each.y_m) for each in graph.poses]
    for edge in graph.closures:
        cv2.line(picture, poses[edge.first], poses[edge.second], _LOOP, 1, cv2.LINE_AA)
    cv2.polylines(picture, [np.array(poses, dtype=np.int32)], False, _TRAJECTORY, 2, cv2.LINE_AA)
    if goal is not None:
        cv2.drawMarker(picture, pixel(goal.x_m, goal.y_m), _GOAL, cv2.MARKER_CROSS, 14, 2)
    here = pixel(pose.x_m, pose.y_m)
    ahead = pixel(pose.x_m + 0.6 * np.cos(pose.yaw_rad), pose.y_m + 0.6 * np.sin(pose.yaw_rad))
    cv2.arrowedLine(picture, here, ahead, _ROBOT, 3, cv2.LINE_AA, tipLength=0.4)
    cv2.circle(picture, here, 5, _ROBOT, -1, cv2.LINE_AA)
    return np.asarray(picture, dtype=np.uint8)
