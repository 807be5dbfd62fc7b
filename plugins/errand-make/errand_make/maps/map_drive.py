"""Drives in which a robot builds its own map: exploring, or along a route; with progress and pictures."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from shapely import Polygon

from errand_make.maps.map_folder import GRAPH_FILE, load_mapper, map_grids, save_graph, save_grids
from errand_make.maps.mapper import Mapper
from errand_make.maps.pose_graph import MappingExtraMissingError, PoseGraph, gtsam_module
from errand_make.maps.survey import Survey
from errand_make.maps.trajectory import trajectory_error_m
from executive.app.prepare.placed_robots import only_robot
from executive.app.report.pictures import write_picture
from executive.app.runs.simulated import simulate
from plant.worlds.world import World
from skills.geometry import compose
from skills.grid_map import GridMap
from skills.inputs.errors import InputError
from skills.inputs.outside import read_text, writing
from skills.inputs.yaml_source import read_yaml
from skills.robot import Picture, Pose2D

TICK_S: Final = 0.05
TOLD_EVERY_S: Final = 10.0
DRAWN_EVERY_S: Final = 1.5
SAVED_EVERY_S: Final = 20.0
"""Periods of lines (s, robot's clock), of pictures and of saving (s, wall time)."""
MOST_POINTS: Final = 10_000
PICTURE: Final = "map.png"
_OTHER: Final = "name another --out"


class MapDrive:
    """Drive that builds a map: plant, survey, progress lines, pictures, and true poses for the map's error."""

    def __init__(
        self,
        world: World,
        seed: int,
        mapper: Mapper,
        points: Sequence[tuple[float, float]] | None,
        out: Path,
        tell: Callable[[str], None],
    ) -> None:
        """Builds the plant; `points` are a route (m, from the start), `tell` shows a line. Raises InputError."""
        self._mapper, self._out, self._tell_line = mapper, out, tell
        self._seed, self._world = seed, world
        self._name = "Alice"
        self._simulation = simulate(world, {self._name: only_robot(self._name, world)}, seed=seed, record=False)
        self._robot = self._simulation.robots[self._name]
        route = None
        if points is not None:
            there = (compose(world.start, Pose2D(x, y, 0.0)) for x, y in points)
            route = [(pose.x_m, pose.y_m) for pose in there]
        with writing(out, _OTHER):
            out.mkdir(parents=True, exist_ok=True)
        lease = self._robot.acquire_lease("errand map")
        self._survey: Survey = Survey(self._robot, lease, mapper, home=world.start, route=route)
        self._first = len(mapper.keyframes)
        self._true: dict[float, Pose2D] = {}
        self._begun_s = time.monotonic()

    def run(self, most_s: float, cancelled: Callable[[], bool]) -> str | None:
        """Drives until the survey is done; returns why it ended early, or None."""
        clock, survey = self._simulation.clock, self._survey
        told_s, drawn_s, saved_s = 0.0, -math.inf, time.monotonic()
        try:
            while not survey.done and clock.now() < most_s and not cancelled():
                clock.advance(TICK_S)
                if (scan := self._robot.scan()) is not None:
                    self._true[round(scan.stamp_s, 4)] = self._simulation.true_pose(self._name)
                survey.tick(clock.now())
                wall_s = time.monotonic()
                if clock.now() >= told_s:
                    told_s += TOLD_EVERY_S
                    self._tell(clock.now())
                if wall_s - drawn_s > DRAWN_EVERY_S:
                    self._draw()
                    drawn_s = time.monotonic()
                if wall_s - saved_s > SAVED_EVERY_S:
                    self._save()
                    saved_s = time.monotonic()
        finally:
            survey.stop()
            if self._mapper.keyframes:
                self._save()
        for note in survey.notes:
            self._tell_line(note)
        if survey.trouble is not None or survey.done:
            return survey.trouble
        return "it was cancelled; the same command continues" if cancelled() else f"--max-time {most_s:g} s is over"

    def result(self) -> dict[str, Any]:
        """Saves the grids; returns the result as JSON values. Raises InputError."""
        mapper = self._mapper
        if not mapper.keyframes:
            raise InputError("no map was made, because no scan came", hint="check the robot's LiDAR")
        with writing(self._out, _OTHER):
            path = save_grids(self._out, map_grids(mapper))
        self._draw()
        pairs = [
            (pose, self._true[round(frame.stamp_s, 4)])
            for pose, frame in list(zip(mapper.graph.poses, mapper.keyframes, strict=True))[self._first :]
        ]
        error_m = trajectory_error_m(*zip(*pairs, strict=True)) if len(pairs) > 1 else 0.0
        return {
            "world": self._world.name,
            "seed": self._seed,
            "map": str(path),
            "distance_m": round(mapper.driven_m, 2),
            "loop_closures": len(mapper.graph.closures),
            "sim_time_s": round(self._simulation.clock.now(), 2),
            "wall_time_s": round(time.monotonic() - self._begun_s, 2),
            "trajectory_error_m": round(error_m, 4),
        }

    def _tell(self, now_s: float) -> None:
        mapper, goal = self._mapper, self._survey.goal
        purpose = "" if goal is None else f", to {goal[0]}"
        self._tell_line(
            f"{now_s:6.0f} s  {mapper.driven_m:6.1f} m  {len(mapper.keyframes)} keyframes, "
            f"{len(mapper.graph.closures)} loops{purpose}{self._left()}"
        )

    def _left(self) -> str:
        """Returns the explored share of the rooms and the wall time left at this pace; empty while both are unknown."""
        grid, explored = self._survey.known_grid()
        floor_m2 = sum(Polygon(outline).area for outline in self._world.rooms.values())
        share = min(float(explored.sum()) * grid.resolution_m**2 / floor_m2, 0.99) if floor_m2 else 0.0
        left_s = (time.monotonic() - self._begun_s) * (1.0 - share) / max(share, 0.01)
        return f"; {share:.0%} of the rooms seen, about {max(1, round(left_s / 60.0))} min left" if share > 0.05 else ""

    def _draw(self) -> None:
        if not self._mapper.keyframes:
            return
        goal = self._survey.goal
        picture = map_picture(
            self._survey.known_grid()[0], self._mapper.graph, self._mapper.pose, None if goal is None else goal[1]
        )
        partial = self._out / f".{PICTURE}"
        write_picture(partial, picture)
        with writing(self._out, _OTHER):
            partial.replace(self._out / PICTURE)

    def _save(self) -> None:
        """Saves the pose graph, so that the next run can continue it."""
        with writing(self._out, _OTHER):
            save_graph(self._out, self._mapper)


def mapper_for(world: World, out: Path) -> Mapper:
    """Returns a new mapper, or the one saved in a folder. Raises InputError."""
    try:
        gtsam_module()
    except MappingExtraMissingError as error:
        raise InputError(str(error), hint="pip install 'errand-make[mapping]'") from error
    if not (out / GRAPH_FILE).exists():
        return Mapper(world.start)
    return load_mapper(out)


def route_points(path: Path) -> list[tuple[float, float]]:
    """Reads the points of a route: a YAML list of pairs, or a pair in each line. Raises InputError."""
    text = read_text(path)
    try:
        data = read_yaml(path).data
    except InputError:
        data = None
    try:
        lines = (line.split("#")[0].replace(",", " ").split() for line in text.splitlines())
        points = [(float(x), float(y)) for x, y in (row for row in (data if isinstance(data, list) else lines) if row)]
        if not 0 < len(points) <= MOST_POINTS or not all(math.isfinite(x + y) for x, y in points):
            raise ValueError
    except (ValueError, TypeError, OverflowError) as error:
        hint = f"write x and y in metres from the start, one point in a line, at most {MOST_POINTS}"
        raise InputError("it is not a route", hint=hint, file=path) from error
    return points


_WIDEST: Final = 1400
_GREY: Final = {"free": 250, "unknown": 190, "occupied": 40}
_TRAJECTORY: Final = (70, 120, 220)
_LOOP: Final = (230, 150, 30)
_ROBOT: Final = (30, 140, 60)
_GOAL: Final = (225, 60, 30)


def map_picture(ground: GridMap, graph: PoseGraph, pose: Pose2D, goal: Pose2D | None) -> Picture:
    """Draws the map so far with graph, robot and goal (north up, RGB), at most _WIDEST pixels wide or high."""
    grey = ground.grey(**_GREY)
    seen = np.argwhere(grey != _GREY["unknown"])
    low, high = seen.min(axis=0), seen.max(axis=0) + 1
    scale = max(1, min(4, _WIDEST // int(max(high - low))))
    cut = grey[low[0] : high[0], low[1] : high[1]][::-1]
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
