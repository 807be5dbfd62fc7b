"""Motion along the waypoints of a map: turns to the next one, drives to it, and stops in front of obstacles."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np
from bosdyn.api.basic_command_pb2 import SE2TrajectoryCommand
from bosdyn.api.graph_nav import graph_nav_pb2
from bosdyn.api.spot import robot_command_pb2
from pydrake.math import RigidTransform

from errand_spot.messages import pose
from errand_spot.server.computer import Computer
from errand_spot.server.graph_map import GraphMap, Poses
from errand_spot.server.mobility import drive, error_to, speed_limit
from errand_spot.server.obstacles import Clearance
from skills.robot import FloatArray, Pose2D

Feedback = graph_nav_pb2.NavigationFeedbackResponse
_NEXT_M: Final = 0.25
"""Distance from a waypoint at which the robot goes on to the next one."""
_NEAR_M, _NEAR_RAD, _LEAST_M, _LEAST_RAD = 0.06, 0.06, 0.03, 0.04
"""Usual and least tolerances of distance and turn at the goal."""
_GAIN_1_S, _TURN_FIRST_RAD = 1.5, 0.5
_STILL, _MOVED = 0.03, 0.05
"""Largest velocity (m/s, rad/s) of a standing robot, and the least motion (m plus rad) that counts."""
STUCK_S: Final = 5.0


@dataclass(frozen=True)
class Place:
    """Robot on the map: pose X_SO of `odom`, poses of all waypoints, its own waypoint, and whether it is lost."""

    X_SO: RigidTransform
    poses: Poses
    waypoint: str
    lost: bool = False

    def pose(self, X_OB: RigidTransform) -> Pose2D:
        """Planar pose of the body in frame S."""
        return Pose2D.from_transform(self.X_SO @ X_OB)


@dataclass(frozen=True)
class Course:
    """Waypoints to drive along, their poses in frame S with the goal as the last, and the goal's tolerances.

    `poses` are those of the whole map, `limit` limits velocities (3,).
    """

    waypoints: Sequence[str]
    stops: Sequence[Pose2D]
    poses: Poses
    near_m: float
    near_rad: float
    limit: Callable[[FloatArray], FloatArray]
    wait_s: float = STUCK_S

    @staticmethod
    def of(waypoints: Sequence[str], goal: Pose2D, poses: Poses, params: Any) -> Course:
        """Returns the course by travel parameters. Raises InvalidRequestError for limits of velocity that reverse."""
        near_m, near_rad = params.max_distance, params.max_yaw
        wait_s = params.blocked_path_wait_time.ToNanoseconds() * 1e-9
        return Course(
            waypoints,
            [*(Pose2D.from_transform(poses[name]) for name in waypoints[:-1]), goal],
            poses,
            max(near_m, _LEAST_M) if near_m else _NEAR_M,
            math.inf if params.ignore_final_yaw else max(near_rad, _LEAST_RAD) if near_rad else _NEAR_RAD,
            speed_limit(robot_command_pb2.MobilityParams(vel_limit=params.velocity_limit)),
            wait_s or STUCK_S,
        )


class FollowRoute:
    """Drives along a course until its end time, which a client may extend by setting `end_s` (robot time)."""

    _ready: Callable[[], bool]

    def __init__(
        self, course: Course, end_s: float, graph: GraphMap, place: Callable[[], Place | None], cause: Callable[[], int]
    ) -> None:
        """`place` returns the robot's place on the map, `cause` the status of an interrupted motion."""
        self.course, self.end_s = course, end_s
        self._graph, self._place, self._cause = graph, place, cause
        self.status: int = Feedback.STATUS_FOLLOWING_ROUTE
        self._clearance = Clearance(robot_command_pb2.ObstacleParams())
        self._next, self._blocked, self._ko_tform_goal = 0, False, RigidTransform()
        self._stands = False
        self._moved_s, self._moved_from = -math.inf, Pose2D(math.inf, 0.0, 0.0)

    def begin(self, computer: Computer) -> None:
        """Stands up if the robot sits, and starts to drive."""
        self._ready = computer.stand_first()
        self.tick(computer)

    def tick(self, computer: Computer) -> None:
        """Drives on after a step."""
        place = self._place()
        if self.status != Feedback.STATUS_FOLLOWING_ROUTE:
            return
        if computer.now_s() >= self.end_s:
            self.status = Feedback.STATUS_COMMAND_TIMED_OUT
        elif place is None or place.poses is not self.course.poses:
            self.status = Feedback.STATUS_NO_LOCALIZATION
        elif place.lost:
            self.status = Feedback.STATUS_LOST
        elif self._stands or self._ready():
            self._stands = True
            self._drive(computer, place)
        if self.status != Feedback.STATUS_FOLLOWING_ROUTE:
            drive(computer, np.zeros(3), math.inf)

    def end(self, _status: int) -> None:
        """Ends it for another command, a lost lease, or after the motors are switched off."""
        if self.status == Feedback.STATUS_FOLLOWING_ROUTE:
            self.status = self._cause()

    def _drive(self, computer: Computer, place: Place) -> None:
        odometry = computer.snapshot.odometry
        here, stops = place.pose(odometry.X_OB), self.course.stops
        self._ko_tform_goal = place.X_SO.inverse() @ stops[-1].transform()
        while self._next < len(stops) - 1 and _passed(here, stops[self._next], stops[self._next + 1]):
            self._next += 1
        error, last = error_to(here, stops[self._next]), self._next == len(stops) - 1
        far_m, still = math.hypot(error[0], error[1]), float(np.abs(odometry.velocity).max()) < _STILL
        if last and far_m < self.course.near_m and abs(error[2]) < self.course.near_rad:
            drive(computer, np.zeros(3), math.inf)
            self.status = Feedback.STATUS_REACHED_GOAL if still else self.status
            return
        velocity = self.course.limit(_velocity(error, last=last))
        cleared = self._clearance.limit(computer, velocity)
        self._blocked = bool(np.any(velocity) and not np.any(cleared))
        drive(computer, cleared, self.end_s)
        moved = error_to(self._moved_from, here)
        if not math.hypot(moved[0], moved[1]) + abs(moved[2]) < _MOVED:
            self._moved_s, self._moved_from = computer.clock.now(), here
        elif computer.clock.now() - self._moved_s > self.course.wait_s:
            self.status = Feedback.STATUS_STUCK

    def feedback(self, number: int) -> Any:
        """The message of how far the robot has come."""
        made, Movement = Feedback(status=self.status, command_id=number), SE2TrajectoryCommand.Feedback
        going, left = self.status == Feedback.STATUS_FOLLOWING_ROUTE, self.course.waypoints[self._next :]
        made.last_ko_tform_goal.CopyFrom(pose(self._ko_tform_goal))
        made.remaining_route.waypoint_id.extend(left if going else ())
        made.remaining_route.edge_id.extend(self._graph.edge_id(a, b) for a, b in pairwise(left) if going)
        if going:
            steps = pairwise(self.course.stops[self._next :])
            made.remaining_route_length = sum(math.hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in steps)
        made.body_movement_status = Movement.BODY_STATUS_MOVING if going else Movement.BODY_STATUS_SETTLED
        reached = self.status == Feedback.STATUS_REACHED_GOAL
        made.goal_status = Feedback.GOAL_STATUS_STANDING_AT_GOAL if reached else Feedback.GOAL_STATUS_NOT_REACHED
        made.blockage_status = Feedback.BLOCKAGE_STATUS_ROUTE_CLEAR
        if going and self._blocked:
            made.blockage_status = Feedback.BLOCKAGE_STATUS_ROUTE_BLOCKED_TEMPORARILY
        if self.status == Feedback.STATUS_STUCK:
            made.blockage_status, made.stuck_reason = Feedback.BLOCKAGE_STATUS_STUCK, Feedback.STUCK_REASON_OBSTACLE
        return made


def _passed(here: Pose2D, stop: Pose2D, following: Pose2D) -> bool:
    """Returns whether the robot is at a stop, or on the straight line from it to the following one."""
    beyond = np.array([here.x_m - stop.x_m, here.y_m - stop.y_m])
    ahead = np.array([following.x_m - stop.x_m, following.y_m - stop.y_m])
    aside_m = abs(beyond @ [-ahead[1], ahead[0]]) / max(float(np.linalg.norm(ahead)), 1e-6)
    return bool(np.linalg.norm(beyond) < _NEXT_M or (beyond @ ahead > 0.0 and aside_m < _NEXT_M))


def _velocity(error: FloatArray, *, last: bool) -> FloatArray:
    """Velocity (3,) towards a stop at `error` in the body frame: first turns to it, then drives."""
    far_m, bearing_rad = math.hypot(error[0], error[1]), math.atan2(error[1], error[0])
    if last and far_m < _NEXT_M:
        return np.asarray(_GAIN_1_S * error)
    speed = min(_GAIN_1_S * far_m if last else math.inf, 1.0) * max(0.0, 1.0 - abs(bearing_rad) / _TURN_FIRST_RAD)
    return np.array([speed, 0.0, 2.0 * bearing_rad])
