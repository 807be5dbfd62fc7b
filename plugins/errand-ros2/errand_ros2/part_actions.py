"""Actions by which clients move arm, head and gripper of a robot: of a served one, and of one that has a mission."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np

from errand_ros2 import messages
from errand_ros2.messages import Fields
from errand_ros2.readings import age_s
from errand_ros2.wire.actions import ActionServer, Goal, GoalStatus
from errand_ros2.wire.node import Node
from executive.run.worker import WorkQueue
from skills.robot import ArmTrajectory, Clock, CommandCause, CommandId, CommandState, CommandStatus, Lease, Robot

_LOG: Final = logging.getLogger(__name__)
TRAJECTORY, GRIPPER = (f"control_msgs/action/{each}" for each in ("FollowJointTrajectory", "GripperCommand"))
ARM_ACTION, HEAD_ACTION = (f"{part}_controller/follow_joint_trajectory" for part in ("arm", "head"))
GRIPPER_ACTION: Final = "gripper_controller/gripper_cmd"
INVALID_GOAL, PATH_VIOLATED = -1, -4
FEEDBACK_PERIOD_S, _EPSILON_S = 0.1, 1e-6
_EXTRA_S, MOST_S = 5.0, 120.0  # time that a trajectory may take longer, and the most that a gripper or posture takes
_SHORT: Final = 0.03  # share of the gripper's opening, short of which it has stalled


class PartActions:
    """Serves the actions. The thread that owns the robot does the `work` and calls `follow` after each step."""

    def __init__(self, node: Node, robot: Robot, clock: Clock, lease: Callable[[], Lease]) -> None:
        """`lease` returns that under which the robot is moved."""
        self._node, self._robot, self._clock, self._lease = node, robot, clock, lease
        self.work, can = WorkQueue(), robot.capabilities()
        self._goals: list[tuple[ActionServer, Goal, CommandId]] = []  # under way, with their commands
        self.ended, self._due_s = 0, -math.inf  # number of the goals ended; time of the next feedback
        if can.arm is not None:
            self._serve(ARM_ACTION, TRAJECTORY, partial(self._follow, can.arm.joint_names, robot.move_arm))
        if can.head is not None:
            self._serve(HEAD_ACTION, TRAJECTORY, partial(self._follow, can.head.joint_names, self._point_head))
        if can.gripper is not None:
            self._short, self._share = _SHORT * can.gripper.widest, can.gripper.finger_joints[0][1]
            self._serve(GRIPPER_ACTION, GRIPPER, self._grip)

    @property
    def is_busy(self) -> bool:
        """Returns whether a request waits, or a goal is under way."""
        return bool(self._goals) or not self.work.is_empty

    def follow(self) -> None:
        """Ends the goals whose commands have ended, and tells of the others how far they are."""
        now_s = self._clock.now()
        is_due = now_s >= self._due_s - _EPSILON_S
        for server, goal, command in list(self._goals):
            if goal.status is GoalStatus.ACCEPTED:
                server.set_status(goal, GoalStatus.EXECUTING)
            status = self._robot.command_status(command)
            if status.state is not CommandState.RUNNING:
                self._goals.remove((server, goal, command))
                self._end(server, goal, status)
            elif is_due:
                self._due_s = now_s + FEEDBACK_PERIOD_S
                server.tell(goal, **self._feedback(server, goal))

    def _feedback(self, server: ActionServer, goal: Goal) -> Fields:
        """Fields of the feedback on a goal: where the joints are, or the gripper."""
        if server.kind == GRIPPER:
            reading = self._robot.gripper()
            return {"position": self._share * reading.opening, "effort": reading.force_n}
        names, joints = goal.message.trajectory.joint_names, self._robot.joints()
        at = {"positions": [joints.position_rad[name] for name in names]}
        return {"header": messages.header(joints.stamp_s), "joint_names": names, "actual": at}

    def end(self) -> None:
        """Ends all goals, because the robot's mission has ended."""
        for server, goal, _ in self._goals:
            server.end(goal, GoalStatus.ABORTED)
        self._goals = []

    def _serve(self, name: str, kind: str, begin: Callable[[Any], CommandId]) -> None:
        """Serves an action; `begin` begins the motion of a goal, and raises ValueError for a goal that is none."""

        def accept(goal: Goal) -> bool:
            try:
                command = begin(goal.message)
                if (status := self._robot.command_status(command)).state is CommandState.REFUSED:
                    raise ValueError(status.reason)
            except ValueError as error:
                _LOG.warning("errand: a goal of %s is refused: %s", name, error)
                return False
            self._goals.append((server, goal, command))
            return True

        cancel = partial(self.work.submit, self._cancel)
        server = ActionServer(self._node, name, kind, accept=accept, cancel=cancel, pool=self.work)

    def _cancel(self, goal: Goal) -> None:
        for _, each, command in self._goals:
            if each is goal:
                self._robot.stop(lease=self._lease(), only=command)

    def _follow(self, names: tuple[str, ...], move: Callable[..., CommandId], goal: Any) -> CommandId:
        """Begins a trajectory of these joints by a verb of the robot."""
        trajectory = trajectory_of(goal.trajectory, names, age_s(goal.trajectory.header, self._clock.now()))
        if trajectory.times_s[0] > 0.0:  # it leads on from where the joints are
            here_rad = [self._robot.joints().position_rad[name] for name in names]
            way_rad = np.vstack([here_rad, trajectory.positions_rad])
            trajectory = ArmTrajectory(np.append(0.0, trajectory.times_s), way_rad)
        until_s = self._clock.now() + float(trajectory.times_s[-1]) + _EXTRA_S
        return move(trajectory, until_s=until_s, lease=self._lease())

    def _point_head(self, trajectory: ArmTrajectory, **until: Any) -> CommandId:
        return self._robot.point_head(*trajectory.positions_rad[-1].tolist(), **until)

    def _grip(self, goal: Any) -> CommandId:
        command, can, until_s = goal.command, self._robot.capabilities().gripper, self._clock.now() + MOST_S
        if can is None or not math.isfinite(command.position + command.max_effort):
            raise ValueError("the opening or the force is not finite")
        force_n, share = command.max_effort if command.max_effort > 0.0 else can.max_force_n, self._share
        return self._robot.set_gripper(command.position / share, force_n, until_s=until_s, lease=self._lease())

    def _end(self, server: ActionServer, goal: Goal, status: CommandStatus) -> None:
        done = status.state is CommandState.DONE
        if server.kind == TRAJECTORY:
            code = 0 if done else INVALID_GOAL if status.cause is CommandCause.INVALID else PATH_VIOLATED
            result = {"error_code": code, "error_string": status.reason}
        else:
            reading, wanted = self._robot.gripper(), goal.message.command.position / self._share
            stalled = done and abs(reading.opening - wanted) > self._short
            ends = {"stalled": stalled, "reached_goal": done and not stalled}
            result = {"position": self._share * reading.opening, "effort": reading.force_n, **ends}
        cancelled = goal.status is GoalStatus.CANCELING
        final = GoalStatus.SUCCEEDED if done else GoalStatus.CANCELED if cancelled else GoalStatus.ABORTED
        server.end(goal, final, **result)
        self.ended += 1


def trajectory_of(message: Any, names: tuple[str, ...], begun_s: float = 0.0) -> ArmTrajectory:
    """Reads what is left of a trajectory that began some time (s) ago. Raises ValueError if it moves other joints."""
    order = {name: number for number, name in enumerate(message.joint_names)}
    if order.keys() != {*names} or len(message.joint_names) != len(names):
        raise ValueError(f"the trajectory moves {', '.join(message.joint_names)}, not {', '.join(names)}")
    if not message.points or any(len(point.positions) != len(names) for point in message.points):
        raise ValueError("the trajectory has no points, or one without a position of each joint")
    times = np.array([point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in message.points])
    if begun_s > times[-1]:
        raise ValueError(f"the trajectory's stamp is {begun_s:.1f} s old, and its end has passed")
    positions = np.array([point.positions for point in message.points])[:, [order[name] for name in names]]
    left = times >= begun_s
    times, positions = times[left] - begun_s, positions[left]
    if not 0.0 <= times[0] <= times[-1] <= MOST_S or not math.isfinite(float(positions.sum())):
        raise ValueError(f"the trajectory does not lie within {MOST_S:g} s")
    return ArmTrajectory(times, positions)
