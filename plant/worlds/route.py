"""Routes on which people walk: waypoints as points, with what the walk between them is like."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from executive.words.mission import Route, Stop
from plant.worlds.world import Point


@dataclass(frozen=True)
class PointStop:
    """A waypoint in the world frame, and how long the person stands there (s)."""

    at_W: Point
    pause_s: float = 0.0


@dataclass(frozen=True)
class PointRoute:
    """Where and how a person walks: m/s, set off at `start_s`, back from the last stop to the first if it `loops`.

    A person who `yields` stops for a robot that is close ahead.
    """

    stops: tuple[PointStop, ...]
    speed_m_s: float = 1.2
    loops: bool = False
    start_s: float = 0.0
    yields: bool = True
    yaw_rad: float | None = None

    def begun_at(self, at_W: Point, yaw_rad: float) -> PointRoute:
        """The same for somebody who stands somewhere at first."""
        return replace(self, stops=(PointStop(at_W), *self.stops), yaw_rad=yaw_rad)

    @property
    def first_yaw_rad(self) -> float:
        """The way that the person looks at first: as they stand, or towards the second stop."""
        if self.yaw_rad is not None:
            return self.yaw_rad
        (x0, y0), (x1, y1) = self.stops[0].at_W, self.stops[min(1, len(self.stops) - 1)].at_W
        return math.atan2(y1 - y0, x1 - x0)


def point_route(route: Route, standing: Mapping[str, Point]) -> PointRoute:
    """The route whose places are known in `standing`."""
    stops = (each if isinstance(each, Stop) else Stop(at=each) for each in route.waypoints)
    points = (PointStop(standing[each.at] if isinstance(each.at, str) else each.at, each.pause) for each in stops)
    return PointRoute(tuple(points), route.speed, route.loop, route.start, route.yields)
