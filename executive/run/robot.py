"""One robot of a run: its verbs under the watchdog, its lease, its estimators, and what the log tells of them."""

from __future__ import annotations

import math
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final, cast

import numpy as np

from executive.record.schemas import NAVIGATION, POSE, STATE, stamp
from executive.record.work import CountedDetector, Work
from executive.run.control import Control
from executive.run.guarded_robot import GuardedRobot
from executive.run.outcome import RobotStatus
from executive.run.traffic import TrafficTable
from executive.run.visitor import RunEntry, RunSettings, Visitors
from executive.run.watchdog import VerbHung, Watchdog
from executive.tree.board import Board
from executive.tree.context import RunContext
from executive.tree.nodes.skill import ERROR_TOPIC
from executive.words.slug import slug
from skills.api import LayeredView, LocalisationEstimate, ParticleView, Worker
from skills.navigate.footprint import Footprint
from skills.robot import Clock, Lease, Pose2D, Robot

__all__ = ["RunRobot", "RunShared"]

HOLDER: Final = "errand"
_NO_LEASE: Final = Lease("", "", 0)
POSE_PERIOD_S: Final = 0.5
MOST_PARTICLES: Final = 30
_EPSILON_S: Final = 1e-9
_NOTHING: Final = np.empty((0, 2))


@dataclass
class RunShared:
    """What all robots of a run share. `day_began_s` is the time of day (s after midnight) at the clock's zero."""

    clock: Clock
    worker: Worker
    visitors: Visitors
    settings: RunSettings
    control: Control
    work: Work = field(default_factory=Work)
    traffic: TrafficTable = field(init=False)
    watchdog: Watchdog = field(init=False)
    day_began_s: float = field(init=False)

    def __post_init__(self) -> None:
        limits, told_s = self.settings, self.settings.time_of_day_s
        self.traffic = TrafficTable({}, self.clock.now)
        self.watchdog = Watchdog(min(limits.verb_limit_s, limits.image_limit_s, limits.tick_limit_s))
        self.day_began_s = (_time_of_day_s() if told_s is None else told_s) - self.clock.now()


