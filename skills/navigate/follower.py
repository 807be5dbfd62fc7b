"""Path follower that brakes for obstacles.

A base that cannot move sideways follows by the law of Kanayama, Kimura, Miyazaki and Noguchi, "A Stable Tracking
Control Method for an Autonomous Mobile Robot", 1990, and turns on the spot where its path does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skills.footprint import Footprint, disc_centres, footprint_clearance_m
from skills.geometry import wrap
from skills.path import TURN_M_PER_RAD, Drive, Path
from skills.quantities import Acceleration, Delay, Duration, Factor, Length, Margin, Speed, TurnAcceleration, TurnRate
from skills.robot import BaseKind, FloatArray, Pose2D
from skills.world_model import FreeSpace

_CORNER_M_S = 0.12
"""Speed at the corners of a base that cannot go sideways."""
_ACROSS_GAIN = 4.0
_FACING_RAD = 0.5
"""Heading error beyond which such a base turns on the spot."""
_AT_END_M = 0.02
_RESERVE_M = 0.1


@dataclass(frozen=True)
class FollowerOptions:
    """Path follower with brakes for obstacles: speeds (m/s, rad/s), accelerations (m/s^2, rad/s^2), gain (1/s).

    `max_speed_m_s`: a mission may only lower it. `lead_s`: compensates the lag of the base. `touch_m` and `look_m`: an
    obstacle closer than `touch_m` to the outline within the next `look_m` blocks the path. `wide_m` and `near_m`:
    between these clearances the speed falls from full to `near_speed_m_s`.
    """

    max_speed_m_s: Speed = 0.8
    backward_m_s: Speed = 0.35
    lateral_m_s: Speed = 0.3
    turn_rad_s: TurnRate = 0.9
    acceleration_m_s2: Acceleration = 0.8
    braking_m_s2: Acceleration = 0.5
    turn_acceleration_rad_s2: TurnAcceleration = 2.5
    gain: Factor = 1.6
    lead_s: Delay = 0.2
    touch_m: Margin = 0.02
    look_m: Length = 1.6
    near_m: Margin = 0.08
    wide_m: Length = 0.3
    near_speed_m_s: Speed = 0.3
    creep_m_s: Speed = 0.04
    lost_path_m: Length = 0.35
    period_s: Duration = 0.05

    def build(self, path: Path, footprint: Footprint, *, max_speed_m_s: float) -> PathFollower:
        """Creates a follower for one path with a speed limit."""
        return PathFollower(path, footprint, replace(self, max_speed_m_s=min(self.max_speed_m_s, max_speed_m_s)))


class PathFollower:
    """Follows one path. Call `command` once per tick."""

    def __init__(self, path: Path, footprint: Footprint, options: FollowerOptions | None = None) -> None:
        self._options = options or FollowerOptions()
        self._path = path
        self._footprint = footprint
        self._progress = path.progress_m()
        self._sideways = footprint.base_kind is not BaseKind.DIFFERENTIAL
        corners = np.empty(0, dtype=np.int64) if self._sideways else corners_of(path)
        self._limits = speed_limits(path, self._progress, self._options, corners)
        self._index = 0

    @property
    def length_m(self) -> float:
        """Length of the path (m), turns included."""
        return float(self._progress[-1])

    def command(
        self,
        pose: Pose2D,
        velocity: tuple[float, float, float],
        last: FloatArray,
        costmap: FreeSpace,
        most_m_s: float = math.inf,
    ) -> Drive:
        """The command at a world pose and a body velocity; `last` (3,) is the previously commanded velocity.

        The speed is at most most_m_s; at 0 the robot stands.
        """
        here = np.array([pose.x_m, pose.y_m, pose.yaw_rad])
        off_path_m = self._project(here)
        along = float(self._progress[self._index])
        now_m, free_m, blocked_at = self._free_distance(costmap, here)
        in_time = math.sqrt(2.0 * self._options.braking_m_s2 * free_m)
        by_clearance = float(speed_by_clearance(now_m, self._options))
        speed = min(float(self._limits[self._index]), in_time, by_clearance, most_m_s)
        wanted = self._wanted(here, along, speed) if free_m > 0.0 and most_m_s > 0.0 else np.zeros(3)
        vx, vy, wz = self._brake(self._slew(self._clip(wanted), last), here, costmap).tolist()
        return Drive((vx, vy, wz), self.length_m - along, off_path_m, blocked_at)

    def _project(self, here: FloatArray) -> float:
        """Moves the index to the nearest pose on a short stretch of the path; returns the distance to that pose (m)."""
        first, last = max(0, self._index - 3), min(len(self._progress), self._index + 25)
        delta = self._path.poses[first:last] - here
        turns = wrap(delta[:, 2])
        off = np.sqrt(delta[:, 0] ** 2 + delta[:, 1] ** 2 + (TURN_M_PER_RAD * turns) ** 2)
        best = int(np.argmin(off))
        self._index = first + best
        return float(np.hypot(delta[best, 0], delta[best, 1]))

    def _at(self, along: float) -> FloatArray:
        """The path's pose at a progress (m)."""
        poses = self._path.poses
        return np.array([np.interp(along, self._progress, poses[:, axis]) for axis in range(3)])

    def _wanted(self, here: FloatArray, along: float, speed: float) -> FloatArray:
        """Body-frame velocity that follows the path and corrects the deviation from it."""
        options = self._options
        lead = max(speed * options.lead_s, 0.01)
        target, after = self._at(along), self._at(along + lead)
        forward = (after - target) / lead * speed
        if self.length_m - along < _AT_END_M:
            target, forward = self._path.poses[-1], np.zeros(3)
        error = target - here
        error[2] = wrap(error[2])
        if not self._sideways:
            return tracking_velocity(here, float(target[2]), forward, error, options.gain)
        world = forward + options.gain * error
        midway = here[2] + 0.5 * world[2] * options.period_s
        c, s = math.cos(midway), math.sin(midway)
        return np.array([c * world[0] + s * world[1], -s * world[0] + c * world[1], world[2]])

    def _clip(self, velocity: FloatArray) -> FloatArray:
        """Scales a velocity down to the speed limits; the direction stays."""
        options = self._options
        ahead = options.max_speed_m_s if velocity[0] >= 0.0 else options.backward_m_s
        share = np.abs(velocity) / np.array([ahead, options.lateral_m_s, options.turn_rad_s])
        return np.asarray(velocity / max(1.0, float(np.max(share))))

    def _slew(self, velocity: FloatArray, last: FloatArray) -> FloatArray:
        """Limits the change of a velocity to the accelerations; deceleration may be twice as large."""
        options = self._options
        most = np.array([options.acceleration_m_s2, options.acceleration_m_s2, options.turn_acceleration_rad_s2])
        most = most * options.period_s * np.where(np.abs(velocity) < np.abs(last), 2.0, 1.0)
        return np.asarray(last + np.clip(velocity - last, -most, most))

    def _free_distance(self, costmap: FreeSpace, here: FloatArray) -> tuple[float, float, tuple[float, float] | None]:
        """Clearance (m), free distance (m) ahead, minus a reserve, and the position of the first obstacle within it.

        When the present clearance is small already, the path counts as blocked only where the clearance falls below it.
        """
        options = self._options
        end = int(np.searchsorted(self._progress, self._progress[self._index] + options.look_m))
        poses = self._path.poses[self._index : end + 1 : 2]
        clearance = footprint_clearance_m(costmap, self._footprint, np.vstack([here, poses]))
        now_m = float(clearance[0])
        blocked = np.flatnonzero(clearance[1:] < min(options.touch_m, now_m - 0.02))
        if len(blocked) == 0:
            return now_m, options.look_m, None
        first = int(blocked[0])
        free_m = self._progress[self._index + 2 * first] - self._progress[self._index]
        centres = disc_centres(self._footprint.discs, poses[first : first + 1])[0]
        worst = int(np.argmin(costmap.clearance_m(centres) - self._footprint.discs[:, 2]))
        return now_m, max(0.0, float(free_m) - _RESERVE_M), (float(centres[worst, 0]), float(centres[worst, 1]))

    def _brake(self, velocity: FloatArray, here: FloatArray, costmap: FreeSpace) -> FloatArray:
        """The velocity, or a fraction of it that keeps the outline clear of obstacles for the next half second.

        Tries the whole, half of it, only sideways motion and rotation, one of the two, and then a stop.
        """
        shares = np.array([[1.0, 1.0, 1.0], [0.5, 0.5, 0.5], [0.0, 1.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        tried = velocity * shares
        c, s = math.cos(here[2]), math.sin(here[2])
        world = np.column_stack([c * tried[:, 0] - s * tried[:, 1], s * tried[:, 0] + c * tried[:, 1], tried[:, 2]])
        ahead = here + np.concatenate([np.zeros((1, 3)), 0.25 * world, 0.5 * world])
        clearance = footprint_clearance_m(costmap, self._footprint, ahead)
        least = np.minimum(clearance[1 : len(tried) + 1], clearance[len(tried) + 1 :])
        safe = np.flatnonzero(least >= min(self._options.touch_m, float(clearance[0]) - 0.005))
        return tried[safe[0]] if len(safe) else np.zeros(3)

    def ahead(self, way_m: float) -> FloatArray:
        """Poses (N, 3) on the next way_m of the path."""
        end = int(np.searchsorted(self._progress, self._progress[self._index] + way_m))
        return self._path.poses[self._index : end + 1]

    def pose_after(self, way_m: float) -> Pose2D:
        """Pose on the path way_m ahead of the robot."""
        x, y, yaw = self._at(min(self.length_m, float(self._progress[self._index]) + way_m)).tolist()
        return Pose2D(x, y, wrap(yaw))


def speed_by_clearance(clearance_m: FloatArray | float, options: FollowerOptions) -> FloatArray:
    """Speed limit (m/s) at a clearance."""
    share = np.clip((np.asarray(clearance_m) - options.near_m) / (options.wide_m - options.near_m), 0.0, 1.0)
    slow = min(options.near_speed_m_s, options.max_speed_m_s)
    return np.asarray(slow + share * (options.max_speed_m_s - slow))


def tracking_velocity(
    here: FloatArray, yaw_rad: float, forward: FloatArray, error: FloatArray, gain: float
) -> FloatArray:
    """Body-frame velocity of a base that cannot move sideways.

    The target pose on the path has heading yaw_rad and moves at `forward` (vx, vy, wz) in the world; `error` leads from
    `here` to the target. At a large heading error the base turns on the spot.
    """
    c, s = math.cos(here[2]), math.sin(here[2])
    ahead, left, turn = c * error[0] + s * error[1], -s * error[0] + c * error[1], float(error[2])
    speed = math.cos(yaw_rad) * forward[0] + math.sin(yaw_rad) * forward[1]
    if abs(turn) > _FACING_RAD:
        return np.array([0.0, 0.0, forward[2] + gain * turn])
    rate = forward[2] + _ACROSS_GAIN * speed * left + max(gain, 4.0 * abs(speed)) * math.sin(turn)
    return np.array([speed * math.cos(turn) + gain * ahead, 0.0, rate])


def corners_of(path: Path) -> NDArray[np.int64]:
    """Indices of the poses at which a path changes between driving forward, backward, and turning on the spot."""
    steps = np.diff(path.poses, axis=0)
    yaw = path.poses[:-1, 2]
    ahead = np.cos(yaw) * steps[:, 0] + np.sin(yaw) * steps[:, 1]
    kinds = np.where(np.hypot(steps[:, 0], steps[:, 1]) < 1e-6, 0.0, np.sign(ahead))
    return np.flatnonzero(np.diff(kinds) != 0.0) + 1


def speed_limits(
    path: Path, progress_m: FloatArray, options: FollowerOptions, corners: NDArray[np.int64] | None = None
) -> FloatArray:
    """Speed limit along the path (m/s of progress) at each pose: by direction, clearance, and braking for later limits.

    At `corners` (indices) the limit is nearly zero.
    """
    steps = np.diff(path.poses, axis=0)
    lengths = np.maximum(np.diff(progress_m), 1e-9)
    yaw = path.poses[:-1, 2]
    ahead = (np.cos(yaw) * steps[:, 0] + np.sin(yaw) * steps[:, 1]) / lengths
    aside = np.abs(-np.sin(yaw) * steps[:, 0] + np.cos(yaw) * steps[:, 1]) / lengths
    turn = np.abs(steps[:, 2]) / lengths
    by_clearance = speed_by_clearance(path.clearance_m[:-1], options)
    lengthwise = np.where(ahead >= 0.0, options.max_speed_m_s, options.backward_m_s) / np.maximum(np.abs(ahead), 1e-6)
    sideways = options.lateral_m_s / np.maximum(aside, 1e-6)
    turning = 0.85 * options.turn_rad_s / np.maximum(turn, 1e-6)
    shift = np.maximum(np.hypot(ahead, aside), 1e-6)
    limits = np.minimum.reduce([lengthwise, sideways, turning, by_clearance / shift])
    limits = np.append(limits, options.creep_m_s)
    if corners is not None:
        limits[corners] = np.minimum(limits[corners], _CORNER_M_S)
    for n in range(len(limits) - 2, -1, -1):
        limits[n] = min(limits[n], math.sqrt(limits[n + 1] ** 2 + 2.0 * options.braking_m_s2 * lengths[n]))
    return np.asarray(limits)
