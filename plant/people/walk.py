"""How a person goes along a route: pure kinematics, from one step of the plant to the next."""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

from plant.snapshot.values import State
from plant.worlds.world import Point

TURN_RAD_S = 4.0


@dataclass(frozen=True)
class Leg:
    """A way between two stops as corners (x, y), at least one, and how long (s) the person stands at its end."""

    corners_W: tuple[Point, ...]
    pause_s: float

    def lengths_m(self) -> tuple[float, ...]:
        """The way to each corner from the first."""
        lengths = [0.0]
        for a, b in itertools.pairwise(self.corners_W):
            lengths.append(lengths[-1] + math.dist(a, b))
        return tuple(lengths)


class Walk:
    """A person on the legs of a route, who looks where they go. Call `advance` once a step."""

    def __init__(
        self, legs: Sequence[Leg], *, at_W: Point, yaw_rad: float, speed_m_s: float, start_s: float, loops: bool
    ) -> None:
        """The person stands at `at_W` until `start_s`; the last leg of one that `loops` ends where the first begins."""
        self._legs, self._lengths_m = tuple(legs), [leg.lengths_m() for leg in legs]
        self._speed_m_s, self._loops = speed_m_s, loops
        self._leg, self._way_m, self._wait_s = 0, 0.0, start_s
        self._detour: tuple[Leg, tuple[float, ...]] | None = None
        self.place_W, self.yaw_rad, self.heading_rad = at_W, yaw_rad, yaw_rad

    @property
    def done(self) -> bool:
        """Whether the person has come to the end of the route."""
        return self._leg >= len(self._legs)

    @property
    def walks(self) -> bool:
        """Whether the person is on the way, and not pausing."""
        return not self.done and self._wait_s <= 0.0

    def set_off(self) -> None:
        """End the pause."""
        self._wait_s = 0.0

    def detour(self, corners_W: tuple[Point, ...]) -> None:
        """Go to the next stop on another way, from here."""
        leg = Leg(corners_W, self._legs[self._leg].pause_s)
        self._detour, self._way_m = (leg, leg.lengths_m()), 0.0

    @property
    def next_stop_W(self) -> Point:
        """Where the leg under way ends. Raises IndexError: the route is done."""
        return self._legs[self._leg].corners_W[-1]

    @property
    def on_detour(self) -> bool:
        """Whether the person walks on another way than the planned one."""
        return self._detour is not None

    def advance(self, dt_s: float) -> None:
        """Go on for dt_s."""
        if self.done:
            return
        if self._wait_s > 0.0:
            self._wait_s -= dt_s
            return
        leg, lengths_m = self._detour or (self._legs[self._leg], self._lengths_m[self._leg])
        corners = leg.corners_W
        self._way_m = min(self._way_m + self._speed_m_s * dt_s, lengths_m[-1])
        after = min(bisect.bisect_right(lengths_m, self._way_m), len(corners) - 1)
        if after > 0:
            self._stand_between(corners[after - 1], corners[after], self._way_m - lengths_m[after - 1], dt_s)
        if self._way_m >= lengths_m[-1]:
            self._wait_s, self._way_m, self._leg, self._detour = leg.pause_s, 0.0, self._leg + 1, None
            if self._loops and self.done:
                self._leg = 0

    def _stand_between(self, a: Point, b: Point, way_m: float, dt_s: float) -> None:
        """Be so far on from corner a to corner b, and turn that way."""
        length_m = math.dist(a, b)
        share = way_m / length_m if length_m > 0.0 else 1.0
        self.place_W = (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]))
        if length_m > 0.0:
            self.heading_rad = math.atan2(b[1] - a[1], b[0] - a[0])
            off_rad = math.remainder(self.heading_rad - self.yaw_rad, math.tau)
            self.yaw_rad += max(-TURN_RAD_S * dt_s, min(TURN_RAD_S * dt_s, off_rad))

    def state(self) -> State:
        """How far the person is."""
        pose = [*self.place_W, self.yaw_rad, self.heading_rad]
        detour = None if self._detour is None else [[*corner] for corner in self._detour[0].corners_W]
        return {"leg": self._leg, "way_m": self._way_m, "wait_s": self._wait_s, "pose": pose, "detour": detour}

    def restore(self, state: State) -> None:
        """Go on from such a state."""
        self._leg, self._way_m, self._wait_s = state["leg"], state["way_m"], state["wait_s"]
        self._detour = None
        if state["detour"] is not None:
            way_m = self._way_m
            self.detour(tuple((x, y) for x, y in state["detour"]))
            self._way_m = way_m
        x, y, self.yaw_rad, self.heading_rad = state["pose"]
        self.place_W = (x, y)
