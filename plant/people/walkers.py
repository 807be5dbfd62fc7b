"""People who walk: before each step of the plant, each person is moved along a planned path.

The body of a walking person slides on a planar joint. Its pose and velocity are prescribed; it touches robots and loose
objects, and passes through the scenery. Shortest paths on a grid of the world's collision shapes avoid the scenery, and
closed doors stop people. The pose of a standing person is set only after a push.

A person's behaviour depends only on the seed, the robots and the doors.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Callable, Collection, Iterator, Sequence
from functools import cache

import cv2
import numpy as np
import shapely
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import Context

from executive.words.mission import ANY_ROBOT
from plant.diagram import WorldDiagram
from plant.events import slide
from plant.people.ground import Ground
from plant.people.walk import Leg, Walk
from plant.saved_state import Stateful
from plant.worlds.seeding import PointRoute
from plant.worlds.world import Point, WorldError
from skills.relations import nearest_point
from skills.robot import FloatArray

BODY_KG = 75.0
BODY_M = (0.2, 1.75)
"""Radius and height of the cylinder with a person's inertia."""
YIELD_M = 0.8
"""A person who yields stops when a robot's outline ahead is nearer than this to the person's centre."""
AHEAD_RAD = 1.2
"""Angle to either side of the heading that counts as ahead."""
PATIENCE_S = 4.0
"""A person who has waited this long looks for another path, and again after the same time."""
PASS_M = 0.26
"""On a detour, a person stops only for an outline nearer than this."""
APART_M = 0.8
"""Length of the path ahead over which people keep apart."""
PASS_APART_M = 0.42
"""People who keep apart stop where that path comes nearer than this to the centre of a person."""
STEPS_M = 0.15
MEET_M = 1.6
"""People nearer than this meet, and the first by name makes way for the other."""
FREE_PATH_M = 3.0
"""Length of the other's path that the person who makes way leaves free."""
DETOUR_M = 3.0
"""People walk so much farther at most to go round others."""
GIVES_WAY_S = 0.5
ASIDE_S = 3.0
"""Time for which a person stands aside where nobody can pass."""
LETS_PASS_S, LETS_PASS_M = 20.0, (1.2, 0.9, 0.6)
"""Time for which a person stands aside who was asked to, and distances from the robot's line, the best first."""
ASIDE_M = 0.6
"""Distance of a person who stands aside from the paths of others."""
DOOR_M = 0.6
"""People stop for a closed door that crosses their path within this length."""
HEARS_M = 3.0
"""People hear a robot within this distance, and a robot hears them."""
BEHIND_M = 1.5
"""Length of the path to the robot at which a person behind it stops."""
SETS_OFF_M = 1.9
"""Distance from the robot from which on that person follows."""
NEAR_M = 2.0
"""Distance of a robot that ends its follower's lapse of attention."""
PLAN_S = 0.7
"""Time between two paths of a person who follows a robot."""
WANDERS_M = 2.0
WANDERER_CLEAR_M = 0.45
PAUSES_S = (0.5, 4.0)
_DRAWS = 20
_HALF_BODY_M = 0.12

Barriers = Sequence[tuple[Point, Point]]
"""Ends (x, y) of each doorway whose door is not open."""


