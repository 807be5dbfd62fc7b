"""What all simulated robots share behind the Robot protocol: sensing, the command book and the lease."""

from __future__ import annotations

from abc import ABC, abstractmethod

from plant.control.commands import CommandTable, Part
from plant.control.gripper import GripperGoal, GripperServo
from plant.sensors.suite import SensorSuite
from skills.robot import (
    Battery,
    Capabilities,
    CommandId,
    CommandState,
    CommandStatus,
    Gripper,
    GripperKind,
    Image,
    Imu,
    Joints,
    Lease,
    LeaseError,
    Odometry,
    Scan,
)


class LeaseManager:
    """Hands out one robot's lease; the lease with the highest number counts."""

    def __init__(self, robot_name: str) -> None:
        self._robot_name = robot_name
        self._number = 0
        self._current: Lease | None = None

    @property
    def current(self) -> Lease | None:
        """The lease that counts, None while it is free."""
        return self._current

    def acquire(self, holder: str) -> Lease:
        """A lease for `holder`. Raises LeaseError while another's is out."""
        if self._current is not None:
            raise LeaseError(
                f"{self._robot_name}: the lease is held by {self._current.holder!r}; ask for its return, or take it"
            )
        return self.take(holder)

    def take(self, holder: str) -> Lease:
        """A lease for `holder`, from whoever has it."""
        self._number += 1
        self._current = Lease(self._robot_name, holder, self._number)
        return self._current

    def give_back(self, lease: Lease) -> bool:
        """True when `lease` was the one that counted."""
        if lease != self._current:
            return False
        self._current = None
        return True

    def refusal(self, lease: Lease) -> str | None:
        """Why `lease` gives no right to move, or None when it does."""
        if lease == self._current:
            return None
        holder = self._current.holder if self._current else "nobody"
        return f"lease {lease.number} of {lease.holder!r} no longer counts; the lease is held by {holder!r}"


class CommandedRobot(ABC):
    """A robot that senses, keeps the book of its commands, and obeys who holds its lease."""

    _gripper: GripperServo

    def __init__(self, name: str, capabilities: Capabilities, sensors: SensorSuite) -> None:
        self._name, self._capabilities, self._sensors = name, capabilities, sensors
        self._commands, self._leases = CommandTable(), LeaseManager(name)
        self._now_s = 0.0

    # -- know and sense -------------------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The robot's name."""
        return self._name

    def capabilities(self) -> Capabilities:
        """What this robot is and can do."""
        return self._capabilities

    def odometry(self) -> Odometry:
        """Latest dead reckoning."""
        return self._sensors.odometry

    def imu(self) -> Imu:
        """Latest inertial measurement."""
        return self._sensors.imu

    def scan(self) -> Scan | None:
        """Latest LiDAR revolution, None before the first."""
        return self._sensors.scan

    def image(self, source: str, *, visual: bool = True, depth: bool = True) -> Image:
        """Take a picture with depth now, or only one of the two. Raises ValueError for an unknown source."""
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
        """Present faults, empty when well."""
        return ()

    # -- act ------------------------------------------------------------------------------------------------------

    def set_gripper(self, opening: float, force_n: float, *, until_s: float, lease: Lease) -> CommandId:
        """Move the gripper to an opening with at most force_n at its tip; the force stays after the command's end."""
        gripper = self._capabilities.gripper
        if gripper is None:
            return self._commands.refuse("set_gripper: the robot has no gripper")
        if not (0.0 <= opening <= gripper.widest and 0.0 < force_n <= gripper.max_force_n):
            unit = "rad" if gripper.kind is GripperKind.HINGED else "m"
            return self._commands.refuse(
                f"set_gripper: opening {opening:.3f} {unit} must lie in [0, {gripper.widest}] "
                f"and force {force_n:.0f} N in (0, {gripper.max_force_n}]"
            )
        command = self._begin(Part.GRIPPER, GripperGoal(opening, force_n), until_s, lease)
        if self._runs(command):
            self._gripper.begin(GripperGoal(opening, force_n))
        return command

    def stop(self, *, lease: Lease, only: CommandId | None = None) -> CommandId:
        """Stop all motion, or only the given command if it still runs."""
        refusal = self._leases.refusal(lease)
        if refusal:
            return self._commands.refuse(f"stop: {refusal}")
        part = self._commands.part_of(only) if only is not None else None
        for candidate in Part if only is None else ([part] if part else []):
            self._halt(candidate, "stopped by command")
        return self._commands.note(CommandState.DONE)

    def command_status(self, command: CommandId) -> CommandStatus:
        """What became of a command. Raises KeyError for an id never given."""
        return self._commands.status(command)

    # -- own ------------------------------------------------------------------------------------------------------

    def lease_holder(self) -> Lease | None:
        """The lease that counts now; None while it is free."""
        return self._leases.current

    def acquire_lease(self, holder: str) -> Lease:
        """Take a free lease. Raises LeaseError when another holds it."""
        return self._leases.acquire(holder)

    def take_lease(self, holder: str) -> Lease:
        """Take the lease from whoever holds it; the robot stops."""
        self._halt_all("the lease was taken by " + repr(holder))
        return self._leases.take(holder)

    def return_lease(self, lease: Lease) -> None:
        """Give the lease back; the robot stops. A lease that was taken away is ignored."""
        if self._leases.give_back(lease):
            self._halt_all("the lease was returned")

    # -- called by the simulation ---------------------------------------------------------------------------------

    def sense(self, now_s: float) -> None:
        """Take new sensor readings."""
        self._now_s = now_s
        self._sensors.update(now_s)

    # -- for the kinds of robots ----------------------------------------------------------------------------------

    @abstractmethod
    def _hold_still(self, part: Part) -> None:
        """Make where a moving part is the place where it stays."""

    def _forget_commands(self, now_s: float) -> None:
        """Power up anew: nobody has the lease, no command runs."""
        self._now_s = now_s
        self._commands, self._leases = CommandTable(), LeaseManager(self._name)

    def _begin(self, part: Part, payload: object, until_s: float, lease: Lease) -> CommandId:
        refusal = self._leases.refusal(lease)
        if refusal:
            return self._commands.refuse(f"{part.value}: {refusal}")
        if until_s <= self._now_s:
            return self._commands.refuse(
                f"{part.value}: expires at {until_s:.2f} s, and it is {self._now_s:.2f} s already"
            )
        return self._commands.begin(part, payload, self._now_s, until_s)

    def _runs(self, command: CommandId) -> bool:
        return self._commands.status(command).state is CommandState.RUNNING

    def _halt_all(self, reason: str) -> None:
        for part in Part:
            self._halt(part, reason)

    def _halt(self, part: Part, reason: str) -> None:
        if self._commands.running(part) is not None:
            self._hold_still(part)
        self._commands.finish(part, CommandState.STOPPED, reason)

    def _expire(self) -> None:
        for part in Part:
            active = self._commands.running(part)
            if active is None or self._now_s < active.until_s - 1e-9:
                continue
            if part is Part.VELOCITY:
                self._commands.finish(part, CommandState.DONE)
            else:
                self._halt(part, "expired before it was done")