class RunRobot:
    """One robot, with or without a mission. `context` is what may be done with it, under the lease that it has; `pose`
    is where it believed to be when it last sensed (None: it did not know).
    """

    def __init__(self, entry: RunEntry, shared: RunShared) -> None:
        """Raises what the robot's verbs raise."""
        self.name: Final = entry.robot.name
        limits, self._traffic = shared.settings, shared.traffic
        self.pose: Pose2D | None = None
        self._guarded = GuardedRobot(
            entry.robot, shared.watchdog, limit_s=limits.verb_limit_s, image_limit_s=limits.image_limit_s
        )
        self._traffic.join(self.name, Footprint.of(self._guarded.capabilities()).discs)
        self.context = self._context(entry, shared)
        self._pose_due_s = shared.clock.now()
        self._matched_s = -math.inf
        self._navigation: Mapping[str, object] = {}

    def _context(self, entry: RunEntry, shared: RunShared) -> RunContext:
        """What the tree of a robot may use, without a lease."""
        name, control, publish = self.name, shared.control, shared.visitors.publish
        return RunContext(
            robot=cast(Robot, self._guarded),
            lease=_NO_LEASE,
            clock=shared.clock,
            worker=shared.worker,
            localiser=entry.localiser,
            costmap=entry.costmap,
            publish=lambda topic, message: publish(topic, {"robot": name, **message}),
            seed=shared.settings.seed,
            board=Board(slug(entry.tree.robot_name)),
            ask=lambda question: control.ask(question, shared.clock, name),
            stop_pressed=lambda: control.stop_pressed(name),
            presses=lambda: control.presses,
            day_began_s=shared.day_began_s,
            detector=CountedDetector(entry.detector, shared.work),
            work=shared.work,
            stack=entry.stack,
            doors=entry.tree.doors,
            traffic=shared.traffic.view_of(name),
        )

    def status(self, *, now: bool = False) -> RobotStatus:
        """Where the robot is (as it last sensed, or `now`), whether it holds something, and its battery's charge.

        Raises what its verbs raise.
        """
        robot, pose = self.context.robot, self.context.known_pose() if now else self.pose
        return RobotStatus(pose, robot.gripper().holding, robot.battery().charge)

    def sense(self) -> None:
        """Bring the estimators up to date, and tell the others where the robot believes to be."""
        context = self.context
        if estimators := context.leave_others_out:
            covered_W = self._traffic.covered_W(self.name)
            for estimator in estimators:
                estimator.leave_out(covered_W)
        context.localiser.update(context.robot)
        estimate = context.localiser.estimate()
        context.costmap.update(context.robot, estimate)
        self.pose = context.known_pose()
        self._traffic.heard(self.name, self.pose)

    def claim(self) -> RunContext:
        """Claim the lease, which nobody holds; what may be used under it. Raises LeaseError."""
        self.context = replace(self.context, lease=self._guarded.claim(HOLDER))
        return self.context

    def stop_and_leave(self) -> None:
        """Stop the robot and give its lease back. Raises nothing."""
        context = self.context
        self.attempt("stop the robot", lambda: context.robot.stop(lease=context.lease))
        self.attempt("return the lease", self._guarded.give_lease_back)

    def attempt(self, what: str, call: Callable[[], object]) -> None:
        """Do it; a defect goes to the log, since the rest of the end must still happen."""
        try:
            call()
        except (Exception, VerbHung):
            self.context.publish(ERROR_TOPIC, {"node": self.name, "what": what, "traceback": traceback.format_exc()})

    def report(self) -> None:
        """Count a new match of the scan; log pose and state twice a second."""
        context, estimate = self.context, self.context.localiser.estimate()
        if estimate.stamp_s != self._matched_s:
            self._matched_s = estimate.stamp_s
            context.work.count("scan_matches")
        if context.clock.now() >= self._pose_due_s - _EPSILON_S:
            self._pose_due_s += POSE_PERIOD_S
            self._publish_pose(estimate)
            self._publish_state(estimate)
            self._publish_navigation()

    def _publish_pose(self, estimate: LocalisationEstimate) -> None:
        X_WB = self.context.X_WB()
        p, q = X_WB.translation(), X_WB.rotation().ToQuaternion()
        flat = Pose2D.from_transform(X_WB)
        self.context.publish(
            POSE,
            {
                "timestamp": stamp(self.context.clock.now()),
                "frame_id": "world",
                "robot": self.name,
                "pose": {
                    "position": {"x": p[0], "y": p[1], "z": p[2]},
                    "orientation": {"x": q.x(), "y": q.y(), "z": q.z(), "w": q.w()},
                },
                "yaw_rad": flat.yaw_rad,
                "covariance": estimate.covariance.ravel().tolist(),
            },
        )

    def _publish_state(self, estimate: LocalisationEstimate) -> None:
        """What an operator looks at: the gripper, the battery, the speed, and how well the place is known."""
        robot = self.context.robot
        self.context.publish(
            STATE,
            {
                "robot": self.name,
                "holding": robot.gripper().holding,
                "charge": round(robot.battery().charge, 4),
                "speed_m_s": round(math.hypot(*robot.odometry().velocity[:2]), 3),
                "localised": estimate.localised,
                "localisation_health": round(estimate.health, 3),
                "position_sigma_m": round(math.sqrt(estimate.covariance[0, 0] + estimate.covariance[1, 1]), 4),
            },
        )

    def _publish_navigation(self) -> None:
        """Where else the robot may be, and what it sees that the map does not have (m); when either is new."""
        localiser, costmap = self.context.localiser, self.context.costmap
        particles = localiser.particles_W(MOST_PARTICLES) if isinstance(localiser, ParticleView) else _NOTHING
        seen = costmap.seen_m() if isinstance(costmap, LayeredView) else _NOTHING
        columns = np.round(np.concatenate([particles[:, :2].T, seen.T], axis=1), 2)
        (x, y), count = columns.tolist(), len(particles)
        new = {"particle_x": x[:count], "particle_y": y[:count], "seen_x": x[count:], "seen_y": y[count:]}
        if new != self._navigation:
            self._navigation = new
            self.context.publish(NAVIGATION, {"robot": self.name, **new})


def _time_of_day_s() -> float:
    """The time of day on this machine (s after midnight)."""
    now = time.localtime()
    return 3600.0 * now.tm_hour + 60.0 * now.tm_min + now.tm_sec
