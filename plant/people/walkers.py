"""People who walk: before each step of the plant, each person is moved along a planned route.

The body of a walking person slides on a planar joint. Its pose and velocity are prescribed; it touches robots and loose
objects, and passes through the scenery. Shortest paths on a grid of the world's collision shapes lead around that. The
pose of a standing person is set only if something has pushed the person.
"""

from __future__ import annotations

import bisect
import contextlib
import copy
import itertools
import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import SceneGraphInspector
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, SpatialInertia
from pydrake.systems.framework import Context

from plant.diagram import WorldDiagram
from plant.events import slide
from plant.saved_state import Stateful
from plant.sensors.ray_shapes import ShapeKind, shape_row
from plant.worlds.seeding import PointRoute
from plant.worlds.world import Point, WorldError
from skills.robot import FloatArray

BAND_M = (0.05, 1.8)
"""Shapes between these heights are obstacles for a person."""
SHOULDERS_M = 0.30
"""Clearance of a person's centre from obstacles on the path."""
LEAST_M = 0.20
"""Clearance of a person's centre from obstacles at a waypoint."""
_CELL_M = 0.05
_NEAR_WAYPOINT_M = 0.5
_ROUND_SIDES = 16
_STEPS = ((0, 1, 1.0), (1, 0, 1.0), (1, 1, math.sqrt(2.0)), (1, -1, math.sqrt(2.0)))


