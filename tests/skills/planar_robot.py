"""The scripted robot among boxes with lag, drift and a noisy LiDAR; a bench with its estimators."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from executive.run.worker import LockStepWorker
from skills.api import Running, SkillContext
from skills.estimate.costmap import LayeredCostmap
from skills.estimate.localiser import LocaliserOptions
from skills.geometry import compose, inverse
from skills.robot import BaseKind, Pose2D
from skills.testing.blocks import FRONT_CAMERAS, grid_of, mount_of
from skills.testing.blocks import Block as Box
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap, KnownPlace
from skills.testing.robot import BASE_ONLY, ScriptedRobot, Start

OUTLINE, BODY_HEIGHT_M = BASE_ONLY.footprint_m, BASE_ONLY.standing_height_m
X_BC, LENS = FRONT_CAMERAS[0].X_FC, mount_of(FRONT_CAMERAS[0]).lens
LAG_S = 0.12

TWO_ROOMS = (
    Box(-0.1, -0.1, 10.1, 0.0),
    Box(-0.1, 7.0, 10.1, 7.1),
    Box(-0.1, 0.0, 0.0, 7.0),
    Box(10.0, 0.0, 10.1, 7.0),
    Box(0.0, 4.0, 2.0, 4.1),  # between the rooms below and the corridor above, doors of 0.9 m at x = 2 and x = 7
    Box(2.9, 4.0, 7.0, 4.1),
    Box(7.9, 4.0, 10.0, 4.1),
    Box(4.95, 0.0, 5.05, 4.0),
    Box(0.6, 0.4, 1.4, 1.0, 0.0, 0.9),  # furniture
    Box(3.9, 2.6, 4.5, 3.4, 0.0, 1.2),
    Box(8.6, 0.3, 9.6, 0.9, 0.0, 1.1),
    Box(4.4, 6.5, 5.6, 7.0, 0.0, 1.8),
)
"""Two rooms side by side under a corridor 2.9 m wide; the way from one to the other leads through both doors."""


def capabilities_of(base_kind=BaseKind.OMNIDIRECTIONAL, *, cameras=True):
    """Those of a base without an arm."""
    return replace(BASE_ONLY, base_kind=base_kind, cameras=FRONT_CAMERAS if cameras else ())


def outline_points():
    """Points (48, 2) on the outline."""
    corners, share = np.array(OUTLINE), np.linspace(0.0, 1.0, 12)[:, None]
    return np.concatenate([a + share * (b - a) for a, b in zip(corners, np.roll(corners, 1, axis=0), strict=True)])


class PlanarRobot(ScriptedRobot):
    """The scripted robot whose base lags, and which measures its path and its least clearance from the boxes."""

    OUTLINE_B = outline_points()

    def __init__(self, clock, boxes, pose, *, capabilities=BASE_ONLY, seed=0, azimuths=600):
        self.travelled_m, self.least_clearance_m, self.images_taken = 0.0, math.inf, 0
        super().__init__(clock, name="alice", capabilities=capabilities, blocks=boxes, start=Start(pose), seed=seed)
        self.odometry_scale, self.yaw_drift_rad_per_m, self.lidar = 1.01, math.radians(0.3), (azimuths, 0.03)
        self.fine_camera = None

    def image(self, source, *, visual=True, depth=True):
        self.images_taken += 1
        return super().image(source, visual=visual, depth=depth)

    @property
    def driving(self):
        return self._commands.running("drive") is not None

    def push(self, dx_m, dy_m, dyaw_rad):
        """Somebody shoves the robot, in the body frame; its odometry notices."""
        shove = Pose2D(dx_m, dy_m, dyaw_rad)
        self.pose, self.odometry_pose = compose(self.pose, shove), compose(self.odometry_pose, shove)

    def carry_off(self, pose):
        """Somebody lifts the robot to another place; its odometry does not notice."""
        self.pose, self._scan = pose, None

    def true_clearance_m(self):
        """Distance from points on the outline to the nearest box below 1 m; negative inside one."""
        c, s = math.cos(self.pose.yaw_rad), math.sin(self.pose.yaw_rad)
        points_W = self.OUTLINE_B @ np.array([[c, s], [-s, c]]) + (self.pose.x_m, self.pose.y_m)
        return float(BlockCostmap(self.blocks).clearance_m(points_W).min())

    def _pass_time(self, dt_s):
        super()._pass_time(dt_s)
        if round(self._clock.now() / 0.01) % 5 == 0:
            self.least_clearance_m = min(self.least_clearance_m, self.true_clearance_m())

    def _accelerate(self, dt_s):
        active = self._commands.running("drive")
        wanted = 0.0 if active is None else active.goal
        self.velocity = self.velocity + (wanted - self.velocity) * min(1.0, dt_s / LAG_S)
        self.travelled_m += math.hypot(self.velocity[0], self.velocity[1]) * dt_s


@cache
def grids_of(surveyed):
    """Exact maps of the boxes at the heights of the LiDAR, and of the body."""
    return grid_of(surveyed, (0.7, 1.3)), grid_of(surveyed, (0.05, 1.0))


class NamingWorker(LockStepWorker):
    """Remembers the names of what was submitted, and does it at once: fake detectors see the bench as it is then."""

    def __init__(self, clock):
        super().__init__(clock)
        self.names: list[str] = []

    def submit(self, work, *, latency_s, name):
        self.names.append(name)
        job = super().submit(work, latency_s=latency_s, name=name)
        job.withdraw()  # waits for the work; the result is there to be had all the same
        return job


class ExactPlace:
    """Component of an exact localiser, for what does not depend on the estimate of the pose."""

    @staticmethod
    def build(grid, start, *, surely):
        return KnownPlace(start)


class Bench:
    """A robot among boxes with its estimators, advanced as the runner would do it. `surveyed` is what the maps know.

    `component` makes the localiser, whose start is known or not.
    """

    def __init__(
        self,
        start,
        *,
        surveyed=TWO_ROOMS,
        unmapped=(),
        believed_start=None,
        seed=0,
        azimuths=600,
        cameras=True,
        component=None,
        start_known=True,
        base_kind=BaseKind.OMNIDIRECTIONAL,
    ):
        self.clock = VirtualClock()
        world, capabilities = [*surveyed, *unmapped], capabilities_of(base_kind, cameras=cameras)
        self.robot = PlanarRobot(self.clock, world, start, capabilities=capabilities, seed=seed, azimuths=azimuths)
        if isinstance(component, ExactPlace):
            self.robot.odometry_scale, self.robot.yaw_drift_rad_per_m = 1.0, 0.0
        believed = (believed_start or start) if start_known else None
        scan_grid, keepout_grid = grids_of(tuple(surveyed))
        self.localiser = (component or LocaliserOptions()).build(scan_grid, believed, surely=start_known)
        self.costmap = LayeredCostmap(keepout_grid)
        self.worker = NamingWorker(self.clock)
        self.published: list[tuple[str, Mapping[str, Any]]] = []
        self.lease = self.robot.take_lease("test")

    def context(self):
        def publish(topic, message):
            self.published.append((topic, message))

        return SkillContext(
            self.robot, self.lease, self.clock, self.worker, self.localiser, self.costmap, publish, seed=0
        )

    def tick(self, count=1):
        """Ticks' time and the estimators after each."""
        for _ in range(count):
            self.clock.advance(0.05)
            self.localiser.update(self.robot)
            self.costmap.update(self.robot, self.localiser.estimate())

    def run(self, skill, inputs, *, limit_s=90.0, each=lambda: None):
        """Runs a skill until it ends or its time is over, and `each` after each tick; returns its last step."""
        skill.begin(inputs)
        end_s = self.clock.now() + limit_s
        while isinstance(step := skill.step(), Running) and self.clock.now() < end_s:
            self.tick()
            each()
        skill.end()
        return step

    def pose_error(self):
        """Metres and radians between the estimated and the true pose."""
        off = compose(inverse(self.robot.pose), self.context().pose())
        return math.hypot(off.x_m, off.y_m), abs(off.yaw_rad)
