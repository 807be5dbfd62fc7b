"""A simulated robot of ROS 2, which does not navigate: topics, `cmd_vel` with a watchdog, actions of its parts."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from threading import Event
from typing import Any, Final

from pydrake.math import RigidTransform, RollPitchYaw

from errand_ros2 import messages
from errand_ros2.part_actions import MOST_S, PartActions
from errand_ros2.readings import LIFE_S, HeardVelocity, transform_of, within_limits
from errand_ros2.robot_topics import Frames, RobotTopics
from errand_ros2.wire.node import Session
from errand_ros2.wire.types import LATCHED
from executive.record.other_tools import ros_name
from skills.grid_map import GridMap
from skills.inputs.errors import InputError
from skills.robot import Clock, CommandId, Robot

POSTURE, CARRY = "body_pose", "gripper/carry"
PERIOD_S, _EXPIRY_S, _LATE_S = 0.05, 0.1, 0.5
_WHOLE: Final = 1 << 16  # columns of pictures that are not reduced


class RobotServer:
    """Serves one robot. The thread that calls `step` or `run` owns it, and does its `work` between the steps."""

    def __init__(
        self,
        session: Session,
        robot: Robot,
        clock: Clock,
        *,
        grid: GridMap | None = None,
        truth: Callable[[], RigidTransform] | None = None,
        life: Callable[[], float] = time.monotonic,
    ) -> None:
        """Takes the robot's lease. Publishes `grid` and the true pose, too; velocities die by the clock `life` (s)."""
        self._robot, self._clock, self._truth, self._life = robot, clock, truth, life
        self._lease = robot.acquire_lease("the server of ROS 2")
        space = f"/{ros_name(robot.name)}"
        top, self.node = session.node("robot"), session.node("robot", space)
        top.claim("/clock", f"{space}/odom")
        self._time = top.publisher("/clock", "rosgraph_msgs/msg/Clock")
        if grid is not None:
            top.publisher("/map", "nav_msgs/msg/OccupancyGrid", LATCHED).put(messages.occupancy_grid(grid))
        if truth is not None:
            self._true = top.publisher(f"/ground_truth{space}/pose", "geometry_msgs/msg/PoseStamped")
        self.topics = RobotTopics(self.node, robot, Frames(top), _WHOLE)
        self.parts = PartActions(self.node, robot, clock, lambda: self._lease)
        self.work = self.parts.work
        self._velocity = HeardVelocity(life)
        self._velocity.listen(self.node, clock.now)
        self._driving: CommandId | None = None
        if (can := robot.capabilities()).gripper is not None:
            carry = partial(robot.carry, lease=self._lease)
            self.node.subscribe(CARRY, "std_msgs/msg/Bool", lambda told: self.work.submit(carry, told.data))
        self._height_m = can.standing_height_m
        self.node.subscribe(POSTURE, "geometry_msgs/msg/Pose", partial(self.work.submit, self._stand))

    def step(self) -> None:
        """Commands the base, steps the clock by one period, and publishes the readings."""
        asked, at_s = self._velocity.last
        if self._life() - at_s <= LIFE_S:
            until_s, velocity = self._clock.now() + _EXPIRY_S, within_limits(asked, self._robot.capabilities())
            self._driving = self._robot.drive(*velocity, until_s=until_s, lease=self._lease)
        elif self._driving is not None:
            self._robot.stop(lease=self._lease, only=self._driving)
            self._driving = None
        self._clock.advance(PERIOD_S)
        self.parts.follow()
        now_s = self._clock.now()
        self._time.put({"clock": messages.time_of(now_s)})
        self.topics.publish(now_s, None)
        if self._truth is not None:
            self._true.put(messages.pose_stamped(now_s, messages.MAP_FRAME, self._truth()))

    def run(self, ended: Event, limit_s: float | None = None) -> None:
        """Steps the robot at the pace of the wall clock, until `ended` or a time (s, robot's clock)."""
        begun_s, begun_wall_s = self._clock.now(), time.monotonic()
        until_s = math.inf if limit_s is None else begun_s + limit_s
        while not ended.is_set() and self._clock.now() < until_s:
            self.step()
            ahead_s = self._clock.now() - begun_s - (time.monotonic() - begun_wall_s)
            self.work.work_for(max(0.0, ahead_s))
            if ahead_s < -_LATE_S:
                begun_s, begun_wall_s = self._clock.now(), time.monotonic()

    def close(self) -> None:
        """Stops the robot and returns its lease."""
        self._robot.stop(lease=self._lease)
        self._robot.return_lease(self._lease)

    def _stand(self, pose: Any) -> None:
        """Takes a height over the usual one and a pitch; what is not finite or no rotation is ignored."""
        with suppress(InputError):
            X, until_s = transform_of(pose.position, pose.orientation), self._clock.now() + MOST_S
            height_m, pitch_rad = self._height_m + float(X.translation()[2]), RollPitchYaw(X.rotation()).pitch_angle()
            self._robot.stand(height_m, pitch_rad, until_s=until_s, lease=self._lease)
