"""A simulated robot as a robot of ROS 2: its topics, `/clock`, and `cmd_vel` with a watchdog; no navigation."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from threading import Event
from typing import Any, Final

from pydrake.math import RigidTransform

from errand_ros2 import messages
from errand_ros2.driving import TOPIC
from errand_ros2.inputs import velocity
from errand_ros2.robot_topics import Frames, RobotTopics
from errand_ros2.wire.keys import LATCHED
from errand_ros2.wire.node import Node
from errand_ros2.wire.session import Session
from executive.record.other_tools import ros_name
from skills.estimate.grid_map import GridMap
from skills.inputs.errors import InputError
from skills.robot import Clock, Robot

PERIOD_S: Final = 0.05
LIFE_S: Final = 0.2
"""Time (wall clock) after which a velocity no longer counts; then the robot stands."""
_EXPIRY_S: Final = 0.1
_HOLDER: Final = "the server of ROS 2"
_NODE: Final = "robot"
_LATE_S: Final = 0.5

Truth = Callable[[], RigidTransform]
"""Function that returns the robot's true pose in the world."""


class RobotServer:
    """Serves one robot. Call `step` once a period, or `run`; both step the robot's clock."""

    def __init__(
        self, session: Session, robot: Robot, clock: Clock, *, grid: GridMap | None = None, truth: Truth | None = None
    ) -> None:
        """Takes the robot's lease. `grid` is published as `/map`, and `truth` under `/ground_truth`, if given."""
        self._robot, self._clock, self._truth = robot, clock, truth
        self._lease = robot.acquire_lease(_HOLDER)
        space = f"/{ros_name(robot.name)}"
        self._top, self._node = Node(session, _NODE), Node(session, _NODE, space)
        self._time = self._top.publisher("/clock", "rosgraph_msgs/msg/Clock")
        if grid is not None:
            self._map = self._top.publisher("/map", "nav_msgs/msg/OccupancyGrid", LATCHED)
            self._map.put(messages.occupancy_grid(grid))
        if truth is not None:
            self._true = self._top.publisher(f"/ground_truth{space}/pose", "geometry_msgs/msg/PoseStamped")
        self._topics = RobotTopics(self._node, robot, Frames(self._top))
        self._node.subscribe(TOPIC, "geometry_msgs/msg/Twist", self._hear)
        self._asked: tuple[tuple[float, float, float], float] = ((0.0, 0.0, 0.0), -math.inf)
        self._moves = False
        self.late_s = 0.0
        """Longest delay behind the wall clock (s)."""

    def _hear(self, twist: Any) -> None:
        """Takes a velocity within the robot's limits; one that is not finite stops the robot."""
        try:
            vx, vy, wz = velocity(twist)
        except InputError:
            self._asked = ((0.0, 0.0, 0.0), -math.inf)
            return
        abilities = self._robot.capabilities()
        share = min(1.0, abilities.max_speed_m_s / max(math.hypot(vx, vy), 1e-9))
        turn = abilities.max_turn_rate_rad_s
        self._asked = ((share * vx, share * vy, max(-turn, min(turn, wz))), time.monotonic())

    def step(self) -> None:
        """Commands the base, steps the clock by one period, and publishes the readings."""
        asked, at_s = self._asked
        if time.monotonic() - at_s <= LIFE_S:
            self._robot.drive(*asked, until_s=self._clock.now() + _EXPIRY_S, lease=self._lease)
            self._moves = True
        elif self._moves:
            self._robot.stop(lease=self._lease)
            self._moves = False
        self._clock.advance(PERIOD_S)
        now_s = self._clock.now()
        self._time.put(messages.clock(now_s))
        self._topics.publish(now_s, None)
        if self._truth is not None:
            self._true.put(messages.pose_stamped(now_s, messages.MAP_FRAME, self._truth()))

    def run(self, ended: Event, limit_s: float | None = None) -> None:
        """Steps the robot at the pace of the wall clock, until `ended` or a time (s, robot's clock)."""
        begun_s, begun_wall_s = self._clock.now(), time.monotonic()
        until_s = math.inf if limit_s is None else begun_s + limit_s
        while not ended.is_set() and self._clock.now() < until_s:
            self.step()
            ahead_s = self._clock.now() - begun_s - (time.monotonic() - begun_wall_s)
            self.late_s = max(self.late_s, -ahead_s)
            if ahead_s > 0.0:
                ended.wait(ahead_s)
            elif ahead_s < -_LATE_S:
                begun_s, begun_wall_s = self._clock.now(), time.monotonic()

    def close(self) -> None:
        """Stops the robot and returns its lease."""
        self._robot.stop(lease=self._lease)
        self._robot.return_lease(self._lease)
