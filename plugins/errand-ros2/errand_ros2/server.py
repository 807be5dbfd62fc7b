"""A simulated robot of ROS 2, which does not navigate: topics, `cmd_vel` with a watchdog, actions of its parts."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future
from contextlib import suppress
from functools import partial
from queue import Empty, SimpleQueue
from threading import Event
from typing import Any, Final

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from errand_ros2 import messages
from errand_ros2.readings import LIFE_S, TOPIC, HeardVelocity, transform_of, within_limits
from errand_ros2.robot_topics import Frames, RobotTopics
from errand_ros2.wire.actions import ActionServer, Goal, GoalStatus
from errand_ros2.wire.node import Node, Session
from errand_ros2.wire.types import LATCHED
from executive.record.other_tools import ros_name
from skills.estimate.grid_map import GridMap
from skills.inputs.errors import InputError
from skills.robot import ArmTrajectory, Capabilities, Clock, CommandCause, CommandId, CommandState, CommandStatus, Robot

PERIOD_S: Final = 0.05
TRAJECTORY: Final = "control_msgs/action/FollowJointTrajectory"
GRIPPER: Final = "control_msgs/action/GripperCommand"
ARM_ACTION: Final = "arm_controller/follow_joint_trajectory"
HEAD_ACTION: Final = "head_controller/follow_joint_trajectory"
GRIPPER_ACTION: Final = "gripper_controller/gripper_cmd"
POSTURE, CARRY = "body_pose", "gripper/carry"
INVALID_GOAL, PATH_VIOLATED = -1, -4
_EXPIRY_S: Final = 0.1
_LATE_S: Final = 0.5
_WHOLE: Final = 1 << 16  # columns of pictures that are not reduced
_EXTRA_S, _MOST_S = 5.0, 120.0  # time that a trajectory may take longer, and the most that a gripper or posture takes
_MOST_WORK: Final = 1000  # most work that is done between two steps
_OBJECT: Final = 0.02  # share of the gripper's opening by which an object keeps it open


class WorkQueue(Executor):
    """Executor whose work is done by the thread that owns the robot, between its steps."""

    def __init__(self) -> None:
        self._given: SimpleQueue[Callable[[], None]] = SimpleQueue()

    def submit(self, work: Callable[..., Any], /, *args: Any, **options: Any) -> Future[Any]:
        """Hands work over; the future has its result."""
        future: Future[Any] = Future()

        def done() -> None:
            try:
                future.set_result(work(*args, **options))
            except Exception as error:
                future.set_exception(error)

        self._given.put(done)
        return future

    def work_for(self, limit_s: float) -> None:
        """Does what was handed over, and what comes within a time (s, wall clock)."""
        until_s = time.monotonic() + limit_s
        for _ in range(_MOST_WORK):
            try:
                self._given.get(timeout=max(0.0, until_s - time.monotonic()))()
            except Empty:
                return


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
        top, self.node = Node(session, "robot"), Node(session, "robot", space)
        self._time = top.publisher("/clock", "rosgraph_msgs/msg/Clock")
        if grid is not None:
            top.publisher("/map", "nav_msgs/msg/OccupancyGrid", LATCHED).put(messages.occupancy_grid(grid))
        if truth is not None:
            self._true = top.publisher(f"/ground_truth{space}/pose", "geometry_msgs/msg/PoseStamped")
        self.topics = RobotTopics(self.node, robot, Frames(top), _WHOLE)
        self.work = WorkQueue()
        self._velocity = HeardVelocity(life)
        self.node.subscribe(TOPIC, "geometry_msgs/msg/Twist", self._velocity.hear)
        self._driving: CommandId | None = None
        self._goals: list[tuple[ActionServer, Goal, CommandId]] = []  # under way, with their commands
        self.ended = 0  # number of the goals ended
        self._serve_parts(robot.capabilities())

    def _serve_parts(self, can: Capabilities) -> None:
        if can.arm is not None:
            move_arm = partial(self._follow, can.arm.joint_names, self._robot.move_arm)
            self._serve(ARM_ACTION, TRAJECTORY, move_arm)
        if can.head is not None:
            self._serve(HEAD_ACTION, TRAJECTORY, partial(self._follow, can.head.joint_names, self._point_head))
        if can.gripper is not None:
            self._serve(GRIPPER_ACTION, GRIPPER, self._grip)
            carry = partial(self._robot.carry, lease=self._lease)
            self.node.subscribe(CARRY, "std_msgs/msg/Bool", lambda told: self.work.submit(carry, told.data))
        self._height_m, self._thin = can.standing_height_m, _OBJECT * (can.gripper.widest if can.gripper else 1.0)
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
        self._follow_goals()
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

    def _serve(self, name: str, kind: str, begin: Callable[[Any], CommandId]) -> None:
        """Serves an action; `begin` begins the motion of a goal, and raises ValueError for a goal that is none."""

        def accept(goal: Goal) -> bool:
            try:
                command = begin(goal.message)
            except ValueError:
                return False
            if self._robot.command_status(command).state is CommandState.REFUSED:
                return False
            self._goals.append((server, goal, command))
            return True

        cancel = partial(self.work.submit, self._cancel)
        server = ActionServer(self.node, name, kind, accept=accept, cancel=cancel, pool=self.work)

    def _cancel(self, goal: Goal) -> None:
        for _, each, command in self._goals:
            if each is goal:
                self._robot.stop(lease=self._lease, only=command)

    def _follow(self, names: tuple[str, ...], move: Callable[..., CommandId], goal: Any) -> CommandId:
        """Begins a trajectory of these joints by a verb of the robot."""
        trajectory = trajectory_of(goal.trajectory, names)
        until_s = self._clock.now() + float(trajectory.times_s[-1]) + _EXTRA_S
        return move(trajectory, until_s=until_s, lease=self._lease)

    def _point_head(self, trajectory: ArmTrajectory, **until: Any) -> CommandId:
        return self._robot.point_head(*trajectory.positions_rad[-1].tolist(), **until)

    def _grip(self, goal: Any) -> CommandId:
        command, can, until_s = goal.command, self._robot.capabilities().gripper, self._clock.now() + _MOST_S
        if can is None or not math.isfinite(command.position + command.max_effort):
            raise ValueError("the opening or the force is not finite")
        force_n = command.max_effort if command.max_effort > 0.0 else can.max_force_n
        return self._robot.set_gripper(command.position, force_n, until_s=until_s, lease=self._lease)

    def _stand(self, pose: Any) -> None:
        """Takes a height over the usual one and a pitch; what is not finite or no rotation is ignored."""
        with suppress(InputError):
            X, until_s = transform_of(pose.position, pose.orientation), self._clock.now() + _MOST_S
            height_m, pitch_rad = self._height_m + float(X.translation()[2]), RollPitchYaw(X.rotation()).pitch_angle()
            self._robot.stand(height_m, pitch_rad, until_s=until_s, lease=self._lease)

    def _follow_goals(self) -> None:
        """Ends the goals whose commands have ended."""
        for server, goal, command in list(self._goals):
            if goal.status is GoalStatus.ACCEPTED:
                server.begin(goal)
            status = self._robot.command_status(command)
            if status.state is not CommandState.RUNNING:
                self._goals.remove((server, goal, command))
                self._end(server, goal, status)

    def _end(self, server: ActionServer, goal: Goal, status: CommandStatus) -> None:
        done = status.state is CommandState.DONE
        if server.kind.name == TRAJECTORY:
            code = 0 if done else INVALID_GOAL if status.cause is CommandCause.INVALID else PATH_VIOLATED
            result = {"error_code": code, "error_string": status.reason}
        else:
            reading, wanted = self._robot.gripper(), goal.message.command.position
            stalled = done and reading.opening - wanted > self._thin
            ends = {"stalled": stalled, "reached_goal": done and not stalled}
            result = {"position": reading.opening, "effort": reading.force_n, **ends}
        cancelled = goal.status is GoalStatus.CANCELING
        final = GoalStatus.SUCCEEDED if done else GoalStatus.CANCELED if cancelled else GoalStatus.ABORTED
        server.end(goal, final, **result)
        self.ended += 1


def trajectory_of(message: Any, names: tuple[str, ...]) -> ArmTrajectory:
    """Reads trajectory_msgs/JointTrajectory, which begins now. Raises ValueError unless it moves just these joints."""
    order = {name: number for number, name in enumerate(message.joint_names)}
    if order.keys() != {*names} or len(message.joint_names) != len(names):
        raise ValueError(f"the trajectory moves {', '.join(message.joint_names)}, not {', '.join(names)}")
    if not message.points or any(len(point.positions) != len(names) for point in message.points):
        raise ValueError("the trajectory has no points, or one without a position of each joint")
    times = np.array([point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in message.points])
    positions = np.array([point.positions for point in message.points])[:, [order[name] for name in names]]
    if not 0.0 <= times[0] <= times[-1] <= _MOST_S or not math.isfinite(float(positions.sum())):
        raise ValueError(f"the trajectory does not lie within {_MOST_S:g} s")
    return ArmTrajectory(times, positions)
