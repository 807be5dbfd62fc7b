"""A robot of ROS 2 behind the robot protocol. Readings are the latest; commands are followed by `poll`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from errand_ros2 import messages
from errand_ros2.adapter.clocks import RobotClock
from errand_ros2.adapter.description import DRIVE_EXPIRY_S, Description
from errand_ros2.adapter.sensors import OLD_STATE_S, SensedRobot
from errand_ros2.part_actions import GRIPPER, INVALID_GOAL, TRAJECTORY
from errand_ros2.readings import within_limits
from errand_ros2.wire.actions import ActionClient, GoalStatus
from errand_ros2.wire.node import Node
from skills.command_table import CommandTable, LeaseManager, refusal_of
from skills.robot import ArmTrajectory, BaseKind, CommandCause, CommandId, CommandState, Lease

GONE_S, _CALL_S = 15.0, 0.5
_LEAST_POINT_S, _HEAD_RAD_S = 0.2, 1.0
_REACHED_M, _REACHED_RAD = 0.02, 0.03
PARTS = BASE, POSTURE, ARM, HEAD, GRIP = "base", "posture", "arm", "head", "gripper"


class Ros2Robot(SensedRobot):
    """Robot of ROS 2. Implements `skills.robot.Robot`."""

    def __init__(self, name: str, node: Node, clock: RobotClock, description: Description) -> None:
        super().__init__(name, node, clock, description)
        file = description.file
        kind = "TwistStamped" if file.base.stamped else "Twist"
        self._velocity = node.publisher(file.base.command, f"geometry_msgs/msg/{kind}")
        posture, carry = file.base.posture, file.gripper.carry if file.gripper else None
        self._posture = None if posture is None else node.publisher(posture, "geometry_msgs/msg/Pose")
        self._carry = None if carry is None else node.publisher(carry, "std_msgs/msg/Bool")
        given = {ARM: (file.arm, TRAJECTORY), HEAD: (file.head, TRAJECTORY), GRIP: (file.gripper, GRIPPER)}
        self.actions = {
            part: ActionClient(node, each.action, action) for part, (each, action) in given.items() if each is not None
        }
        self._commands, self._unsure = CommandTable[str](), dict[str, Any]()
        self._leases = LeaseManager(name)
        self.command_status, self.acquire_lease = self._commands.status, self._leases.acquire

    def notes(self, address: str, endpoint: str) -> tuple[str, ...]:
        """Returns sentences for the report on what the robot does not tell."""
        file, grip = self._description.file, self._description.file.gripper
        battery = [] if file.battery else ["No topic tells the battery's charge: it counts as full."]
        holding = ["A gripper that stalled counts as holding an object."] if grip and not grip.holding else []
        rings = ["The scan has one ring."] if file.lidar.scan else []
        return (f"Robot of ROS 2 at {address}, by {endpoint}.", *battery, *holding, *rings)

    def drive(self, vx: float, vy: float, wz: float, *, until_s: float, lease: Lease) -> CommandId:
        """Drives at a body-frame velocity until the clock reads `until_s`, at most 0.6 s."""
        can, now_s = self._description.capabilities, self._clock.now()
        if vy != 0.0 and can.base_kind is BaseKind.DIFFERENTIAL:
            return self._commands.refuse("drive: this base cannot go sideways")
        if (refused := self._objection(BASE, lease, until_s, (vx, vy, wz))) is not None:
            return refused
        velocity = within_limits((vx, vy, wz), can)
        self._say(velocity)
        return self._commands.begin(BASE, velocity, now_s, min(until_s, now_s + DRIVE_EXPIRY_S))

    def stand(self, height_m: float, pitch_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Holds the body origin at a height above the floor and a pitch."""
        can = self._description.capabilities
        (low, high), (least, most) = can.height_range_m, can.pitch_range_rad
        if self._posture is None:
            return self._commands.refuse("stand: the posture cannot be set", CommandCause.UNSUPPORTED)
        if (refused := self._objection(POSTURE, lease, until_s, (height_m, pitch_rad))) is not None:
            return refused
        if not (low <= height_m <= high and least <= pitch_rad <= most):
            return self._commands.refuse(f"stand: {height_m:.2f} m, {pitch_rad:.2f} rad is out of range")
        X = RigidTransform(RotationMatrix.MakeYRotation(pitch_rad), [0.0, 0.0, height_m - can.standing_height_m])
        self._posture.put(messages.pose(X))
        return self._commands.begin(POSTURE, (height_m, pitch_rad), self._clock.now(), until_s)

    def sit(self, *_: Any, **__: Any) -> CommandId:
        """Refuses, as docking and opening doors: no topics or actions of ROS 2 are common for them."""
        return self._commands.refuse("ROS 2 has no such command", CommandCause.UNSUPPORTED)

    dock = undock = open_door = sit

    def move_arm(self, trajectory: ArmTrajectory, *, until_s: float, lease: Lease) -> CommandId:
        """Sends a joint trajectory to the arm's controller; done by its result."""
        arm = self._description.capabilities.arm
        if arm is None or trajectory.positions_rad.shape[1] != len(arm.joint_names):
            return self.sit() if arm is None else self._commands.refuse("move_arm: wrong joints")
        return self._act(ARM, self._trajectory(arm.joint_names, trajectory), until_s, lease, trajectory.times_s)

    def point_head(self, pan_rad: float, tilt_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Sends pan and tilt to the head's controller; done by its result."""
        head = self._description.capabilities.head
        if head is None:
            return self.sit()
        if (out := head.refusal(pan_rad, tilt_rad)) is not None:
            return self._commands.refuse(out)
        goal_rad, now = np.array([pan_rad, tilt_rad]), self.joints().position_rad
        far_rad = np.abs(goal_rad - [now.get(name, 0.0) for name in head.joint_names]).max()
        motion = ArmTrajectory(np.array([max(_LEAST_POINT_S, far_rad / _HEAD_RAD_S)]), goal_rad[None, :])
        return self._act(HEAD, self._trajectory(head.joint_names, motion), until_s, lease, goal_rad)

    def set_gripper(self, opening: float, force_n: float, *, until_s: float, lease: Lease) -> CommandId:
        """Sends an opening and a force to the gripper's controller; done by its result."""
        file, gripper = self._description.file.gripper, self._description.capabilities.gripper
        if file is None or gripper is None:
            return self.sit()
        if (out := gripper.refusal(opening, force_n)) is not None:
            return self._commands.refuse(out)
        goal = {"command": {"position": file.scale * opening, "max_effort": force_n}}
        return self._act(GRIP, goal, until_s, lease, (opening, force_n))

    def carry(self, holding: bool, *, lease: Lease) -> None:
        """Tells the robot whether the gripper holds an object, if a topic is described for it."""
        if lease == self._leases.current and self._carry is not None:
            self._carry.put({"data": holding})

    def stop(self, *, lease: Lease, only: CommandId | None = None) -> CommandId:
        """Stops base, arm and head, or only the part of a command; the gripper keeps its force."""
        if (gone := self._leases.refusal(lease)) is not None:
            return self._commands.refuse(f"stop: {gone}", CommandCause.NO_LEASE)
        for part in (BASE, POSTURE, ARM, HEAD):
            active = self._commands.running(part)
            if only is None or (active is not None and active.id == only):
                self._halt(part, CommandState.STOPPED, "stopped by command", CommandCause.STOPPED)
        return self._commands.note(CommandState.DONE)

    def lease_holder(self) -> Lease | None:
        """Valid lease within this program; ROS 2 has none."""
        return self._leases.current

    def take_lease(self, holder: str) -> Lease:
        """Takes the lease from its holder; the robot stops."""
        if (before := self._leases.current) is not None:
            self.stop(lease=before)
        return self._leases.take(holder)

    def return_lease(self, lease: Lease) -> None:
        """Returns the lease; the robot stops."""
        if lease == self._leases.current:
            self.stop(lease=lease)
            self._leases.give_back(lease)

    def poll(self) -> None:
        """Renews the velocity, follows the actions, and ends what is late; call it once a tick."""
        now_s, silent_s = self._clock.now(), self.silent_s()
        if silent_s > OLD_STATE_S:
            self._fall_silent(silent_s)
            return
        for part in list(self._unsure):  # it may be moving on since the robot fell silent
            self._stop_part(part, self._unsure.pop(part))
        for part in PARTS:
            self._follow(part, now_s)

    def stopped_because(self) -> str:
        """Reason why the robot has stopped for good; empty while it goes on."""
        return f"the robot has not answered for {GONE_S:.0f} s" if self.silent_s() > GONE_S else ""

    def _fall_silent(self, silent_s: float) -> None:
        """Ends the running commands of a silent robot; their parts are stopped when it answers again."""
        old = f"the last state is {silent_s:.1f} s old"
        for part in PARTS[:-1]:
            if (active := self._commands.running(part)) is not None:
                self._halt(part, CommandState.STOPPED, old, CommandCause.NO_ANSWER)
                self._unsure[part] = active.goal

    def _follow(self, part: str, now_s: float) -> None:
        """Renews the command of a part, or ends it when it has reached its goal or is late."""
        if (active := self._commands.running(part)) is None:
            return
        if (end := self._end_of(part, active.goal)) is not None:
            self._commands.finish(part, *end)
        elif part == BASE and now_s < active.until_s:
            self._say(active.goal)
        elif part == BASE:
            self._halt(part, CommandState.DONE)
        elif now_s > active.until_s:
            self._halt(part, CommandState.STOPPED, "expired before it was done", CommandCause.LATE)

    def _end_of(self, part: str, goal: Any) -> tuple[CommandState, str, CommandCause] | None:
        """Returns how the command of a part ended: state, reason and cause; None while it goes on."""
        if part == BASE:
            return None
        if part == POSTURE:
            X_OB = self.odometry().X_OB
            off_m = abs(float(X_OB.translation()[2]) - goal[0])
            off_rad = abs(RollPitchYaw(X_OB.rotation()).pitch_angle() - goal[1])
            reached = off_m < _REACHED_M and off_rad < _REACHED_RAD
            return (CommandState.DONE, "", CommandCause.NONE) if reached else None
        if not goal.ended.is_set():
            return None
        stalled, result = part == GRIP and goal.result.stalled, goal.result
        if (file := self._description.file.gripper) is not None and part == GRIP:
            untold = {"force_n": file.force is None, "holding": file.holding is None}
            told = {"force_n": result.effort, "holding": bool(stalled)}
            self._feel(opening=result.position / file.scale, **{each: told[each] for each in told if untold[each]})
        if goal.status is GoalStatus.SUCCEEDED or stalled:
            return CommandState.DONE, "stopped by an object in the gripper" if stalled else "", CommandCause.NONE
        if goal.status is GoalStatus.CANCELED:
            return CommandState.STOPPED, "cancelled by the controller", CommandCause.STOPPED
        reason = str(getattr(result, "error_string", ""))[:200] or "the controller gave up"
        invalid = getattr(result, "error_code", 0) == INVALID_GOAL
        return CommandState.STOPPED, reason, CommandCause.INVALID if invalid else CommandCause.BLOCKED

    def _say(self, velocity: tuple[float, float, float]) -> None:
        twist = messages.twist(velocity)
        if self._description.file.base.stamped:
            head = messages.header(self._clock.theirs(self._clock.now()), self.body_frame)
            twist = {"header": head, "twist": twist}
        self._velocity.put(twist)

    def _halt(self, part: str, *end: Any) -> None:
        """Stops a part, if it has a command, and ends that."""
        if (active := self._commands.running(part)) is not None:
            self._stop_part(part, active.goal)
            self._commands.finish(part, *end)

    def _stop_part(self, part: str, goal: Any) -> None:
        if part == BASE:
            self._say((0.0, 0.0, 0.0))
        if part in self.actions:
            self.actions[part].cancel(goal)

    def _trajectory(self, names: tuple[str, ...], trajectory: ArmTrajectory) -> Any:
        """Returns the goal of a trajectory under the names of ROS, which begins when it arrives."""
        points = [
            {"positions": np.asarray(positions, np.float64), "time_from_start": messages.time_of(time_s)}
            for time_s, positions in zip(trajectory.times_s.tolist(), trajectory.positions_rad, strict=True)
        ]
        in_ros = self._description.file.joint_names
        return {"trajectory": {"joint_names": [in_ros.get(name, name) for name in names], "points": points}}

    def _act(self, part: str, goal: Any, until_s: float, lease: Lease, values: Iterable[float]) -> CommandId:
        """Sends the goal of an action, unless there is an objection."""
        if (refused := self._objection(part, lease, until_s, values)) is not None:
            return refused
        try:
            sent = self.actions[part].send(goal, limit_s=_CALL_S)
        except TimeoutError as error:
            return self._commands.refuse(f"{part}: {error}", CommandCause.NO_ANSWER)
        if sent is None:
            return self._commands.refuse(f"{part}: the controller rejects the goal", CommandCause.REFUSED)
        return self._commands.begin(part, sent, self._clock.now(), until_s)

    def _objection(self, part: str, lease: Lease, until_s: float, values: Iterable[float]) -> CommandId | None:
        """Refuses a forbidden command; returns None for an allowed one."""
        now_s, silent_s = self._clock.now(), self.silent_s()
        if refused := refusal_of(part, self._leases.refusal(lease), values, until_s=until_s, now_s=now_s):
            return self._commands.refuse(*refused)
        if silent_s > OLD_STATE_S:
            return self._commands.refuse(f"{part}: the last state is {silent_s:.1f} s old", CommandCause.NO_ANSWER)
        return None
