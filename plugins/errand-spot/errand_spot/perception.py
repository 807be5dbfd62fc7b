"""Perception of a robot that `errand serve` serves, scan matching and AprilTags, and GraphNav maps of worlds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Final

import numpy as np

from errand_spot.server.graph_map import GraphMap, SeenTag, map_of
from executive.app.prepare.worlds import knowledge_of
from executive.words.slug import slug
from plant.robots.spot.kind import spot_capabilities
from plant.worlds.world import World
from skills.api import FreeSpace, LocalisationEstimate, PlanningError
from skills.estimate.costmap import CostmapOptions
from skills.estimate.localiser import ScanMatchingLocaliser
from skills.footprint import Footprint
from skills.grid_map import GridMap, load_grid_map
from skills.navigate.planner import plan_path
from skills.perception.fiducials import MOST_AMBIGUITY, find_tags
from skills.robot import FloatArray, Image, Pose2D, Robot, Scan

_CELL_M, _MARGIN_M = 0.025, 1.0
_MOST_CELLS, _HALF_SIZE_M = 4_000_000, 500.0
"""Most cells of a map, and the radius about its middle within which its points count."""
_HEIGHTS_M: Final = (0.7, 1.3)
_STEP_M, _SAME_M = 0.6, 0.2
"""Distance between waypoints along a path, and distance within which an earlier one replaces a new one."""
_CLEAR_M: Final = 0.45
"""Clearance of a line between two waypoints that no path joins."""
_UNSURE: Final = np.diag([0.1**2, 0.1**2, 0.05**2])


class SpotPerception:
    """Implements `errand_spot.server.graph_map.Perception`."""

    def __init__(self, sizes_m: Mapping[int, float]) -> None:
        """Takes the sizes (m) of the known tags by number."""
        self._sizes_m = sizes_m

    def localiser(self, points_S: FloatArray) -> PointsLocaliser:
        """Creates a localiser on the points of a map that lie at the height of the LiDAR."""
        return PointsLocaliser(points_S)

    def tags(self, image: Image) -> Sequence[SeenTag]:
        """Finds the known tags whose poses are sure."""
        found = find_tags(image, self._sizes_m) if self._sizes_m else ()
        sure = (each for each in found if each.ambiguity <= MOST_AMBIGUITY)
        return [SeenTag(each.id, self._sizes_m[each.id], each.X_OT) for each in sure]


class PointsLocaliser:
    """Scan matching on points (N, 3) of a map: x, y, height above the floor."""

    def __init__(self, points_S: FloatArray) -> None:
        self._localiser = ScanMatchingLocaliser(_grid(points_S), None)

    def start(self, X_SO: Pose2D, scan: Scan, reach_m: float) -> Pose2D | None:
        """Believes the pose of `odom` at which a scan fits, within reach_m of a guess; returns None when none does."""
        belief = LocalisationEstimate(scan.stamp_s, X_SO.transform(), _UNSURE, True)
        found = self._localiser.search(scan, belief, reach_m)
        if found is None:
            return None
        self._localiser.accept(found)
        return Pose2D.from_transform(found.X_WO)

    def update(self, robot: Robot) -> tuple[Pose2D, bool]:
        """Takes in the newest scan; returns the pose of `odom`, and whether it is sure."""
        self._localiser.update(robot)
        estimate = self._localiser.estimate()
        return Pose2D.from_transform(estimate.X_WO), estimate.localised


def _grid(points_S: FloatArray) -> GridMap:
    """The cells in which points at the height of the LiDAR lie; large maps have larger cells."""
    points = points_S[(points_S[:, 2] >= _HEIGHTS_M[0]) & (points_S[:, 2] <= _HEIGHTS_M[1]), :2]
    middle = np.median(points, axis=0) if len(points) else np.zeros(2)
    points = points[np.abs(points - middle).max(axis=1, initial=0.0) < _HALF_SIZE_M]
    low, high = (edge(np.vstack([points, middle]), axis=0) for edge in (np.min, np.max))
    cell_m = max(_CELL_M, float(np.sqrt(np.prod(high - low + 2.0 * _MARGIN_M) / _MOST_CELLS)))
    origin = low - _MARGIN_M - 0.5 * cell_m
    columns, rows = np.ceil((high - origin + _MARGIN_M) / cell_m).astype(int)
    occupied = np.zeros((rows, columns), dtype=np.bool_)
    column, row = np.floor((points - origin) / cell_m).astype(int).T
    occupied[row, column] = True
    return GridMap(occupied, cell_m, (float(origin[0]), float(origin[1])), height_band_m=_HEIGHTS_M)


def world_map(world: World) -> GraphMap:
    """Returns a GraphNav map of a world: waypoints along the paths from its start to its places, with their points.

    Its seed frame is the world's frame. Raises InputError when the world's maps or knowledge cannot be read.
    """
    knowledge, capabilities = knowledge_of(world), spot_capabilities()
    keepout, grid = load_grid_map(world.keepout_map_path), load_grid_map(world.scan_map_path)
    costmap, footprint = CostmapOptions().build(keepout), Footprint.of(capabilities)
    waypoints, edges = {"start": world.start}, set[tuple[str, str]]()
    for name, place in knowledge.places.items():
        goal, here = Pose2D(place.pose.x, place.pose.y, place.pose.yaw), "start"
        try:
            poses = plan_path(costmap, footprint, world.start, goal).poses
        except PlanningError:
            continue
        far_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1))])
        steps = np.searchsorted(far_m, np.arange(_STEP_M, far_m[-1] - 0.5 * _STEP_M, _STEP_M))
        for pose in [*(Pose2D(*map(float, poses[step])) for step in steps), goal]:
            same = None if pose is goal else _same(pose, waypoints)
            there = same or (slug(name) if pose is goal else f"waypoint_{len(waypoints)}")
            waypoints.setdefault(there, pose)
            edges |= {(here, there)} - {(here, here), (there, here)}
            here = there
    edges |= {
        (a, b)
        for a, b in combinations(waypoints, 2)
        if (b, a) not in edges and _is_free(costmap, waypoints[a], waypoints[b])
    }
    band_m = grid.height_band_m or _HEIGHTS_M
    cells = grid.centres(np.argwhere(grid.occupied & (grid.distance > -1.5 * grid.resolution_m)))
    levels_m = np.linspace(*band_m, 3)
    points_W = np.column_stack([np.tile(cells, (3, 1)), np.repeat(levels_m, len(cells))])
    tags = {tag.id: tag.X_WT() for tag in knowledge.known_tags() if tag.p_W is not None}
    return map_of(waypoints, sorted(edges), points_W, tags, capabilities.standing_height_m)


def _is_free(costmap: FreeSpace, a: Pose2D, b: Pose2D) -> bool:
    """Returns whether a short straight line between two waypoints is clear of obstacles."""
    line = np.linspace((a.x_m, a.y_m), (b.x_m, b.y_m), 10)
    short = np.linalg.norm(line[-1] - line[0]) < 1.5 * _STEP_M
    return bool(short and costmap.clearance_m(line).min() > _CLEAR_M)


def _same(pose: Pose2D, waypoints: Mapping[str, Pose2D]) -> str | None:
    """An earlier waypoint that is where a pose is."""
    return next((n for n, w in waypoints.items() if math.hypot(w.x_m - pose.x_m, w.y_m - pose.y_m) < _SAME_M), None)
