"""Monitors of the sensors for driving: health of the LiDAR, and low obstacles from depth cameras."""

import math
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from skills.api import Job, ReturnsView, SkillContext
from skills.geometry import relative_pose
from skills.quantities import Count, Delay, Duration, Height, Length, Share, Turn
from skills.robot import FloatArray, Image, NoImageError, Pose2D, Scan


@dataclass(frozen=True)
class WatchOptions:
    """Low obstacles, from depth images of the front cameras in turn.

    `period_s` and `latency_s`: least time between images, and until one arrives. `step_m`, `step_rad` and `rest_s`: the
    next image waits until the robot has moved or turned this far, for `rest_s` at most. `columns`: about how many
    pixels of each row are used. `heights_m` and `reach_m`: range of heights above the floor, and largest depth, of the
    points used.
    """

    period_s: Duration = 0.35
    step_m: Length = 0.25
    step_rad: Turn = 0.35
    rest_s: Delay = 1.0
    latency_s: Delay = 0.1
    columns: Count = 110
    heights_m: tuple[Height, Height] = (0.06, 0.5)
    reach_m: Length = 2.0


class LowObstacleWatch:
    """Adds obstacles below the LiDAR, seen by the front depth cameras, to the costmap."""

    def __init__(self, context: SkillContext, options: WatchOptions | None = None) -> None:
        self._context = context
        self._options = options or WatchOptions()
        cameras = context.robot.capabilities().body_cameras
        self._sources = tuple(camera.source for camera in cameras if camera.looks_towards(0.0))
        self._turn = 0
        self._taken_s, self._taken_at = -math.inf, Pose2D(0.0, 0.0, 0.0)
        self._job: Job[tuple[FloatArray, float]] | None = None
        self._X_WO = RigidTransform()

    def step(self) -> None:
        """Processes a new image, and requests the next one when it is due. Never blocks."""
        if self._job is not None:
            if self._job.done():
                job, self._job = self._job, None
                with suppress(NoImageError):
                    points_O, stamp_s = job.result()
                    self._context.costmap.add_points(self._X_WO.multiply(points_O.T).T, stamp_s)
            return
        if not self._sources or not self._is_due():
            return
        source = self._sources[self._turn % len(self._sources)]
        self._turn += 1
        self._taken_s, self._taken_at = self._context.clock.now(), self._context.pose()
        self._X_WO = self._context.localiser.estimate().X_WO
        robot, options = self._context.robot, self._options
        self._job = self._context.worker.sense(
            lambda: robot.image(source, visual=False),
            lambda image: (low_points(image, options), image.stamp_s),
            latency_s=options.latency_s,
            name=f"look for low obstacles by {source}",
        )

    def _is_due(self) -> bool:
        """Returns whether it is time for the next image."""
        options, since_s = self._options, self._context.clock.now() - self._taken_s
        if not options.period_s <= since_s < options.rest_s:
            return since_s >= options.rest_s
        off = relative_pose(self._taken_at, self._context.pose())
        return math.hypot(off.x_m, off.y_m) >= options.step_m or abs(off.yaw_rad) >= options.step_rad


def low_points(image: Image, options: WatchOptions) -> FloatArray:
    """Points (N, 3) from a depth image, in the odom frame, that are near and low above the floor."""
    stride = max(1, image.depth_m.shape[1] // options.columns)
    depth = image.depth_m[::stride, ::stride].astype(np.float64)
    rows, columns = np.nonzero((depth > 0.0) & (depth < options.reach_m))
    z = depth[rows, columns]
    lens = image.depth_intrinsics
    x = (columns * stride - lens.cx) / lens.fx * z
    y = (rows * stride - lens.cy) / lens.fy * z
    points_O = image.frames.pose(image.camera_frame).multiply(np.stack([x, y, z])).T
    low, high = options.heights_m
    return np.ascontiguousarray(points_O[(points_O[:, 2] > low) & (points_O[:, 2] < high)])


@dataclass(frozen=True)
class ScanHealthOptions:
    """Health of the LiDAR: largest age `old_s` of a scan, and smallest fraction `least_valid` of valid ranges.

    A scan that repeats the last one, noise included, keeps the age of that one.
    """

    old_s: Delay = 0.5
    least_valid: Share = 0.02


class ScanHealth:
    """Checks the newest scan; always passes with a costmap that does not use LiDAR returns."""

    def __init__(self, context: SkillContext, options: ScanHealthOptions | None = None) -> None:
        self._context, self._options = context, options or ScanHealthOptions()
        self._needed = isinstance(context.costmap, ReturnsView)
        self._last: Scan | None = None

    def trouble(self) -> str | None:
        """Sentence that describes the LiDAR's fault; None when it is healthy."""
        if not self._needed:
            return None
        scan, now_s = self._context.robot.scan(), self._context.clock.now()
        if scan is None:
            return "The LiDAR gives no scans."
        if scan is not self._last:
            if np.count_nonzero(np.isfinite(scan.ranges_m)) < self._options.least_valid * scan.ranges_m.size:
                return "The LiDAR measures nothing: its ranges are invalid."
            if self._last is None or not scan.repeats(self._last):
                self._last = scan
        age_s = now_s - self._last.stamp_s
        if age_s > self._options.old_s:
            repeated = "repeats its last scan" if scan.stamp_s > self._last.stamp_s else "gives no new scans"
            return f"The LiDAR {repeated}, which is {age_s:.1f} s old."
        return None