class Walkers(Stateful, saved=("_walks", "_leaders", "_plans_s", "_spoke", "_now_s")):
    """The people in one plant who walk, by name; call `before_step` before each step."""

    def __init__(
        self, world: WorldDiagram, context: Context, say: Callable[[str, str], None] = lambda name, words: None
    ) -> None:
        """`context` is the plant's; `say` is called with a person's name and words.

        Raises WorldError when a waypoint is in an obstacle, or no path leads there.
        """
        routes = {model.name: model.route for model in world.config.models if model.route is not None}
        self._plant, self._context, self._routes, self._say = world.plant, context, routes, say
        self._robots = world.robots
        self._instances = {name: world.models[name] for name in routes}
        inertia = SpatialInertia.SolidCylinderWithMass(BODY_KG, *BODY_M, np.array([0.0, 0.0, 1.0]))
        for instance in self._instances.values():
            (body,) = (world.plant.get_body(index) for index in world.plant.GetBodyIndices(instance))
            body.SetSpatialInertiaInBodyFrame(context, inertia)
        self._walks: dict[str, Walk] = {}
        self._leaders: dict[str, str] = {}
        self._plans_s: dict[str, float] = {}
        self._spoke: tuple[str, ...] = ()
        self._now_s = 0.0
        self._ground: Ground | None = None
        self._barriers: Barriers = ()
        self._busy = any(each.follows or each.wanders or each.says for each in routes.values())
        if routes:
            points = (stop.at_W for route in routes.values() for stop in route.stops)
            self._ground = ground = Ground.from_plant(world.plant, world.scene_graph.model_inspector(), points)
            self._walks = {name: _walk(name, route, ground) for name, route in routes.items()}

    def __getitem__(self, name: str) -> Walk:
        """Returns the walk of a person. Raises KeyError when nobody has this name."""
        return self._walks[name]

    @property
    def still(self) -> bool:
        """Returns whether no person in the plant walks."""
        return not self._walks

    def places_W(self) -> Iterator[Point]:
        """Positions (x, y) of all people who walk."""
        yield from (walk.place_W for walk in self._walks.values())

    def hear(self, robot: str) -> None:
        """Passes a robot's speech to the people near it; those who follow robots follow this one from now on."""
        for name, route in self._routes.items():
            if route.follows in (robot, ANY_ROBOT) and self._away_m(robot, self._walks[name]) <= HEARS_M:
                self._leaders[name], self._walks[name].lapsed = robot, False

    def let_pass(self, robot: str, name: str | None) -> None:
        """Lets a robot pass that has asked a person to: they step off the line ahead of it, or stay, by the seed."""
        if name not in self._walks:
            return
        walk, route = self._walks[name], self._routes[name]
        rng = np.random.default_rng([*route.stream, round(1000.0 * self._now_s)])
        if rng.random() < route.steps_aside:
            body = self._robots[robot].body
            robot_W = self._plant.EvalBodyPoseInWorld(self._context, body).translation()[:2]
            off_W = np.array(walk.place_W) - robot_W
            beyond_W = robot_W + (1.0 + FREE_PATH_M / float(np.linalg.norm(off_W))) * off_W
            ground = self._blocked_ground([*self._outlines_W(walk)])
            line_W = (walk.place_W, tuple(robot_W), tuple(beyond_W))
            places_W = (ground.aside(walk.place_W, [line_W], clear_m) for clear_m in LETS_PASS_M)
            if (place_W := next(filter(None, places_W), None)) is not None:
                with contextlib.suppress(WorldError):
                    walk.step_aside(ground.plan_on(walk.place_W, place_W, who=name), LETS_PASS_S)

    def before_step(self, dt_s: float, standing: Collection[str] = (), barriers: Barriers = ()) -> None:
        """Sets each person's pose, and the velocity to the next pose within dt_s.

        The people in `standing` stay where they are; nobody passes the `barriers`.
        """
        self._barriers = barriers
        self._now_s += dt_s
        for name, walk in self._walks.items():
            before = (*walk.place_W, walk.yaw_rad)
            if name not in standing:
                self._move(name, walk, dt_s)
            after = (*walk.place_W, walk.yaw_rad)
            velocity = (np.array(after) - before) / dt_s
            slide(self._plant, self._context, self._instances[name], np.array(before), velocity)

    def _move(self, name: str, walk: Walk, dt_s: float) -> None:
        """Moves a person for dt_s, if nothing is in the way."""
        if self._busy and not self._decide(name, walk):
            walk.held_s = 0.0
        elif walk.walks and self._held(name, walk):
            self._wait(name, walk, dt_s)
        else:
            walk.held_s = 0.0
            walk.advance(dt_s)

    def _decide(self, name: str, walk: Walk) -> bool:
        """Chooses the next path of a person without one; returns whether the person may walk on."""
        route = self._routes[name]
        if route.follows is not None and (walk.done or name in self._leaders):
            return self._follow(name, walk)
        if walk.done and route.says is not None and name not in self._spoke:
            self._speak(name, walk, route.says)
        if walk.done and route.wanders and self._plans_now(name):
            near = [*self._around(name, walk)]
            ground = self._blocked_ground(near)
            rng = np.random.default_rng([*route.stream, round(self._now_s / PLAN_S)])
            goals_W = ground.free_points(walk.place_W, WANDERS_M, WANDERER_CLEAR_M, rng, _DRAWS)
            pause_s, passing = float(rng.uniform(*PAUSES_S)), bool(near)
            any(self._set_off(walk, ground, goal_W, pause_s=pause_s, passing=passing) for goal_W in goals_W)
        return True

    def _plans_now(self, name: str) -> bool:
        """Returns whether a person's next path is due; if so, resets the timer."""
        if self._plans_s.get(name, 0.0) > self._now_s:
            return False
        self._plans_s[name] = self._now_s + PLAN_S
        return True

    def _speak(self, name: str, walk: Walk, words: str) -> None:
        """Says something once, when a robot is near."""
        if any(self._away_m(robot, walk) <= HEARS_M for robot in self._robots):
            self._spoke += (name,)
            self._say(name, words)

    def _set_off(
        self,
        walk: Walk,
        ground: Ground,
        goal_W: Point,
        *,
        pause_s: float = 0.0,
        short_m: float = 0.0,
        passing: bool = False,
    ) -> bool:
        """Gives a person a path that ends short of a goal; returns whether a path exists."""
        with contextlib.suppress(WorldError):
            path = Leg(ground.plan_on(walk.place_W, goal_W, who="somebody"), pause_s)
            length_m = path.lengths_m()[-1]
            if length_m > short_m:
                walk.take_path(path.part(0.0, length_m - short_m), pause_s, passing=passing)
                return True
        return False

    def _follow(self, name: str, walk: Walk) -> bool:
        """Keeps a person behind the leading robot; returns whether the person may walk on."""
        leader = self._leaders.get(name)
        if leader is None:
            return False
        if walk.lapsed and self._away_m(leader, walk) < NEAR_M and not walk.pauses and not walk.goes_back:
            walk.lapsed = False
        if walk.lapsed or walk.pauses:
            return walk.pauses or walk.goes_back
        if walk.on_detour or not self._plans_now(name):
            return True
        x, y, _ = self._plant.EvalBodyPoseInWorld(self._context, self._robots[leader].body).translation()
        ground, robot_W = self._blocked_ground(()), (float(x), float(y))
        close = walk.done and math.dist(robot_W, walk.place_W) < SETS_OFF_M and ground.sees(walk.place_W, robot_W)
        if not close and not self._set_off(walk, ground, robot_W, short_m=BEHIND_M):
            walk.drop_path()
        return True

    def _wait(self, name: str, walk: Walk, dt_s: float) -> None:
        """Waits for a robot, a person or a door; after a while, looks for another path, or steps aside."""
        walk.held_s += dt_s
        others = self._walks.items() if self._routes[name].apart else ()
        later = (there for other, there in others if other > name and there.walks)
        first = [there for there in later if math.dist(there.place_W, walk.place_W) < MEET_M]
        if walk.held_s < (GIVES_WAY_S if first else PATIENCE_S):
            return
        walk.held_s = 0.0
        if walk.turn_round() or walk.only_aside:
            return
        if self._is_taken(name, walk):
            walk.arrive()
            if not walk.done and (path := self._path_around(name, walk, ())) is not None:
                walk.take_detour(path, passing=False)
            return
        wanders = self._routes[name].wanders
        if wanders and any(self._people_near(name, walk)):
            walk.drop_path()
            return
        near = [*self._around(name, walk)]
        ways = [_swept_W(*part) for other in first for part in itertools.pairwise(other.ahead_W(FREE_PATH_M))]
        most_m = walk.left_m + (DETOUR_M if first or any(self._people_near(name, walk)) else math.inf)
        path = self._path_around(name, walk, [*near, *ways])
        if path is not None and Leg(path, 0.0).lengths_m()[-1] < most_m:
            walk.take_detour(path, passing=bool(near))
        elif wanders:
            walk.drop_path()
        elif near:
            self._step_aside(name, walk, first, near)

    def _is_taken(self, name: str, walk: Walk) -> bool:
        """Returns whether another person stands at the goal and the person is close to it."""
        others = (there for other, there in self._walks.items() if other != name and not there.walks)
        taken = any(math.dist(there.place_W, walk.next_stop_W) < PASS_APART_M for there in others)
        return taken and math.dist(walk.place_W, walk.next_stop_W) < APART_M + PASS_APART_M

    def _path_around(self, name: str, walk: Walk, outlines_W: Sequence[FloatArray]) -> tuple[Point, ...] | None:
        """Path to the next stop around outlines; None when no path exists, or the person is inside an outline."""
        ground = self._blocked_ground(outlines_W)
        with contextlib.suppress(WorldError):
            return ground.plan_path(walk.place_W, walk.next_stop_W, who=name)
        return None

    def _step_aside(self, name: str, walk: Walk, first: Sequence[Walk], near: Sequence[FloatArray]) -> None:
        """Lets others through where nobody can pass: steps off their paths and the person's own, and returns later."""
        lines_W = (walk.trail_W, *(each.ahead_W(FREE_PATH_M) for each in (walk, *first)))
        ground = self._blocked_ground(near)
        if (place_W := ground.aside(walk.place_W, lines_W, ASIDE_M)) is not None:
            with contextlib.suppress(WorldError):
                walk.step_aside(ground.plan_on(walk.place_W, place_W, who=name), ASIDE_S)

    def _around(self, name: str, walk: Walk) -> Iterator[FloatArray]:
        """Outlines (K, 2) of the robots and, if the person keeps apart, of people close to the person."""
        yield from self._outlines_W(walk)
        for other, there in self._walks.items() if self._routes[name].apart else ():
            if other != name and math.dist(there.place_W, walk.place_W) < MEET_M:
                yield _swept_W(there.place_W, there.place_W)

    def _blocked_ground(self, outlines_W: Sequence[FloatArray]) -> Ground:
        """Ground with closed doors and `outlines_W` as obstacles."""
        assert self._ground is not None
        doors = (np.array([a, b, b]) for a, b in self._barriers)
        blocked = [*outlines_W, *doors]
        return self._ground.with_obstacles(blocked) if blocked else self._ground

    def _held(self, name: str, walk: Walk) -> bool:
        """Returns whether a person must wait for a robot, a person or a door."""
        route = self._routes[name]
        path = walk.ahead_W(DOOR_M) if self._barriers else ()
        if any(segments_cross(part, door) for part in itertools.pairwise(path) for door in self._barriers):
            return True
        if route.apart and any(self._people_near(name, walk)):
            return True
        return route.yields and any(self._close_ahead(walk, outline_W) for outline_W in self._outlines_W(walk))

    def _people_near(self, name: str, walk: Walk) -> Iterator[Point]:
        """Positions of the other walking people to whom the person's next steps would come too close."""
        for other, there in self._walks.items():
            away_m = math.dist(there.place_W, walk.place_W)
            if other == name or away_m > APART_M + PASS_APART_M:
                continue
            nearer = math.dist(there.place_W, walk.ahead_W(STEPS_M)[-1]) < away_m
            ahead = shapely.LineString(walk.ahead_W(APART_M))
            if nearer and ahead.distance(shapely.Point(there.place_W)) < PASS_APART_M:
                yield there.place_W

    def _away_m(self, robot: str, walk: Walk) -> float:
        """Distance between a robot's body and a person, in metres."""
        p_WB = self._plant.EvalBodyPoseInWorld(self._context, self._robots[robot].body).translation()
        return math.dist(p_WB[:2], walk.place_W)

    def _outlines_W(self, walk: Walk) -> Iterator[FloatArray]:
        """Outlines (K, 2) of the robots that are near a person."""
        for name, robot in self._robots.items():
            reach_m = float(np.linalg.norm(robot.kind.capabilities().footprint_m, axis=1).max())
            if self._away_m(name, walk) < YIELD_M + reach_m:
                yield robot.outline_W(self._context)

    def _close_ahead(self, walk: Walk, outline_W: FloatArray) -> bool:
        """Returns whether an outline is close to the person and ahead of the person."""
        nearest_W = nearest_point(outline_W.tolist(), walk.place_W)
        if float(np.hypot(*np.subtract(nearest_W, walk.place_W))) > (PASS_M if walk.on_detour else YIELD_M):
            return False
        return _is_ahead(walk, nearest_W)


