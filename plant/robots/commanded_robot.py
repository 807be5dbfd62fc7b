"""Base class of all simulated robots behind the Robot protocol: sensing, arm and gripper, commands and the lease."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import TypeVar

import numpy as np
from pydrake.systems.framework import Context

from plant.robots.robot_kind import RobotBody
from plant.robots.sensor_suite import SensorSuite
from plant.robots.servos import (
    ActuatedJoints,
    ArmServos,
    Closing,
    GripperGoal,
    GripperServo,
    GripperTolerances,
    Part,
    Velocity,
)
from plant.saved_state import State, Stateful
from skills.command_table import CommandTable, LeaseManager, refusal_of
from skills.robot import (
    ArmTrajectory,
    Battery,
    Capabilities,
    CommandCause,
    CommandId,
    CommandState,
    CommandStatus,
    DoorHandle,
    FloatArray,
    Gripper,
    Image,
    Imu,
    Joints,
    Lease,
    Odometry,
    Scan,
)

GoalT = TypeVar("GoalT")


class CommandedRobot(Stateful, ABC, saved=("_arm", "_gripper", "_sensors")):
    """Simulated robot that measures, and executes the commands of the lease holder.

    Its saved state is that of servos and sensors; commands and leases are lost when the robot's computer restarts.
    """

    def __init__(
        self, body: RobotBody, index: ActuatedJoints, sensors: SensorSuite, context: Context, gripper: GripperTolerances
    ) -> None:
        """Takes control of the robot in the state of the plant's `context`, at time 0."""
        self._name, self._capabilities, self._sensors = body.name, body.kind.capabilities(), sensors
        self._plant, self._instance, self._index, self._context = body.plant, body.instance, index, context
        joints = self._joints()
        self._arm = ArmServos(index, joints)
        self._gripper = GripperServo(max(0.0, self._fingers_at(joints, joints)[0]), gripper)
        self._commands, self._leases = CommandTable[Part](), LeaseManager(body.name)
        self._now_s = 0.0

    # -- know and sense -------------------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self._name

    def capabilities(self) -> Capabilities:
        """Capabilities of this robot."""
        return self._capabilities

    def odometry(self) -> Odometry:
        """Latest dead reckoning."""
        return self._sensors.odometry

    def own_localisation(self) -> None:
        """Returns None: a simulated robot has no map of its own."""

    def imu(self) -> Imu:
        """Latest inertial measurement."""
        return self._sensors.imu

    def scan(self) -> Scan | None:
        """Latest LiDAR revolution; None before the first one."""
        return self._sensors.scan

    def image(self, source: str, *, visual: bool = True, depth: bool = True) -> Image:
        """Takes a picture with depth now, or only one of the two. Raises ValueError for an unknown source."""
        return self._sensors.image(source, visual=visual, depth=depth)

    def joints(self) -> Joints:
        """Latest joint state."""
        return self._sensors.joints

    def gripper(self) -> Gripper:
        """Latest gripper state."""
        return self._sensors.gripper

    def battery(self) -> Battery:
        """Latest battery state."""
        return self._sensors.battery

    def faults(self) -> tuple[str, ...]:
        """Present faults; an empty tuple when there are none."""
        return ()

    # -- act ------------------------------------------------------------------------------------------------------

    def drive(self, vx: float, vy: float, wz: float, *, until_s: float, lease: Lease) -> CommandId:
        """Moves at a body-frame velocity (m/s, m/s, rad/s) until the clock reads until_s."""
        velocity = Velocity(vx, vy, wz)
        return self._begin(Part.VELOCITY, velocity, until_s, lease, self._drive_refusal(velocity), (vx, vy, wz))

    def point_head(self, pan_rad: float, tilt_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Turns the head to a pan (positive to the left) and a tilt (positive looks down)."""
        head = self._capabilities.head
        if head is None:
            return self._commands.refuse("point_head: the robot has no head", CommandCause.UNSUPPORTED)
        return self._begin(Part.HEAD, (pan_rad, tilt_rad), until_s, lease, head.refusal(pan_rad, tilt_rad))

    def dock(self, station: int, *, until_s: float, lease: Lease) -> CommandId:
        """Refuses: a simulated robot charges where it stands."""
        return self._commands.refuse("dock: the robot has no docking station", CommandCause.UNSUPPORTED)

    def undock(self, *, until_s: float, lease: Lease) -> CommandId:
        """Refuses: see `dock`."""
        return self._commands.refuse("undock: the robot has no docking station", CommandCause.UNSUPPORTED)

    def open_door(self, handle: DoorHandle, *, until_s: float, lease: Lease) -> CommandId:
        """Refuses: a simulated robot cannot turn a handle."""
        return self._commands.refuse("open_door: the robot opens no doors", CommandCause.UNSUPPORTED)

    def move_arm(self, trajectory: ArmTrajectory, *, until_s: float, lease: Lease) -> CommandId:
        """Follows a joint trajectory; done when the arm rests at its end."""
        return self._begin(Part.ARM, trajectory, until_s, lease, self._arm.refusal(trajectory))

    def set_gripper(self, opening: float, force_n: float, *, until_s: float, lease: Lease) -> CommandId:
        """Moves the gripper to an opening with at most force_n at its tip; the force stays after the command's end."""
        gripper = self._capabilities.gripper
        if gripper is None:
            return self._commands.refuse("set_gripper: the robot has no gripper", CommandCause.UNSUPPORTED)
        goal = GripperGoal(opening, force_n)
        command = self._begin(Part.GRIPPER, goal, until_s, lease, gripper.refusal(opening, force_n))
        if self._runs(command):
            if opening > self._sensors.gripper.opening:
                self._sensors.tell_held(False)
            self._gripper.begin(goal)
        return command

    def carry(self, holding: bool, *, lease: Lease) -> None:
        """Tells the gripper's sensor; the gripper keeps its force also when communication is lost."""
        if self._leases.refusal(lease) is None:
            self._sensors.tell_held(holding)

    def stop(self, *, lease: Lease, only: CommandId | None = None) -> CommandId:
        """Stops all motion, or only the given command if it still runs."""
        refusal = self._leases.refusal(lease)
        if refusal:
            return self._commands.refuse(f"stop: {refusal}", CommandCause.NO_LEASE)
        for part in Part:
            active = self._commands.running(part)
            if only is None or (active is not None and active.id == only):
                self._halt(part, "stopped by command", CommandCause.STOPPED)
        return self._commands.note(CommandState.DONE)

    def command_status(self, command: CommandId) -> CommandStatus:
        """Returns the status of a command. Raises KeyError for an unknown id."""
        return self._commands.status(command)

    # -- own ------------------------------------------------------------------------------------------------------

    def lease_holder(self) -> Lease | None:
        """Valid lease; None while nobody holds one."""
        return self._leases.current

    def acquire_lease(self, holder: str) -> Lease:
        """Takes a free lease. Raises LeaseError when another holds it."""
        return self._leases.acquire(holder)

    def take_lease(self, holder: str) -> Lease:
        """Takes the lease from its holder; the robot stops."""
        self._halt_all("the lease was taken by " + repr(holder), CommandCause.NO_LEASE)
        return self._leases.take(holder)

    def return_lease(self, lease: Lease) -> None:
        """Returns the lease; the robot stops. Ignores a lease that is no longer valid."""
        if self._leases.give_back(lease):
            self._halt_all("the lease was returned", CommandCause.NO_LEASE)

    # -- called by the simulation ---------------------------------------------------------------------------------

    def sense(self, now_s: float) -> None:
        """Updates all sensors."""
        self._now_s = now_s
        self._sensors.update(now_s)

    def control(self, now_s: float, dt_s: float) -> None:
        """Commands all servos for the next dt_s of simulated time, with gravity feed-forward."""
        self._now_s = now_s
        self._expire()
        joints, rates = self._joints(), self._rates()
        self._follow_arm(joints, rates)
        self._follow_gripper(joints, rates, dt_s)
        desired = self._desired(joints, rates, dt_s)
        plant, context, index = self._plant, self._context, self._index
        desired[index.arm], desired[index.rates_of(index.arm)] = self._arm.goal_rad, self._arm.rate_rad_s
        gravity = plant.CalcGravityGeneralizedForces(context)[index.velocities]
        plant.get_desired_state_input_port(self._instance).FixValue(context, desired)
        feed_forward = np.minimum(np.maximum(-gravity, -index.efforts), index.efforts)
        plant.get_actuation_input_port(self._instance).FixValue(context, feed_forward)

    def state(self) -> State:
        """Returns the state of servos and sensors, and whether the arm moves."""
        return {**super().state(), "arm_moves": self._commands.running(Part.ARM) is not None}

    def restore(self, state: State) -> None:
        """Restores a state: a moving arm holds its position, and the gripper keeps its force."""
        super().restore(state)
        if state["arm_moves"]:
            self._arm.hold(self._joints())

    def power_up(self, now_s: float) -> None:
        """Starts the robot where it stands, without lease and commands, and updates the sensors."""
        self._now_s = now_s
        self._commands, self._leases = CommandTable[Part](), LeaseManager(self._name)
        self._sensors.power_up(now_s)

    # -- for the kinds of robots ----------------------------------------------------------------------------------

    @abstractmethod
    def _drive_refusal(self, velocity: Velocity) -> str | None:
        """Reason why the robot cannot drive at a finite velocity now; None when it can."""

    @abstractmethod
    def _fingers_at(self, joints: FloatArray, rates: FloatArray) -> tuple[float, float]:
        """Opening of the gripper and rate of its fingers, in the unit of the gripper's kind and per second."""

    @abstractmethod
    def _desired(self, joints: FloatArray, rates: FloatArray, dt_s: float) -> FloatArray:
        """Desired positions and velocities of all joints after dt_s; the caller adds those of the arm."""

    def _hold_still(self, part: Part) -> None:
        """Sets the goal of a part to its present position; a gripper that clamps an object keeps its force."""
        if part is Part.ARM:
            self._arm.hold(self._joints())
        if part is Part.GRIPPER:
            opening, rate = self._fingers_at(self._joints(), self._rates())
            self._gripper.halt(max(0.0, opening), rate)

    def _joints(self) -> FloatArray:
        """Positions of all joints."""
        return np.asarray(self._plant.GetPositions(self._context)[self._index.positions])

    def _rates(self) -> FloatArray:
        """Velocities of all joints."""
        return np.asarray(self._plant.GetVelocities(self._context)[self._index.velocities])

    def _goal(self, part: Part, of: type[GoalT]) -> GoalT | None:
        """Goal of the part's running command if it has this class, else None."""
        active = self._commands.running(part)
        return active.goal if active is not None and isinstance(active.goal, of) else None

    def _follow_arm(self, joints: FloatArray, rates: FloatArray) -> None:
        active, trajectory = self._commands.running(Part.ARM), self._goal(Part.ARM, ArmTrajectory)
        elapsed_s = 0.0 if active is None else self._now_s - active.since_s
        if self._arm.follow(trajectory, elapsed_s, joints, rates):
            self._commands.finish(Part.ARM, CommandState.DONE)

    def _follow_gripper(self, joints: FloatArray, rates: FloatArray, dt_s: float) -> None:
        closing = self._gripper.follow(*self._fingers_at(joints, rates), dt_s)
        if closing is not Closing.MOVING:
            reason = "" if closing is Closing.ARRIVED else "stopped by an object in the gripper"
            self._commands.finish(Part.GRIPPER, CommandState.DONE, reason)

    def _begin(
        self,
        part: Part,
        goal: object,
        until_s: float,
        lease: Lease,
        invalid: str | None = None,
        values: Iterable[float] = (),
    ) -> CommandId:
        """Begins a command, unless its values are `invalid` or a robot refuses it (`refusal_of`)."""
        refused = refusal_of(part.value, self._leases.refusal(lease), values, until_s=until_s, now_s=self._now_s)
        if refused or invalid:
            return self._commands.refuse(*(refused or (invalid or "",)))
        return self._commands.begin(part, goal, self._now_s, until_s)

    def _runs(self, command: CommandId) -> bool:
        return self._commands.status(command).state is CommandState.RUNNING

    def _halt_all(self, reason: str, cause: CommandCause) -> None:
        for part in Part:
            self._halt(part, reason, cause)

    def _halt(self, part: Part, reason: str, cause: CommandCause) -> None:
        if self._commands.running(part) is not None:
            self._hold_still(part)
        self._commands.finish(part, CommandState.STOPPED, reason, cause)

    def _expire(self) -> None:
        for part in Part:
            active = self._commands.running(part)
            if active is None or self._now_s < active.until_s - 1e-9:
                continue
            if part is Part.VELOCITY:
                self._commands.finish(part, CommandState.DONE)
            else:
                self._halt(part, "expired before it was done", CommandCause.LATE)
