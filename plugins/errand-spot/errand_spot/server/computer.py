"""The robot's computer: steps the clock, publishes what the robot senses, and runs the commands of clients.

One thread owns robot and clock. Calls of clients read the last snapshot, and hand over work to be done between steps.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Container, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from enum import Enum
from itertools import count
from threading import Condition, Event
from typing import Any, Final, Protocol, TypeVar

import numpy as np
from bosdyn.api import basic_command_pb2, estop_pb2, robot_state_pb2
from pydrake.math import RigidTransform

from errand_spot.messages import Frames, depth_frame, picture_frame, pose_between, timestamp
from errand_spot.server.estop import EstopService
from errand_spot.server.leases import ARM, GRIPPER, MOBILITY, LeaseService
from errand_spot.server.refusals import known_frame
from errand_spot.server.scan_points import Region, ScanPoints
from executive.run.worker import WorkQueue
from skills.robot import (
    Battery,
    Capabilities,
    Clock,
    CommandId,
    CommandState,
    FloatArray,
    Gripper,
    Joints,
    Lease,
    Mount,
    Odometry,
    Pose2D,
    Robot,
    Scan,
)

T = TypeVar("T")
PERIOD_S: Final = 0.025
POWER_ON_S: Final = 1.0
_LATE_S: Final = 0.3
_CLIENT_START_S: Final = 1.7e9
_STILL_M, _STILL_S, _NEAR_M = 0.01, 1.0, 0.05
OVERRIDDEN: Final = basic_command_pb2.RobotCommandFeedbackStatus.STATUS_COMMAND_OVERRIDDEN
_FOREVER_S: Final = 1e7
_MOVING: Final = 0.05
_DOCKED_M, _DOCKED_RAD = 0.12, 0.2
HAND_X_M: Final = 0.19557
"""Distance of the API's frame `hand` ahead of `link_wr1`, the protocol's hand frame H (SDK, frames of the arm)."""


class Solver(Protocol):
    """Kinematics of the arm, with the limits of its joints (J,)."""

    @property
    def lower_rad(self) -> FloatArray:
        """Lower limits."""

    @property
    def upper_rad(self) -> FloatArray:
        """Upper limits."""

    def X_BH(self, q_rad: FloatArray) -> RigidTransform:
        """Pose of the last link for joint angles (J,)."""

    def inverse(self, X_BH: RigidTransform, margin_rad: float = 0.03) -> Sequence[FloatArray]:
        """Joint angles (J,) that put the last link at a pose."""


class Motors(Enum):
    """Power of the motors."""

    OFF = "off"
    STARTING = "starting"
    ON = "on"


class Pace(Enum):
    """Driver of the clock: wall time, or a client that steps it (for tests)."""

    REAL = "real"
    CLIENT = "client"


@dataclass(frozen=True)
class Snapshot:
    """Readings after a step. `time_s` is the robot's time (s since 1970)."""

    time_s: float
    odometry: Odometry
    joints: Joints
    gripper: Gripper
    battery: Battery
    scan: Scan | None
    faults: tuple[str, ...]
    motors: Motors
    sitting: bool
    frames: Frames

    def X_AB(self, a: str, b: str) -> RigidTransform:
        """Pose of frame `b` in frame `a`. Raises KeyError for an unknown frame."""
        return pose_between(self.frames, a, b)

    def X_OF(self, frame: str, allowed: Container[str] | None = None) -> RigidTransform:
        """Pose in `odom` of a frame that a command names. Raises RefusedError for an unknown or forbidden one."""
        return self.X_AB("odom", known_frame(frame, self.frames if allowed is None else allowed))


class Motion(Protocol):
    """Motion of one part of the robot, or several, on a client's command; only the computer's thread calls it."""

    def begin(self, computer: Computer) -> None:
        """Starts it."""

    def tick(self, computer: Computer) -> None:
        """Goes on with it after a step."""

    def end(self, status: int) -> None:
        """Ends it with a status of `RobotCommandFeedbackStatus`."""


@dataclass
class Grip:
    """Word of clients on the item in the gripper, in place of the robot's own: is one held, and how it is carried."""

    holding: bool | None = None
    carry: int | None = None

    def holds(self, gripper: Gripper) -> bool:
        """Returns whether an item is held."""
        return gripper.holding if self.holding is None else self.holding

    def carry_state(self, gripper: Gripper) -> int:
        """Returns the carry state: unless clients say otherwise an item is carriable, since the grip stays firm."""
        State = robot_state_pb2.ManipulatorState
        own = State.CARRY_STATE_CARRIABLE if self.holds(gripper) else State.CARRY_STATE_NOT_CARRIABLE
        return int(own if self.carry is None else self.carry)

    def may_stow(self, gripper: Gripper) -> bool:
        """Returns whether the arm may stow: with an item only on a client's word."""
        stowable = robot_state_pb2.ManipulatorState.CARRY_STATE_CARRIABLE_AND_STOWABLE
        return not self.holds(gripper) or self.carry_state(gripper) == stowable


