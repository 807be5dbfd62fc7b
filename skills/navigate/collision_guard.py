"""Collision guard: stops the robot before moving obstacles, and before obstacles that are not yet in the costmap.

The guard uses only the last LiDAR revolution, and brakes at full deceleration.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from skills.api import ReturnsView, SkillContext
from skills.footprint import Footprint, disc_centres, outline_distances_m
from skills.path import LocalController, progress_m
from skills.perception.moving_objects import Moving, MovingOptions, MovingWatch
from skills.quantities import Acceleration, Count, Delay, Duration, Length, Margin, Speed, Turn
from skills.robot import FloatArray, Pose2D

Place = tuple[float, float]
_STEP_S = 0.1


@dataclass(frozen=True)
class GuardOptions:
    """Collision guard: stops the robot when a moving obstacle would come within `margin_m` in the next `horizon_s`.

    The prediction has two cases: the robot follows its path and accelerates at `acceleration_m_s2` up to its limit, or
    keeps its velocity for `coasting_s`. `slow_m_s`: obstacles slower than this are ignored. `follows_rad`: obstacles
    behind the robot that move in its direction within this angle are ignored. `least_points`: unexplained returns
    within `touch_m` of the braking path that stop the robot. `reaction_s` and `stop_m_s2`: delay and deceleration on
    the braking path. `clear_s`: how long the path must be clear before the robot drives on.
    """

    horizon_s: Duration = 1.3
    margin_m: Margin = 0.2
    acceleration_m_s2: Acceleration = 0.8
    coasting_s: Duration = 0.6
    slow_m_s: Speed = 0.35
    follows_rad: Turn = 0.8
    touch_m: Margin = 0.05
    least_points: Count = 3
    reaction_s: Delay = 0.15
    stop_m_s2: Acceleration = 3.0
    clear_s: Delay = 0.3
    near_m: Length = 4.0
    moving: MovingOptions = field(default_factory=MovingOptions)


class CollisionGuard:
    """Decides at each tick whether the robot must stop; does nothing when the costmap lacks unexplained returns."""

    def __init__(self, context: SkillContext, footprint: Footprint, options: GuardOptions | None = None) -> None:
        self._context, self.footprint = context, footprint
        self._options = options or GuardOptions()
        self._watch = MovingWatch(self._options.moving)
        self._danger_s, self._place_W = -math.inf, (0.0, 0.0)
        self._costmap = context.costmap if isinstance(context.costmap, ReturnsView) else None

    def danger(self, here: Pose2D, follower: LocalController, most_m_s: float) -> Place | None:
        """Position (x, y) of the obstacle that the robot would hit at up to most_m_s; None when it may drive on."""
        if self._costmap is None:
            return None
        now_s, (stamp_s, returns_W) = self._context.clock.now(), self._costmap.unexplained_returns()
        moving = self._watch.update(stamp_s, returns_W)
        found = self._suddenly_ahead(here, returns_W) or self._crossing(here, follower, most_m_s, moving, now_s)
        if found is not None:
            self._danger_s, self._place_W = now_s, found
        return self._place_W if now_s - self._danger_s < self._options.clear_s else None

    def _suddenly_ahead(self, here: Pose2D, returns_W: FloatArray) -> Place | None:
        """Position of the unexplained returns on the braking path; None when there are none.

        The speed is that of the outline's fastest point, so that a robot that turns on the spot stops too.
        """
        velocity, options = self._velocity_W(here), self._options
        speed = math.hypot(velocity[0], velocity[1]) + abs(float(velocity[2])) * self.footprint.circumscribed_m
        near = np.ascontiguousarray(returns_W[np.hypot(*(returns_W[:, :2] - (here.x_m, here.y_m)).T) < 1.5 + speed, :2])
        if len(near) < options.least_points or speed < 0.05:
            return None
        until_s = options.reaction_s + 0.5 * speed / options.stop_m_s2
        times = np.linspace(0.0, until_s, 1 + math.ceil(speed * until_s / 0.05))
        apart_m = outline_distances_m(self.footprint.discs, _coasting(here, velocity, times), near)
        now_m, then_m = apart_m[0], apart_m[1:].min(axis=0, initial=math.inf)
        hit = near[(then_m < options.touch_m) & (then_m < now_m - 0.02)]
        return None if len(hit) < options.least_points else tuple(hit.mean(axis=0).tolist())

    def _crossing(
        self, here: Pose2D, follower: LocalController, most_m_s: float, moving: tuple[Moving, ...], now_s: float
    ) -> Place | None:
        """Position of the first moving obstacle that will cross the robot's path; None when there is none."""
        options = self._options
        moving = tuple(one for one in moving if math.hypot(*one.velocity_W) >= options.slow_m_s)
        if not moving:
            return None
        times = np.arange(0.0, options.horizon_s + 1e-9, _STEP_S)
        velocity = self._velocity_W(here)
        on_path = self._on_path(follower, float(np.linalg.norm(velocity[:2])), most_m_s, times)
        coasting = _coasting(here, velocity, np.minimum(times, options.coasting_s))
        for one in (one for one in moving if not self._follows(one, here, on_path)):
            places_W = one.places_W(times, now_s)
            for poses in (on_path, coasting):
                centres = disc_centres(self.footprint.discs, poses)
                apart_m = np.linalg.norm(centres - places_W[:, None], axis=2) - self.footprint.discs[:, 2]
                if float(apart_m.min()) < options.margin_m + one.radius_m:
                    return one.place_W
        return None

    def _follows(self, one: Moving, here: Pose2D, on_path: FloatArray) -> bool:
        """Returns whether a moving obstacle follows the robot from behind; a stop would not help."""
        shift = on_path[-1, :2] - on_path[0, :2]
        if float(np.linalg.norm(shift)) < 0.05:
            return False
        towards = shift / np.linalg.norm(shift)
        behind = float((np.array(one.place_W) - (here.x_m, here.y_m)) @ towards) < -0.5 * self.footprint.width_m
        along, speed = float(np.array(one.velocity_W) @ towards), math.hypot(*one.velocity_W)
        return behind and along > math.cos(self._options.follows_rad) * speed

    def _on_path(self, follower: LocalController, speed: float, most_m_s: float, times: FloatArray) -> FloatArray:
        """Poses (N, 3) on the path at `times`, for a robot that accelerates from `speed`."""
        path = follower.ahead(most_m_s * self._options.horizon_s)
        gained = np.minimum(speed + self._options.acceleration_m_s2 * times, max(most_m_s, speed))
        driven = np.concatenate([[0.0], np.cumsum(0.5 * (gained[1:] + gained[:-1]) * np.diff(times))])
        return np.asarray(path[np.minimum(np.searchsorted(progress_m(path), driven), len(path) - 1)])

    def _velocity_W(self, here: Pose2D) -> FloatArray:
        """The body's velocity (vx, vy, wz) in world coordinates."""
        vx, vy, wz = self._context.robot.odometry().velocity
        c, s = math.cos(here.yaw_rad), math.sin(here.yaw_rad)
        return np.array([c * vx - s * vy, s * vx + c * vy, wz])


def _coasting(here: Pose2D, velocity_W: FloatArray, times: FloatArray) -> FloatArray:
    """Poses (N, 3) of a body that keeps its velocity."""
    return np.array([here.x_m, here.y_m, here.yaw_rad]) + times[:, None] * velocity_W
