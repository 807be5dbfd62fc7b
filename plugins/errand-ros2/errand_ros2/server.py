"""A simulated robot as a robot of ROS 2: its topics, `/clock`, `cmd_vel` with a watchdog, arm and gripper.

It does not navigate.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from threading import Event
from typing import Any, Final

from pydrake.math import RigidTransform

from errand_ros2 import messages
from errand_ros2.inputs import LIFE_S, TOPIC, HeardVelocity
from errand_ros2.robot_topics import IMAGE_PERIOD_S, Frames, RobotTopics
from errand_ros2.served_motions import ServedMotions, WorkQueue
from errand_ros2.wire.keys import LATCHED
from errand_ros2.wire.node import Node
from errand_ros2.wire.session import Session
from executive.record.other_tools import ros_name
from skills.estimate.grid_map import GridMap
from skills.robot import Clock, CommandId, Robot

PERIOD_S: Final = 0.05
_EXPIRY_S: Final = 0.1
_HOLDER: Final = "the server of ROS 2"
_NODE: Final = "robot"
_LATE_S: Final = 0.5
WHOLE: Final = 1 << 16
"""Columns of pictures that are not reduced."""

Truth = Callable[[], RigidTransform]
"""Function that returns the robot's true pose in the world."""


@dataclass(frozen=True)
class Served:
    """Options of a server: further topics, and its times.

    `grid` is published as `/map`, and `truth` under `/ground_truth`. `life` is the clock (s) by which velocities die.
    """

    grid: GridMap | None = None
    truth: Truth | None = None
    life: Callable[[], float] = time.monotonic
    image_period_s: float = IMAGE_PERIOD_S


class RobotServer:
    """Serves one robot. Call `step` once a period, or `run`; both step the robot's clock.

    The thread that does so owns the robot; `work` is what it does between the steps.
    """

    def __init__(self, session: Session, robot: Robot, clock: Clock, served: Served | None = None) -> None:
        """Takes the robot's lease."""
        served = served or Served()
        self._robot, self._clock, self._truth, self._life = robot, clock, served.truth, served.life
        self._lease = robot.acquire_lease(_HOLDER)
        space = f"/{ros_name(robot.name)}"
        self._top, self._node = Node(session, _NODE), Node(session, _NODE, space)
        self._time = self._top.publisher("/clock", "rosgraph_msgs/msg/Clock")
        if (grid := served.grid) is not None:
            self._map = self._top.publisher("/map", "nav_msgs/msg/OccupancyGrid", LATCHED)
            self._map.put(messages.occupancy_grid(grid))
        if served.truth is not None:
            self._true = self._top.publisher(f"/ground_truth{space}/pose", "geometry_msgs/msg/PoseStamped")
        self._frames, period_s = Frames(self._top), served.image_period_s
        self.topics = RobotTopics(self._node, robot, self._frames, most_columns=WHOLE, image_period_s=period_s)
        self.work = WorkQueue()
        self.motions = ServedMotions(self._node, robot, clock, self._lease, self.work)
        self.heard = 0
        """Number of the velocities heard."""
        self._node.subscribe(TOPIC, "geometry_msgs/msg/Twist", self._hear)
        self._velocity = HeardVelocity(served.life)
        self._driving: CommandId | None = None
        self.late_s = 0.0
        """Longest delay behind the wall clock (s)."""

    def _hear(self, twist: Any) -> None:
        self._velocity.hear(twist)
        self.heard += 1

    def step(self) -> None:
        """Commands the base, steps the clock by one period, and publishes the readings."""
        (vx, vy, wz), at_s = self._velocity.last
        if self._life() - at_s <= LIFE_S:
            abilities, until_s = self._robot.capabilities(), self._clock.now() + _EXPIRY_S
            share = min(1.0, abilities.max_speed_m_s / max(math.hypot(vx, vy), 1e-9))
            turn = max(-abilities.max_turn_rate_rad_s, min(abilities.max_turn_rate_rad_s, wz))
            self._driving = self._robot.drive(share * vx, share * vy, turn, until_s=until_s, lease=self._lease)
        elif self._driving is not None:
            self._robot.stop(lease=self._lease, only=self._driving)
            self._driving = None
        self._clock.advance(PERIOD_S)
        self.motions.tick()
        now_s = self._clock.now()
        self._time.put({"clock": messages.time_of(now_s)})
        self.topics.publish(now_s, None)
        if self._truth is not None:
            self._true.put(messages.pose_stamped(now_s, messages.MAP_FRAME, self._truth()))

    def show(self) -> None:
        """Publishes the pictures that are due, without a step."""
        if moved := self.topics.publish_pictures(self._clock.now()):
            self._frames.move(moved)

    def run(self, ended: Event, limit_s: float | None = None) -> None:
        """Steps the robot at the pace of the wall clock, until `ended` or a time (s, robot's clock)."""
        begun_s, begun_wall_s = self._clock.now(), time.monotonic()
        until_s = math.inf if limit_s is None else begun_s + limit_s
        while not ended.is_set() and self._clock.now() < until_s:
            self.step()
            ahead_s = self._clock.now() - begun_s - (time.monotonic() - begun_wall_s)
            self.late_s = max(self.late_s, -ahead_s)
            if ahead_s > 0.0:
                self.work.work_for(ahead_s)
                continue
            self.work.work_for(0.0)
            if ahead_s < -_LATE_S:
                begun_s, begun_wall_s = self._clock.now(), time.monotonic()

    def close(self) -> None:
        """Stops the robot and returns its lease."""
        self._robot.stop(lease=self._lease)
        self._robot.return_lease(self._lease)
