"""Walk of one person: the legs of a route, changes of pace, lapses of attention, and other paths."""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from plant.saved_state import Stateful
from plant.worlds.seeding import Lapse
from plant.worlds.world import Point

TURN_RAD_S = 4.0
TRAIL_STEP_M = 0.2
"""Distance between the points of a person's trail."""
TRAIL_POINTS = 60
PACE_M = 3.0
"""Length of the path on which a person keeps one pace."""


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

    def part(self, from_m: float, until_m: float) -> tuple[Point, ...]:
        """Corners of the path's section between two lengths from its start."""
        lengths = self.lengths_m()
        inner = (corner for corner, at_m in zip(self.corners_W, lengths, strict=True) if from_m < at_m < until_m)
        return (self._at(lengths, from_m), *inner, self._at(lengths, until_m))

    def _at(self, lengths: Sequence[float], at_m: float) -> Point:
        after = min(bisect.bisect_right(lengths, at_m), len(lengths) - 1)
        if after == 0 or lengths[after] == lengths[after - 1]:
            return self.corners_W[after]
        (x0, y0), (x1, y1) = self.corners_W[after - 1], self.corners_W[after]
        share = min(1.0, (at_m - lengths[after - 1]) / (lengths[after] - lengths[after - 1]))
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)


class Walk(
    Stateful,
    saved=(
        "_leg",
        "_done_m",
        "_wait_s",
        "_detour",
        "_asides",
        "_aside_m",
        "_trail",
        "_lapse",
        "_passing",
        "place_W",
        "yaw_rad",
        "heading_rad",
        "held_s",
        "walked_m",
        "lapsed",
    ),
):
    """A person on the legs of a route, or on paths given by `take_path`, who faces along the path.

    Call `advance` once per step. `held_s` is how long the person has waited for a robot, a door or a person; `walked_m`
    the total path length. `lapsed` is True once a lapse of attention has begun, until the caller resets it.
    """

    def __init__(
        self,
        legs: Sequence[Leg],
        *,
        at_W: Point,
        yaw_rad: float,
        speed_m_s: float,
        start_s: float,
        loops: bool,
        pace: Callable[[int], float] | None = None,
        lapses: Sequence[Lapse] = (),
    ) -> None:
        """The person stands at `at_W` until `start_s`; the last leg of a looped route ends where the first begins.

        `pace` returns the speed factor for each section of `PACE_M` of the walked path (None: 1).
        """
        self._legs, self._lengths_m = tuple(legs), [leg.lengths_m() for leg in legs]
        self._speed_m_s, self._loops, self._pace, self._lapses = speed_m_s, loops, pace, tuple(lapses)
        self._leg, self._done_m, self._wait_s = 0, 0.0, start_s
        self._detour: tuple[Leg, tuple[float, ...]] | None = None
        self._asides: tuple[Leg, ...] = ()
        self._aside_m, self._lapse, self._passing = 0.0, 0, False
        self._trail: tuple[Point, ...] = (at_W,)
        self.held_s = self.walked_m = 0.0
        self.lapsed = False
        self.place_W, self.yaw_rad, self.heading_rad = at_W, yaw_rad, yaw_rad

    @property
    def done(self) -> bool:
        """Returns whether the person has reached the end of the route or of the given path."""
        return not self._asides and self._detour is None and self._leg >= len(self._legs)

    @property
    def walks(self) -> bool:
        """Returns whether the person is on a path, and not in a pause."""
        return not self.done and self._wait_s <= 0.0

    @property
    def pauses(self) -> bool:
        """Returns whether the person pauses."""
        return self._wait_s > 0.0

    @property
    def goes_back(self) -> bool:
        """Returns whether the person walks back during a lapse of attention."""
        return len(self._asides) > 1

    def set_off(self) -> None:
        """Ends the pause."""
        self._wait_s = 0.0

    def take_detour(self, corners_W: tuple[Point, ...], *, passing: bool = True) -> None:
        """Replaces the rest of the path by another to its end, which may pass close to an obstacle (`passing`)."""
        pause_s = (self._detour[0] if self._detour is not None else self._legs[self._leg]).pause_s
        self.take_path(corners_W, pause_s, passing=passing)

    def take_path(self, corners_W: tuple[Point, ...], pause_s: float = 0.0, *, passing: bool = False) -> None:
        """Replaces the present path by another, which may pass close to an obstacle (`passing`)."""
        leg = Leg(corners_W, pause_s)
        self._detour, self._done_m = (leg, leg.lengths_m()), 0.0
        self._asides, self._passing = (), passing

    def drop_path(self) -> None:
        """Ends the given path where the person stands."""
        self._detour, self._asides, self._passing = None, (), False

    @property
    def only_aside(self) -> bool:
        """Returns whether the person has no path but the one aside and back."""
        return self._detour is None and self._leg >= len(self._legs)

    @property
    def next_stop_W(self) -> Point:
        """End of the present path. Raises IndexError when there is none."""
        if self._detour is not None:
            return self._detour[0].corners_W[-1]
        return self._legs[self._leg].corners_W[-1]

    @property
    def left_m(self) -> float:
        """Remaining length of the present path. Raises IndexError when there is none."""
        lengths_m = self._lengths_m[self._leg] if self._detour is None else self._detour[1]
        return lengths_m[-1] - self._done_m

    @property
    def on_detour(self) -> bool:
        """Returns whether the person passes close to an obstacle on a detour."""
        return self._passing

    def ahead_W(self, length_m: float) -> tuple[Point, ...]:
        """Corners of the path ahead, up to a length; the first is the person's position."""
        leg, _, done_m = self._present()
        return (self.place_W, *leg.part(done_m, done_m + length_m)[1:])

    def _present(self) -> tuple[Leg, tuple[float, ...], float]:
        """Present path, the lengths at its corners, and the walked length of it, in metres."""
        if self._asides:
            return self._asides[0], self._asides[0].lengths_m(), self._aside_m
        return *(self._detour or (self._legs[self._leg], self._lengths_m[self._leg])), self._done_m

    def advance(self, dt_s: float) -> None:
        """Walks or waits for dt_s."""
        if self._wait_s > 0.0:
            self._wait_s -= dt_s
            return
        if self.done:
            return
        leg, lengths_m, before_m = self._present()
        corners = leg.corners_W
        speed_m_s = self._speed_m_s * (1.0 if self._pace is None else self._pace(int(self.walked_m / PACE_M)))
        done_m = min(before_m + speed_m_s * dt_s, lengths_m[-1])
        after = min(bisect.bisect_right(lengths_m, done_m), len(corners) - 1)
        if after > 0:
            self._stand_between(corners[after - 1], corners[after], done_m - lengths_m[after - 1], dt_s)
        self._walked(done_m - before_m)
        over = done_m >= lengths_m[-1]
        if self._asides:
            self._aside_m = 0.0 if over else done_m
            self._asides = self._asides[over:]
            self._passing = self._passing and bool(self._asides)
            self._wait_s = leg.pause_s if over else 0.0
            return
        self._done_m = done_m
        if over:
            self.arrive()
        elif self._lapse < len(self._lapses) and self.walked_m >= self._lapses[self._lapse].after_m:
            self._begin(self._lapses[self._lapse])

    def arrive(self) -> None:
        """Ends the present path here, close to its end, and starts the pause that belongs to its end."""
        self._wait_s = (self._detour[0] if self._detour is not None else self._legs[self._leg]).pause_s
        self._done_m, self._leg, self._detour = 0.0, self._leg + 1, None
        self._asides, self._passing = (), False
        if self._loops and self.done:
            self._leg = 0

    def _walked(self, step_m: float) -> None:
        """Adds a step to the walked path and the trail."""
        self.walked_m += step_m
        if math.dist(self.place_W, self._trail[0]) >= TRAIL_STEP_M:
            self._trail = (self.place_W, *self._trail[: TRAIL_POINTS - 1])

    def _begin(self, lapse: Lapse) -> None:
        """Stops for a lapse of attention; if it says so, first walks back along the trail, and later returns."""
        self._lapse, self.lapsed = self._lapse + 1, True
        back = Leg((self.place_W, *self._trail), lapse.stop_s)
        back = Leg(back.part(0.0, min(lapse.back_m, back.lengths_m()[-1])), lapse.stop_s)
        forth = Leg(back.corners_W[::-1], 0.0)
        if lapse.back_m > 0.0:
            self._asides, self._aside_m = (back, forth), 0.0
        else:
            self._wait_s = lapse.stop_s

    def turn_round(self) -> bool:
        """Ends a walk back because of an obstacle; returns whether the person was walking back."""
        if len(self._asides) < 2:
            return False
        back = self._asides[0]
        self._asides = (Leg(back.part(0.0, self._aside_m)[::-1], 0.0),)
        self._wait_s, self._aside_m = back.pause_s, 0.0
        return True

    def step_aside(self, corners_W: tuple[Point, ...], pause_s: float) -> None:
        """Leaves the path or the place for another, pauses at its end, and comes back, there to go on as before."""
        self._asides, self._aside_m = (Leg(corners_W, pause_s), Leg(corners_W[::-1], self._wait_s)), 0.0
        self._wait_s = 0.0
        self._passing = True

    @property
    def trail_W(self) -> tuple[Point, ...]:
        """Previous positions of the person, the latest first."""
        return self._trail

    def _stand_between(self, a: Point, b: Point, from_a_m: float, dt_s: float) -> None:
        """Sets the position at a distance from corner a towards corner b, and turns towards b."""
        length_m = math.dist(a, b)
        share = from_a_m / length_m if length_m > 0.0 else 1.0
        self.place_W = (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]))
        if length_m > 0.0:
            self.heading_rad = math.atan2(b[1] - a[1], b[0] - a[0])
            off_rad = math.remainder(self.heading_rad - self.yaw_rad, math.tau)
            self.yaw_rad += max(-TURN_RAD_S * dt_s, min(TURN_RAD_S * dt_s, off_rad))