class Ground:
    """Walkable ground of a world: a grid with the clearance of each cell."""

    def __init__(self, outlines_W: Sequence[FloatArray], points_W: Iterable[Point]) -> None:
        """`outlines_W` are the convex outlines (K, 2) of obstacles; the grid covers these and `points_W`."""
        corners = np.concatenate([*outlines_W, np.array([*points_W], dtype=np.float64).reshape(-1, 2)])
        self._low = corners.min(axis=0) - 1.0
        columns, rows = np.ceil((corners.max(axis=0) + 1.0 - self._low) / _CELL_M).astype(int)
        self._free = np.full((rows, columns), 255, np.uint8)
        self._block(outlines_W)

    @staticmethod
    def from_plant(plant: MultibodyPlant, inspector: SceneGraphInspector, points_W: Iterable[Point]) -> Ground:
        """Builds the ground of a finalized plant, with the shapes that are fixed to the world as obstacles."""
        return Ground([*_outlines_W(plant, inspector)], points_W)

    def with_obstacles(self, outlines_W: Iterable[FloatArray]) -> Ground:
        """Returns the same ground with more obstacles."""
        other = copy.copy(self)
        other._free = self._free.copy()
        other._block(outlines_W)
        return other

    def _block(self, outlines_W: Iterable[FloatArray]) -> None:
        for outline in outlines_W:
            cells = np.round(((outline - self._low) / _CELL_M - 0.5) * 16).astype(np.int32)
            cv2.fillConvexPoly(self._free, cells, 0, shift=4)
        self._clearance_m = cv2.distanceTransform(self._free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * _CELL_M

    def plan_path(self, start_W: Point, goal_W: Point, *, who: str) -> tuple[Point, ...]:
        """Plans the corners of a short path, start and goal included. Raises WorldError when `who` finds none."""
        for point in (start_W, goal_W):
            if self._clear_m(np.array([point]))[0] < LEAST_M:
                raise WorldError(f"{who} cannot stand at {_text(point)}: something is there; choose a free point")
        if self._straight(start_W, goal_W, (start_W, goal_W)):
            return (start_W, goal_W)
        cells = self._cells_between(start_W, goal_W)
        if cells is None:
            raise WorldError(f"{who} finds no path from {_text(start_W)} to {_text(goal_W)}; choose other waypoints")
        return self._shortened((start_W, *cells, goal_W))

    def _cells_between(self, start_W: Point, goal_W: Point) -> list[Point] | None:
        """Centres of the cells of a shortest path; None when there is none."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import dijkstra

        rows, columns = self._clearance_m.shape
        free = self._free_for((start_W, goal_W))
        index = np.arange(rows * columns).reshape(rows, columns)
        a, b, lengths = [], [], []
        for down, right, length in _STEPS:
            here = (slice(0, rows - down), slice(max(0, -right), columns - max(0, right)))
            there = (slice(down, rows), slice(max(0, right), columns - max(0, -right)))
            both = free[here] & free[there]
            a.append(index[here][both])
            b.append(index[there][both])
            lengths.append(np.full(np.count_nonzero(both), length))
        graph = coo_array(
            (np.concatenate(lengths), (np.concatenate(a), np.concatenate(b))), shape=(index.size, index.size)
        ).tocsr()
        begin, end = (int(index[tuple(self._cell(point))]) for point in (start_W, goal_W))
        _, before = dijkstra(graph, directed=False, indices=begin, return_predecessors=True)
        cells = [end]
        while cells[-1] != begin:
            if before[cells[-1]] < 0:
                return None
            cells.append(int(before[cells[-1]]))
        row, column = np.divmod(np.array(cells[::-1]), columns)
        return [(float(x), float(y)) for x, y in (np.column_stack([column, row]) + 0.5) * _CELL_M + self._low]

    def _free_for(self, ends_W: Sequence[Point]) -> NDArray[np.bool_]:
        """Mask of the cells where a person can be on a path between these ends."""
        free: NDArray[np.bool_] = self._clearance_m >= SHOULDERS_M
        rows, columns = np.indices(free.shape)
        for end in ends_W:
            row, column = self._cell(end)
            near = np.hypot(rows - row, columns - column) * _CELL_M < _NEAR_WAYPOINT_M
            free |= near & (self._clearance_m >= LEAST_M)
        return free

    def _shortened(self, path: Sequence[Point]) -> tuple[Point, ...]:
        """The path without the corners that can be cut."""
        ends, corners, here = (path[0], path[-1]), [path[0]], 0
        while here < len(path) - 1:
            after = len(path) - 1
            while after > here + 1 and not self._straight(path[here], path[after], ends):
                after = here + max(1, (after - here) // 2)
            while after < len(path) - 1 and self._straight(path[here], path[after + 1], ends):
                after += 1
            corners.append(path[after])
            here = after
        return tuple(corners)

    def _straight(self, a: Point, b: Point, ends_W: Sequence[Point]) -> bool:
        """Returns whether a person can go straight from a to b; near the ends less clearance is enough."""
        points = np.linspace(a, b, max(2, math.ceil(math.dist(a, b) / (0.5 * _CELL_M))))
        near = np.any([np.hypot(*(points - end).T) < _NEAR_WAYPOINT_M for end in ends_W], axis=0)
        return bool(np.all(self._clear_m(points) >= np.where(near, LEAST_M, SHOULDERS_M) - 0.5 * _CELL_M))

    def _clear_m(self, points_W: FloatArray) -> FloatArray:
        cells = self._cell(points_W)
        return np.asarray(self._clearance_m[cells[..., 0], cells[..., 1]])

    def _cell(self, points_W: Point | FloatArray) -> NDArray[np.int64]:
        """Row and column of a point, or of each point of an array."""
        cells: NDArray[np.int64] = np.floor((np.asarray(points_W) - self._low) / _CELL_M).astype(np.int64)
        return cells[..., ::-1]


def _outlines_W(plant: MultibodyPlant, inspector: SceneGraphInspector) -> Iterable[FloatArray]:
    """Outlines (K, 2) from above of the shapes that are fixed to the world and reach into the band."""
    context = plant.CreateDefaultContext()
    for body in (plant.get_body(BodyIndex(index)) for index in range(plant.num_bodies())):
        if not plant.IsAnchored(body):
            continue
        X_WB = plant.EvalBodyPoseInWorld(context, body)
        for geometry in plant.GetCollisionGeometriesForBody(body):
            kind, half_m, X_BG = shape_row(inspector, geometry)
            corners_W = (X_WB @ X_BG).multiply((_unit_corners(kind) * half_m).T).T
            if corners_W[:, 2].max() > BAND_M[0] and corners_W[:, 2].min() < BAND_M[1]:
                yield cv2.convexHull(corners_W[:, :2].astype(np.float32)).reshape(-1, 2).astype(np.float64)


def _unit_corners(kind: ShapeKind) -> FloatArray:
    """Corner points (N, 3) around a shape with half extents of 1."""
    turn = np.arange(_ROUND_SIDES) * math.tau / _ROUND_SIDES
    ring = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], dtype=np.float64)
    if kind is not ShapeKind.BOX:
        ring = np.column_stack([np.cos(turn), np.sin(turn)])
    return np.vstack([np.column_stack([ring, np.full(len(ring), z)]) for z in (-1.0, 1.0)])


def _text(point: Point) -> str:
    return f"({point[0]:g}, {point[1]:g})"


TURN_RAD_S = 4.0


@dataclass(frozen=True)
class Leg:
    """Path between two stops as corners (x, y), at least one, and the pause (s) at its end."""

    corners_W: tuple[Point, ...]
    pause_s: float

    def lengths_m(self) -> tuple[float, ...]:
        """Lengths (m) of the path from its first corner to each corner."""
        lengths = [0.0]
        for a, b in itertools.pairwise(self.corners_W):
            lengths.append(lengths[-1] + math.dist(a, b))
        return tuple(lengths)


class Walk(Stateful, saved=("_leg", "_done_m", "_wait_s", "_detour", "place_W", "yaw_rad", "heading_rad", "held_s")):
    """A person on the legs of a route, who faces along the path. Call `advance` once a step.

    `held_s` is the time for which the person has waited for a robot.
    """

    def __init__(
        self, legs: Sequence[Leg], *, at_W: Point, yaw_rad: float, speed_m_s: float, start_s: float, loops: bool
    ) -> None:
        """The person stands at `at_W` until `start_s`; the last leg of a looped route ends where the first begins."""
        self._legs, self._lengths_m = tuple(legs), [leg.lengths_m() for leg in legs]
        self._speed_m_s, self._loops = speed_m_s, loops
        self._leg, self._done_m, self._wait_s = 0, 0.0, start_s
        self._detour: tuple[Leg, tuple[float, ...]] | None = None
        self.held_s = 0.0
        self.place_W, self.yaw_rad, self.heading_rad = at_W, yaw_rad, yaw_rad

    @property
    def done(self) -> bool:
        """Returns whether the person has reached the end of the route."""
        return self._leg >= len(self._legs)

    @property
    def walks(self) -> bool:
        """Returns whether the person is on a leg, and not in a pause."""
        return not self.done and self._wait_s <= 0.0

    def set_off(self) -> None:
        """Ends the pause."""
        self._wait_s = 0.0

    def take_detour(self, corners_W: tuple[Point, ...]) -> None:
        """Replaces the rest of the leg by another path to the next stop."""
        leg = Leg(corners_W, self._legs[self._leg].pause_s)
        self._detour, self._done_m = (leg, leg.lengths_m()), 0.0

    @property
    def next_stop_W(self) -> Point:
        """End of the present leg. Raises IndexError when the route is done."""
        return self._legs[self._leg].corners_W[-1]

    @property
    def on_detour(self) -> bool:
        """Returns whether the person walks on a detour."""
        return self._detour is not None

    def advance(self, dt_s: float) -> None:
        """Walks or waits for dt_s."""
        if self.done:
            return
        if self._wait_s > 0.0:
            self._wait_s -= dt_s
            return
        leg, lengths_m = self._detour or (self._legs[self._leg], self._lengths_m[self._leg])
        corners = leg.corners_W
        self._done_m = min(self._done_m + self._speed_m_s * dt_s, lengths_m[-1])
        after = min(bisect.bisect_right(lengths_m, self._done_m), len(corners) - 1)
        if after > 0:
            self._stand_between(corners[after - 1], corners[after], self._done_m - lengths_m[after - 1], dt_s)
        if self._done_m >= lengths_m[-1]:
            self._wait_s, self._done_m, self._leg, self._detour = leg.pause_s, 0.0, self._leg + 1, None
            if self._loops and self.done:
                self._leg = 0

    def _stand_between(self, a: Point, b: Point, from_a_m: float, dt_s: float) -> None:
        """Sets the position at a distance from corner a towards corner b, and turns towards b."""
        length_m = math.dist(a, b)
        share = from_a_m / length_m if length_m > 0.0 else 1.0
        self.place_W = (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]))
        if length_m > 0.0:
            self.heading_rad = math.atan2(b[1] - a[1], b[0] - a[0])
            off_rad = math.remainder(self.heading_rad - self.yaw_rad, math.tau)
            self.yaw_rad += max(-TURN_RAD_S * dt_s, min(TURN_RAD_S * dt_s, off_rad))


BODY_KG, BODY_M = 75.0, (0.2, 1.75)
"""Mass of a person, and radius and height of the cylinder with the same inertia."""
YIELD_M = 0.8
"""A person who yields stops when a robot's outline ahead is nearer than this to the person's centre."""
AHEAD_RAD = 1.2
"""Angle to either side of the heading that counts as ahead."""
PATIENCE_S = 4.0
"""A person who has yielded this long looks for a detour around the robots, and again after the same time."""
PASS_M = 0.22
"""On a detour, a person stops only for an outline nearer than this."""


class Walkers(Stateful, saved=("_walks",)):
    """The people of one plant who walk, by name; call `before_step` before each step."""

    def __init__(self, world: WorldDiagram, context: Context) -> None:
        """`context` is the plant's. Raises WorldError when a waypoint is in an obstacle, or no path leads there."""
        routes = {model.name: model.route for model in world.config.models if model.route is not None}
        self._plant, self._context, self._routes = world.plant, context, routes
        self._robots = tuple(world.robots.values())
        self._instances = {name: world.models[name] for name in routes}
        inertia = SpatialInertia.SolidCylinderWithMass(BODY_KG, *BODY_M, np.array([0.0, 0.0, 1.0]))
        for instance in self._instances.values():
            (body,) = (world.plant.get_body(index) for index in world.plant.GetBodyIndices(instance))
            body.SetSpatialInertiaInBodyFrame(context, inertia)
        self._walks: dict[str, Walk] = {}
        self._ground: Ground | None = None
        if routes:
            points = (stop.at_W for route in routes.values() for stop in route.stops)
            self._ground = ground = Ground.from_plant(world.plant, world.scene_graph.model_inspector(), points)
            self._walks = {name: _walk(name, route, ground) for name, route in routes.items()}

    def __getitem__(self, name: str) -> Walk:
        """Returns the walk of a person. Raises KeyError."""
        return self._walks[name]

    @property
    def still(self) -> bool:
        """Returns whether nobody of the plant walks."""
        return not self._walks

    def places_W(self) -> Iterator[Point]:
        """Positions (x, y) of all people who walk."""
        yield from (walk.place_W for walk in self._walks.values())

    def before_step(self, dt_s: float, standing: Collection[str] = ()) -> None:
        """Sets the pose of each person, and the velocity that leads to the next pose within dt_s.

        The people in `standing` stay where they are.
        """
        for name, walk in self._walks.items():
            before = (*walk.place_W, walk.yaw_rad)
            if name in standing:
                pass
            elif walk.walks and self._held(name, walk):
                self._wait(name, walk, dt_s)
            else:
                walk.held_s = 0.0
                walk.advance(dt_s)
            after = (*walk.place_W, walk.yaw_rad)
            velocity = (np.array(after) - before) / dt_s
            slide(self._plant, self._context, self._instances[name], np.array(before), velocity)

    def _wait(self, name: str, walk: Walk, dt_s: float) -> None:
        """Waits for a robot; after a while, looks for a detour."""
        walk.held_s += dt_s
        if walk.held_s < PATIENCE_S or self._ground is None:
            return
        walk.held_s = 0.0
        with contextlib.suppress(WorldError):
            ground = self._ground.with_obstacles(self._outlines_W(walk))
            walk.take_detour(ground.plan_path(walk.place_W, walk.next_stop_W, who=name))

    def _held(self, name: str, walk: Walk) -> bool:
        """Returns whether a person must wait for a robot."""
        if not self._routes[name].yields:
            return False
        return any(self._close_ahead(walk, outline_W) for outline_W in self._outlines_W(walk))

    def _outlines_W(self, walk: Walk) -> Iterator[FloatArray]:
        """Outlines (K, 2) of the robots that are near a person."""
        for robot in self._robots:
            p_WB = self._plant.EvalBodyPoseInWorld(self._context, robot.body).translation()
            reach_m = float(np.linalg.norm(robot.kind.capabilities().footprint_m, axis=1).max())
            if math.dist(p_WB[:2], walk.place_W) < YIELD_M + reach_m:
                yield robot.outline_W(self._context)

    def _close_ahead(self, walk: Walk, outline_W: FloatArray) -> bool:
        """Returns whether an outline is close to the person and ahead."""
        offset = _nearest_on(outline_W, np.array(walk.place_W)) - walk.place_W
        if float(np.hypot(*offset)) > (PASS_M if walk.on_detour else YIELD_M):
            return False
        bearing_rad = math.remainder(math.atan2(offset[1], offset[0]) - walk.heading_rad, math.tau)
        return abs(bearing_rad) < AHEAD_RAD


def _walk(name: str, route: PointRoute, ground: Ground) -> Walk:
    """Plans the legs of a route. Raises WorldError when no path leads to a stop."""
    stops = [*route.stops, *(route.stops[:1] if route.loops else ())]
    legs = [Leg(ground.plan_path(a.at_W, b.at_W, who=name), b.pause_s) for a, b in itertools.pairwise(stops)]
    first = route.stops[0]
    return Walk(
        legs,
        at_W=first.at_W,
        yaw_rad=route.first_yaw_rad,
        speed_m_s=route.speed_m_s,
        start_s=route.start_s + first.pause_s,
        loops=route.loops and len(route.stops) > 1,
    )


def _nearest_on(polygon: FloatArray, point: FloatArray) -> FloatArray:
    """Nearest point (2,) to a point on the edges of a polygon (K, 2)."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    shares = np.clip(np.sum((point - polygon) * edges, axis=1) / np.sum(edges**2, axis=1), 0.0, 1.0)
    places = polygon + shares[:, None] * edges
    return np.asarray(places[int(np.argmin(np.linalg.norm(places - point, axis=1)))])