def _walk(name: str, route: PointRoute, ground: Ground) -> Walk:
    """Plans the legs of a route. Raises WorldError when no path leads to a stop."""
    stops = [*route.stops, *(route.stops[:1] if route.loops else ())]
    legs = [Leg(ground.plan_path(a.at_W, b.at_W, who=name), b.pause_s) for a, b in itertools.pairwise(stops)]
    first = route.stops[0]

    @cache
    def pace(part: int) -> float:
        """Speed factor on a section of the path."""
        rng = np.random.default_rng([*route.stream, 1, part])
        return float(rng.uniform(1.0 - route.pace, 1.0 + route.pace))

    return Walk(
        legs,
        at_W=first.at_W,
        yaw_rad=route.first_yaw_rad,
        speed_m_s=route.speed_m_s,
        start_s=route.start_s + first.pause_s,
        loops=route.loops and len(route.stops) > 1,
        pace=pace if route.pace > 0.0 else None,
        lapses=route.lapses,
    )


def _is_ahead(walk: Walk, point_W: Sequence[float] | FloatArray) -> bool:
    """Returns whether a point lies ahead of a person."""
    bearing_rad = math.atan2(point_W[1] - walk.place_W[1], point_W[0] - walk.place_W[0])
    return abs(math.remainder(bearing_rad - walk.heading_rad, math.tau)) < AHEAD_RAD


def segments_cross(a: tuple[Point, Point], b: tuple[Point, Point]) -> bool:
    """Returns whether two segments cross."""

    def side(line: tuple[Point, Point], p: Point) -> float:
        (x0, y0), (x1, y1) = line
        return (x1 - x0) * (p[1] - y0) - (y1 - y0) * (p[0] - x0)

    return side(a, b[0]) * side(a, b[1]) < 0.0 and side(b, a[0]) * side(b, a[1]) < 0.0


def _swept_W(a_W: Point, b_W: Point) -> FloatArray:
    """Convex outline (K, 2) of a person who moves from one point to another."""
    box = _HALF_BODY_M * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    corners = np.concatenate([box + a_W, box + b_W]).astype(np.float32)
    return np.asarray(cv2.convexHull(corners).reshape(-1, 2), dtype=np.float64)