class Computer:
    """The computer of one robot."""

    def __init__(
        self,
        robot: Robot,
        clock: Clock,
        *,
        leases: LeaseService,
        estop: EstopService,
        solver: Solver | None,
        pace: Pace = Pace.REAL,
        dock_O: Pose2D | None = None,
    ) -> None:
        """Takes the robot's lease. The robot sits down, as before its motors are switched on; `dock_O` is its dock."""
        self.robot, self.clock, self.solver, self.pace = robot, clock, solver, pace
        self.leases, self.estop, self.dock_O = leases, estop, dock_O
        self.lease: Lease = robot.take_lease("the server of Spot's API")
        self.capabilities: Capabilities = robot.capabilities()
        self.motors, self._motors_since_s = Motors.OFF, 0.0
        self.settling, self.grip = False, Grip()
        self.fault: Any = None
        """Behaviour fault of a fall, until a client clears it."""
        self._falls = count(1)
        self.feet_O: Pose2D | None = None
        """Pose of the feet in `odom` while the body moves over them; None while they walk with it."""
        self.scan_points = ScanPoints()
        self.regions: Sequence[Region] = ()
        """No-go regions of clients."""
        self._motions: dict[str, Motion] = {}
        self._work, self._stepped = WorkQueue(), Condition()
        self._started_s = time.time() if pace is Pace.REAL else _CLIENT_START_S
        self._started_monotonic_s = time.monotonic()
        self.watchers: list[Callable[[], None]] = []
        """Called before each step."""
        self._sit_command: CommandId | None = None
        self._still_at_m, self._still_since_s = 0.0, 0.0
        self.sit()
        self.snapshot = self._sensed()

    # -- time --------------------------------------------------------------------------------------------------------

    def now_s(self) -> float:
        """The robot's time (s since 1970): its start plus what has passed since on the wall, or by a client's pace."""
        real = self.pace is Pace.REAL
        return self._started_s + (time.monotonic() - self._started_monotonic_s if real else self.clock.now())

    def until_s(self, robot_time_s: float) -> float:
        """Converts a robot time to the robot's clock; the remaining time counts from now on."""
        return self.clock.now() + self.left_s(robot_time_s)

    def left_s(self, robot_time_s: float) -> float:
        """Returns the time left until a robot time (s), in whole steps at a client's pace, with its inexact clock."""
        left_s = robot_time_s - self.now_s()
        exact = self.pace is Pace.REAL or math.isinf(left_s)
        return left_s if exact else PERIOD_S * round(left_s / PERIOD_S)

    def forever(self) -> float:
        """A time (robot's clock) that never comes."""
        return self.clock.now() + _FOREVER_S

    # -- for the calls of clients ------------------------------------------------------------------------------------

    def do(self, work: Callable[[], T]) -> Future[T]:
        """Hands over work to be done between steps."""
        return self._work.submit(work)

    def lost(self, parts: Sequence[str]) -> None:
        """Stops the parts whose lease has changed hands."""
        self.do(lambda: self.stop_parts(parts))

    # -- the loop ----------------------------------------------------------------------------------------------------

    def run(self, stopping: Event) -> None:
        """Steps at the pace of wall time until `stopping` is set. A plant that is late does not catch up in leaps."""
        due_s = time.monotonic()
        while not stopping.is_set():
            due_s = max(due_s + PERIOD_S, time.monotonic() - _LATE_S)
            self._work.work_for(due_s - time.monotonic())
            self.step()

    def serve(self, stopping: Event) -> None:
        """Does the work of clients until `stopping` is set; one client steps the clock, by `do(step)`."""
        while not stopping.is_set():
            self._work.work_for(_LATE_S, most=1)

    def step(self) -> None:
        """Does the waiting work, steps the clock and goes on with all motions."""
        self._work.work_for(0.0)
        self._watch()
        self.clock.advance(PERIOD_S)
        self.snapshot = self._sensed()
        self.scan_points.take(self.snapshot.scan)
        for motion in dict.fromkeys(self._motions.values()):
            motion.tick(self)
        with self._stepped:
            self._stepped.notify_all()

    def wait_for_step(self, most_s: float) -> None:
        """Waits, in a client's thread, until the next step is done, or for a wall time (s)."""
        with self._stepped:
            self._stepped.wait(most_s)

    # -- motors ------------------------------------------------------------------------------------------------------

    def switch_on(self) -> None:
        """Switches the motors on, which takes a second."""
        if self.motors is Motors.OFF:
            self.motors, self._motors_since_s = Motors.STARTING, self.clock.now()
            self.estop.motors_on = True

    def switch_off(self) -> None:
        """Switches the motors off: all motions end, and a robot that does not sit falls, which is a behaviour fault."""
        falls = self.motors is not Motors.OFF and not self.snapshot.sitting
        if falls:
            Fault = robot_state_pb2.BehaviorFault
            kind = {"cause": Fault.CAUSE_FALL, "status": Fault.STATUS_CLEARABLE}
            onset = timestamp(self.now_s())
            self.fault = Fault(behavior_fault_id=next(self._falls), onset_timestamp=onset, **kind)
        self.motors, self.settling, self.estop.motors_on = Motors.OFF, False, False
        self.stop_parts((MOBILITY, ARM, GRIPPER))
        self.sit(falls=falls)

    @property
    def able(self) -> bool:
        """Returns whether motions may begin: the motors are on, no fault of a fall is left, no E-stop is pressed."""
        released = self.estop.level() == estop_pb2.ESTOP_LEVEL_NONE
        return self.snapshot.motors is Motors.ON and self.fault is None and released

    def settle(self) -> None:
        """Sits down, and then switches the motors off."""
        if not self.settling and self.motors is not Motors.OFF:
            self.stop_parts((MOBILITY, ARM))
            self.settling = True
            self.sit()

    def _watch(self) -> None:
        """Obeys E-stop, keepalive and stale leases, and finishes slow switching of the motors."""
        for watch in self.watchers:
            watch()
        level = self.estop.level()
        if self.motors is not Motors.OFF:
            if level == estop_pb2.ESTOP_LEVEL_CUT:
                self.switch_off()
            elif level == estop_pb2.ESTOP_LEVEL_SETTLE_THEN_CUT:
                self.settle()
        if self.motors is Motors.STARTING and self.clock.now() - self._motors_since_s >= POWER_ON_S:
            self.motors = Motors.ON
        if self.settling and self.snapshot.sitting:
            self.switch_off()
        if stale := [part for part in self.leases.stale_parts() if part in self._motions]:
            self.stop_parts(stale)

    # -- motions -----------------------------------------------------------------------------------------------------

    def move(self, motions: Mapping[str, Motion]) -> None:
        """Starts motions in place of the running ones; one motion may move several parts."""
        for part, motion in motions.items():
            if (before := self._motions.pop(part, None)) is not None:
                before.end(OVERRIDDEN)
            self._motions[part] = motion
        if MOBILITY in motions and not getattr(motions[MOBILITY], "keeps_feet", False):
            self.feet_O = None
        for motion in dict.fromkeys(motions.values()):
            motion.begin(self)

    def motion(self, part: str) -> Motion | None:
        """Motion of a part; None while there is none."""
        return self._motions.get(part)

    def base_moves(self, *, shifted: bool) -> bool:
        """Returns whether the base is to move on, or has `shifted` and is not still yet."""
        speed = np.abs(self.snapshot.odometry.velocity)
        return getattr(self.motion(MOBILITY), "moving", False) or (shifted and bool(speed.max() > _MOVING))

    def stop_parts(self, parts: Sequence[str]) -> None:
        """Ends the motions of parts; the base stops, and the arm holds its position."""
        ended = {part: self._motions.pop(part) for part in parts if part in self._motions}
        for motion in dict.fromkeys(ended.values()):
            motion.end(OVERRIDDEN)
        arm: Any = ended.get(ARM)
        if MOBILITY in parts or (arm is not None and not hasattr(arm, "command")):
            self.robot.stop(lease=self.lease)
        elif arm is not None and arm.command is not None:  # of the arm alone; what the base does goes on
            self.robot.stop(lease=self.lease, only=arm.command)
            if self.settling:  # it goes on sitting down
                self.sit()

    def sit(self, *, falls: bool = False) -> None:
        """Sits down, or falls if the robot can."""
        self._still_since_s, sit = self.clock.now(), self.robot.sit
        verb = getattr(self.robot, "fall", sit) if falls else sit
        self._sit_command = verb(until_s=self.forever(), lease=self.lease)

    @property
    def sits(self) -> bool:
        """Returns whether the last posture is to sit, reached or not."""
        return self._sit_command is not None

    def stand(self, height_m: float, pitch_rad: float) -> CommandId:
        """Stands up, or changes height and pitch of the body; no longer settles."""
        self._sit_command, self._still_since_s, self.settling = None, self.clock.now(), False
        return self.robot.stand(height_m, pitch_rad, until_s=self.forever(), lease=self.lease)

    @property
    def upright(self) -> bool:
        """Returns whether the robot stands: it has not been told to sit, and its body is not below the range."""
        low_m = self.capabilities.height_range_m[0] - _NEAR_M
        return not self.sits and float(self.snapshot.odometry.X_OB.translation()[2]) > low_m

    def stand_first(self, posture: tuple[float, float] | None = None) -> Callable[[], bool]:
        """Stands up unless the robot stands, or in a posture; returns a function that tells whether it may walk."""
        height_m, pitch_rad = posture or (self.capabilities.standing_height_m, 0.0)
        stood = self.upright
        if stood and posture is None:
            return lambda: True
        command = self.stand(height_m, pitch_rad)
        return lambda: stood or self.stands(command, height_m)

    def stands(self, command: CommandId, height_m: float) -> bool:
        """Returns whether a height is reached: exactly, or nearly, when a load lets the body go no further."""
        state = self.robot.command_status(command).state
        near = abs(self._still_at_m - height_m) < _NEAR_M and self.clock.now() - self._still_since_s > _STILL_S
        return state is CommandState.DONE or (state is CommandState.RUNNING and near)

    def _sits(self, height_m: float) -> bool:
        """Returns whether the robot sits, after it has measured the height of its body."""
        if abs(height_m - self._still_at_m) > _STILL_M:
            self._still_at_m, self._still_since_s = height_m, self.clock.now()
        if self._sit_command is None:
            return False
        state = self.robot.command_status(self._sit_command).state
        low = height_m < self.capabilities.height_range_m[0] - _NEAR_M
        return state is CommandState.DONE or (low and self.clock.now() - self._still_since_s > _STILL_S)

    def tell_carried(self) -> None:
        """Sets whether the robot keeps the object in the gripper."""
        carry = self.grip.carry_state(self.snapshot.gripper)
        keeps = carry != robot_state_pb2.ManipulatorState.CARRY_STATE_NOT_CARRIABLE
        self.robot.carry(keeps and self.grip.holds(self.snapshot.gripper), lease=self.lease)

    def docked(self) -> bool:
        """Returns whether the robot sits on its dock."""
        return self.snapshot.sitting and self.dock_O is not None and self.near(self.dock_O)

    def near(self, goal_O: Pose2D) -> bool:
        """Returns whether the body is at a pose in `odom`, at a dock's accuracy."""
        pose = self.snapshot.odometry.pose
        off_m = math.hypot(goal_O.x_m - pose.x_m, goal_O.y_m - pose.y_m)
        return off_m < _DOCKED_M and abs(math.remainder(goal_O.yaw_rad - pose.yaw_rad, math.tau)) < _DOCKED_RAD

    # -- sensing -----------------------------------------------------------------------------------------------------

    def _sensed(self) -> Snapshot:
        read, now_s = self.robot, self.now_s()
        odometry, joints = read.odometry(), read.joints()
        sits, frames = self._sits(float(odometry.X_OB.translation()[2])), self._frames(odometry, joints)
        others = read.gripper(), read.battery(), read.scan(), read.faults()
        return Snapshot(now_s, odometry, joints, *others, self.motors, sits, frames)

    def _frames(self, odometry: Odometry, joints: Joints) -> Frames:
        """The frame tree in the form of a real Spot: the root is `body`; `odom` and `vision` are equal here."""
        X_BO = odometry.X_OB.inverse()
        X_OF = odometry.pose.transform(float(odometry.X_OB.translation()[2]))
        edges = {
            "body": ("", RigidTransform()),
            "odom": ("body", X_BO),
            "vision": ("body", X_BO),
            "flat_body": ("body", X_BO @ X_OF),
            "gpe": ("odom", odometry.pose.transform()),
        }
        if self.solver is not None and self.capabilities.arm is not None:
            X_BH = self.solver.X_BH(self.arm_rad(joints))
            edges["link_wr1"] = edges["arm0.link_wr1"] = ("body", X_BH)
            edges["hand"] = ("arm0.link_wr1", RigidTransform([HAND_X_M, 0.0, 0.0]))
        for camera in self.capabilities.cameras:
            parent = "body" if camera.mount is Mount.BODY else "arm0.link_wr1"
            edges[picture_frame(camera.source)] = edges[depth_frame(camera.source)] = (parent, camera.X_FC)
        return edges

    def arm_rad(self, joints: Joints | None = None) -> FloatArray:
        """Joint angles (J,) of the arm."""
        assert self.capabilities.arm is not None
        read = joints or self.robot.joints()
        return np.array([read.position_rad[name] for name in self.capabilities.arm.joint_names])
