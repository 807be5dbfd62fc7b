"""A kinematic stand-in for a robot among boxes: no dynamics, but drift, lag, LiDAR, depth, expiry and lease."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from executive.run.worker import LockStepWorker
from skills.api import Job, SkillContext
from skills.estimate.costmap import LayeredCostmap
from skills.estimate.localiser import LocaliserOptions
from skills.geometry import compose, inverse
from skills.robot import (
    BaseKind,
    CameraCapabilities,
    Capabilities,
    CommandCause,
    CommandId,
    CommandState,
    CommandStatus,
    FrameTree,
    Gripper,
    Image,
    Intrinsics,
    Lease,
    LeaseError,
    Odometry,
    Pose2D,
    Scan,
)
from skills.stack import LocaliserComponent
from skills.testing.blocks import Block as Box
from skills.testing.blocks import block_array, cast_rays, grid_of

OUTLINE = ((0.55, 0.25), (-0.55, 0.25), (-0.55, -0.25), (0.55, -0.25))
BODY_HEIGHT_M = 0.52
X_BL = RigidTransform(np.array([-0.2, 0.0, 0.4]))
X_BC = RigidTransform(
    RotationMatrix(RollPitchYaw(0.0, math.radians(30.0), 0.0))
    @ RotationMatrix(RollPitchYaw(-math.pi / 2, 0, -math.pi / 2)),
    np.array([0.42, 0.0, 0.02]),
)
ELEVATIONS = np.deg2rad(np.arange(-15.0, 16.0, 2.0))
LENS = Intrinsics(80, 60, 41.0, 41.0, 39.5, 29.5)


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


class PlanarClock:
    def __init__(self) -> None:
        self.time_s = 0.0
        self.robots: list[PlanarRobot] = []

    def now(self) -> float:
        return self.time_s

    def advance(self, dt_s: float) -> None:
        steps = round(dt_s / 0.01)
        for _ in range(steps):
            self.time_s += 0.01
            for robot in self.robots:
                robot.pass_time(0.01)


class PlanarRobot:
    """Implements the verbs of `skills.robot.Robot` that going about needs."""

    name = "alice"

    def __init__(
        self,
        clock: PlanarClock,
        boxes: Sequence[Box],
        pose: Pose2D,
        *,
        seed: int = 0,
        azimuths: int = 900,
        cameras: bool = True,
        base_kind: BaseKind = BaseKind.OMNIDIRECTIONAL,
    ) -> None:
        self.clock, self.base_kind = clock, base_kind
        self.boxes = list(boxes)
        self.pose = pose
        self.velocity = np.zeros(3)
        self.odometry_pose = Pose2D(0.0, 0.0, 0.0)
        self.travelled_m = 0.0
        self.least_clearance_m = math.inf
        self.refuse_because = ""
        self.images_taken = 0
        self.scale_drift, self.yaw_drift_rad_per_m = 1.01, math.radians(0.3)
        self._rng = np.random.default_rng(seed)
        self._azimuths = np.linspace(-math.pi, math.pi, azimuths, endpoint=False)
        self._cameras = tuple(CameraCapabilities(name, X_BC) for name in ("frontleft", "frontright")) if cameras else ()
        self._scan: Scan | None = None
        self._lease = Lease(self.name, "", 0)
        self._commands: dict[CommandId, CommandStatus] = {}
        self._drive: tuple[CommandId, np.ndarray, float] | None = None
        clock.robots.append(self)

    # ---- know and sense

    def capabilities(self) -> Capabilities:
        ranges = (BODY_HEIGHT_M, (0.4, 0.6), (-0.3, 0.3))
        return Capabilities(OUTLINE, 1.6, 2.0, *ranges, None, None, self._cameras, "", self.base_kind)

    def gripper(self) -> Gripper:
        return Gripper(self.clock.now(), 0.0, 0.0, False)

    def odometry(self) -> Odometry:
        X_OB = self.odometry_pose.transform(BODY_HEIGHT_M)
        vx, vy, wz = (float(v) for v in self.velocity)
        return Odometry(self.clock.now(), X_OB, (vx, vy, wz))

    def scan(self) -> Scan | None:
        return self._scan

    def image(self, source: str, *, visual: bool = True, depth: bool = True) -> Image:
        if source not in [each.source for each in self.capabilities().cameras]:
            raise ValueError(f"no camera {source!r}")
        self.images_taken += 1
        u, v = np.meshgrid(np.arange(LENS.width), np.arange(LENS.height))
        rays_C = np.stack([(u - LENS.cx) / LENS.fx, (v - LENS.cy) / LENS.fy, np.ones_like(u, dtype=float)], axis=-1)
        X_WC = self.pose.transform(BODY_HEIGHT_M) @ X_BC
        rays_W = rays_C.reshape(-1, 3) @ X_WC.rotation().matrix().T
        depth_m = cast_rays(X_WC.translation(), np.ascontiguousarray(rays_W), block_array(self.boxes), 4.0)[0]
        depth_m = np.nan_to_num(depth_m + 0.005 * self._rng.standard_normal(depth_m.shape), nan=0.0)
        grey = np.zeros((LENS.height, LENS.width), dtype=np.uint8)
        frames = FrameTree({"body": ("odom", self.odometry().X_OB), f"{source}_camera": ("body", X_BC)})
        return Image(
            self.clock.now(),
            source,
            f"{source}_camera",
            LENS,
            LENS,
            None,
            grey,
            depth_m.reshape(grey.shape).astype(np.float32),
            frames,
        )

    # ---- act

    def drive(self, vx: float, vy: float, wz: float, *, until_s: float, lease: Lease) -> CommandId:
        command = CommandId(len(self._commands) + 1)
        if lease.number != self._lease.number or self.refuse_because:
            reason = self.refuse_because or "the lease was taken away"
            cause = CommandCause.REFUSED if self.refuse_because else CommandCause.NO_LEASE
            self._commands[command] = CommandStatus(CommandState.REFUSED, reason, cause)
            return command
        if vy != 0.0 and self.base_kind is BaseKind.DIFFERENTIAL:
            self._commands[command] = CommandStatus(CommandState.REFUSED, "this base cannot go sideways")
            return command
        self._finish(CommandState.STOPPED, "replaced")
        self._commands[command] = CommandStatus(CommandState.RUNNING)
        self._drive = (command, np.array([vx, vy, wz]), until_s)
        return command

    def stop(self, *, lease: Lease, only: CommandId | None = None) -> CommandId:
        if lease.number == self._lease.number and self._drive and only in (None, self._drive[0]):
            self._finish(CommandState.STOPPED, "stopped")
        command = CommandId(len(self._commands) + 1)
        self._commands[command] = CommandStatus(CommandState.DONE)
        return command

    def command_status(self, command: CommandId) -> CommandStatus:
        return self._commands[command]

    def acquire_lease(self, holder: str) -> Lease:
        if self._lease.holder:
            raise LeaseError(f"{self._lease.holder} holds the lease")
        return self.take_lease(holder)

    def lease_holder(self) -> Lease:
        return self._lease

    def take_lease(self, holder: str) -> Lease:
        self._finish(CommandState.STOPPED, "lease taken")
        self._lease = Lease(self.name, holder, self._lease.number + 1)
        return self._lease

    @property
    def driving(self) -> bool:
        return self._drive is not None

    # ---- the world's side

    def pass_time(self, dt_s: float) -> None:
        if self._drive is not None and self.clock.now() > self._drive[2]:
            self._finish(CommandState.DONE, "expired")
        wanted = self._drive[1] if self._drive is not None else np.zeros(3)
        self.velocity = self.velocity + (wanted - self.velocity) * min(1.0, dt_s / 0.12)
        step = self.velocity * dt_s
        self.pose = compose(self.pose, Pose2D(*step.tolist()))
        way = math.hypot(step[0], step[1])
        self.travelled_m += way
        turn = step[2] + self.yaw_drift_rad_per_m * way
        drifted = Pose2D(self.scale_drift * step[0], self.scale_drift * step[1], turn)
        self.odometry_pose = compose(self.odometry_pose, drifted)
        ticks = round(self.clock.now() / 0.01)
        if ticks % 10 == 0:
            self._scan = self._sweep()
        if ticks % 5 == 0:
            self.least_clearance_m = min(self.least_clearance_m, self.true_clearance_m())

    def push(self, dx_m: float, dy_m: float, dyaw_rad: float) -> None:
        """Somebody shoves the robot, in the body frame; its odometry notices."""
        shove = Pose2D(dx_m, dy_m, dyaw_rad)
        self.pose, self.odometry_pose = compose(self.pose, shove), compose(self.odometry_pose, shove)

    def carry_off(self, pose: Pose2D) -> None:
        """Somebody lifts the robot to another place; its odometry does not notice."""
        self.pose = pose
        self._scan = self._sweep()

    def true_clearance_m(self) -> float:
        """Distance from points on the outline to the nearest box below 1 m; negative inside one."""
        t = np.linspace(0.0, 1.0, 12)[:, None]
        corners = np.array(OUTLINE)
        edge = np.concatenate([a + t * (b - a) for a, b in zip(corners, np.roll(corners, 1, axis=0), strict=True)])
        c, s = math.cos(self.pose.yaw_rad), math.sin(self.pose.yaw_rad)
        x = self.pose.x_m + c * edge[:, 0] - s * edge[:, 1]
        y = self.pose.y_m + s * edge[:, 0] + c * edge[:, 1]
        boxes = np.array([(b.x0, b.y0, b.x1, b.y1) for b in self.boxes if b.z0 < 1.0])[:, None, :]
        dx = np.maximum(boxes[..., 0] - x, x - boxes[..., 2])
        dy = np.maximum(boxes[..., 1] - y, y - boxes[..., 3])
        outside = np.hypot(np.maximum(dx, 0.0), np.maximum(dy, 0.0))
        return float(np.min(np.where(outside > 0.0, outside, np.maximum(dx, dy))))

    def _finish(self, state: CommandState, reason: str) -> None:
        if self._drive is not None:
            self._commands[self._drive[0]] = CommandStatus(state, reason)
            self._drive = None

    def _sweep(self) -> Scan:
        X_WL = self.pose.transform(BODY_HEIGHT_M) @ X_BL
        e, a = ELEVATIONS[:, None], self._azimuths[None, :]
        rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e) + 0.0 * a], axis=-1).reshape(-1, 3)
        rays_W = np.ascontiguousarray(rays @ X_WL.rotation().matrix().T)
        ranges = cast_rays(X_WL.translation(), rays_W, block_array(self.boxes), 100.0)[0]
        ranges = ranges + 0.03 * self._rng.standard_normal(ranges.shape)
        ranges[ranges < 0.5] = np.nan
        shaped = ranges.reshape(len(ELEVATIONS), -1).astype(np.float32)
        return Scan(self.clock.now(), shaped, ELEVATIONS, self._azimuths, X_BL, self.odometry().X_OB)


class NamingWorker(LockStepWorker):
    """Remembers the names of what was submitted, and does it at once: fake detectors see the bench as it is then."""

    def __init__(self, clock: PlanarClock) -> None:
        super().__init__(clock)
        self.names: list[str] = []

    def submit(self, work: Callable[[], Any], *, latency_s: float, name: str) -> Job[Any]:
        self.names.append(name)
        job = super().submit(work, latency_s=latency_s, name=name)
        job.withdraw()  # waits for the work; the result is there to be had all the same
        return job


class Bench:
    """A robot among boxes with its estimators, advanced as the runner would do it. `surveyed` is what the maps know.

    `component` makes the localiser, whose start is known or not.
    """

    def __init__(
        self,
        start: Pose2D,
        *,
        surveyed: Sequence[Box] = TWO_ROOMS,
        unmapped: Sequence[Box] = (),
        believed_start: Pose2D | None = None,
        seed: int = 0,
        cameras: bool = True,
        component: LocaliserComponent | None = None,
        start_known: bool = True,
        base_kind: BaseKind = BaseKind.OMNIDIRECTIONAL,
    ) -> None:
        self.clock = PlanarClock()
        world = [*surveyed, *unmapped]
        self.robot = PlanarRobot(self.clock, world, start, seed=seed, cameras=cameras, base_kind=base_kind)
        believed = (believed_start or start) if start_known else None
        grid = grid_of(surveyed, (0.7, 1.3))
        self.localiser = (component or LocaliserOptions()).build(grid, believed, surely=start_known)
        self.costmap = LayeredCostmap(grid_of(surveyed, (0.05, 1.0)))
        self.worker = NamingWorker(self.clock)
        self.published: list[tuple[str, Mapping[str, Any]]] = []
        self.lease = self.robot.take_lease("test")

    def context(self) -> SkillContext:
        def publish(topic: str, message: Mapping[str, Any]) -> None:
            self.published.append((topic, message))

        return SkillContext(
            self.robot, self.lease, self.clock, self.worker, self.localiser, self.costmap, publish, seed=0
        )

    def tick(self) -> None:
        """One tick's time and the estimators after it."""
        self.clock.advance(0.05)
        self.localiser.update(self.robot)
        self.costmap.update(self.robot, self.localiser.estimate())

    def pose_error(self) -> tuple[float, float]:
        """Metres and radians between the estimated and the true pose."""
        off = compose(inverse(self.robot.pose), self.context().pose())
        return math.hypot(off.x_m, off.y_m), abs(off.yaw_rad)
