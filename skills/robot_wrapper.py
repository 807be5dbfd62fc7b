"""Base class of robots that wrap another robot and change the behaviour of single verbs."""

from collections.abc import Callable
from typing import Any, Final, TypeVar

from skills.robot import (
    ArmTrajectory,
    Battery,
    Capabilities,
    CommandId,
    CommandStatus,
    DoorHandle,
    Gripper,
    Image,
    Imu,
    Joints,
    Lease,
    Odometry,
    OwnLocalisation,
    Robot,
    Scan,
)

AnswerT = TypeVar("AnswerT")
VERBS: Final = tuple(name for name in vars(Robot) if not name.startswith("_") and name != "name")
"""Names of all verbs of the Robot protocol."""


class RobotWrapper(Robot):
    """Robot that wraps another one: every verb goes through `_call`, and verbs that move the robot through `_command`.

    By default both make the call unchanged; a subclass overrides them, or single verbs.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot

    def _call(self, verb: str, call: Callable[..., AnswerT], *arguments: Any, **options: Any) -> AnswerT:
        """Calls `call`, the wrapped robot's method for a verb."""
        return call(*arguments, **options)

    def _command(self, verb: str, call: Callable[..., CommandId], *arguments: Any, **options: Any) -> CommandId:
        """Calls `call`, the wrapped robot's method for a verb that moves the robot."""
        return self._call(verb, call, *arguments, **options)

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self._robot.name

    def capabilities(self) -> Capabilities:
        """Returns the robot's geometry and limits."""
        return self._call("capabilities", self._robot.capabilities)

    def odometry(self) -> Odometry:
        """Returns the latest dead reckoning."""
        return self._call("odometry", self._robot.odometry)

    def own_localisation(self) -> OwnLocalisation | None:
        """Returns the pose in the robot's own map."""
        return self._call("own_localisation", self._robot.own_localisation)

    def imu(self) -> Imu | None:
        """Returns the latest inertial measurement."""
        return self._call("imu", self._robot.imu)

    def scan(self) -> Scan | None:
        """Returns the latest LiDAR revolution."""
        return self._call("scan", self._robot.scan)

    def image(self, source: str, *, visual: bool = True, depth: bool = True) -> Image:
        """Takes a picture."""
        return self._call("image", self._robot.image, source, visual=visual, depth=depth)

    def joints(self) -> Joints:
        """Returns the latest joint state."""
        return self._call("joints", self._robot.joints)

    def gripper(self) -> Gripper:
        """Returns the latest gripper state."""
        return self._call("gripper", self._robot.gripper)

    def battery(self) -> Battery:
        """Returns the latest battery state."""
        return self._call("battery", self._robot.battery)

    def faults(self) -> tuple[str, ...]:
        """Returns the present faults."""
        return self._call("faults", self._robot.faults)

    def drive(self, vx: float, vy: float, wz: float, *, until_s: float, lease: Lease) -> CommandId:
        """Drives at a velocity."""
        return self._command("drive", self._robot.drive, vx, vy, wz, until_s=until_s, lease=lease)

    def stand(self, height_m: float, pitch_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Holds the body at a height and a pitch."""
        return self._command("stand", self._robot.stand, height_m, pitch_rad, until_s=until_s, lease=lease)

    def sit(self, *, until_s: float, lease: Lease) -> CommandId:
        """Lowers the body to the floor."""
        return self._command("sit", self._robot.sit, until_s=until_s, lease=lease)

    def dock(self, station: int, *, until_s: float, lease: Lease) -> CommandId:
        """Docks at a docking station."""
        return self._command("dock", self._robot.dock, station, until_s=until_s, lease=lease)

    def undock(self, *, until_s: float, lease: Lease) -> CommandId:
        """Leaves the docking station."""
        return self._command("undock", self._robot.undock, until_s=until_s, lease=lease)

    def open_door(self, handle: DoorHandle, *, until_s: float, lease: Lease) -> CommandId:
        """Opens a door and walks through."""
        return self._command("open_door", self._robot.open_door, handle, until_s=until_s, lease=lease)

    def move_arm(self, trajectory: ArmTrajectory, *, until_s: float, lease: Lease) -> CommandId:
        """Follows a joint trajectory."""
        return self._command("move_arm", self._robot.move_arm, trajectory, until_s=until_s, lease=lease)

    def point_head(self, pan_rad: float, tilt_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Turns the head."""
        return self._command("point_head", self._robot.point_head, pan_rad, tilt_rad, until_s=until_s, lease=lease)

    def set_gripper(self, opening: float, force_n: float, *, until_s: float, lease: Lease) -> CommandId:
        """Moves the gripper."""
        return self._command("set_gripper", self._robot.set_gripper, opening, force_n, until_s=until_s, lease=lease)

    def carry(self, holding: bool, *, lease: Lease) -> None:
        """Tells the robot whether the gripper holds an object."""
        return self._call("carry", self._robot.carry, holding, lease=lease)

    def stop(self, *, lease: Lease, only: CommandId | None = None) -> CommandId:
        """Stops all motion, or only the given command."""
        return self._command("stop", self._robot.stop, lease=lease, only=only)

    def command_status(self, command: CommandId) -> CommandStatus:
        """Returns the status of a command."""
        return self._call("command_status", self._robot.command_status, command)

    def lease_holder(self) -> Lease | None:
        """Returns the valid lease."""
        return self._call("lease_holder", self._robot.lease_holder)

    def acquire_lease(self, holder: str) -> Lease:
        """Takes a free lease."""
        return self._call("acquire_lease", self._robot.acquire_lease, holder)

    def take_lease(self, holder: str) -> Lease:
        """Takes the lease from its holder."""
        return self._call("take_lease", self._robot.take_lease, holder)

    def return_lease(self, lease: Lease) -> None:
        """Returns the lease."""
        return self._call("return_lease", self._robot.return_lease, lease)
