"""Robot protocol: the interface through which skills use a robot. Its verbs follow the Spot SDK.

Every motion command carries an expiry time on the robot's clock: a robot that receives no new command stops by itself.
Sense verbs return the latest immutable stamped snapshot and never block, except `image` (call it through the `Worker`).

Frames: `odom` (O) is fixed to the floor where the robot started and drifts against the world (W). `body` (B) is x
forward, y left, z up; its origin is the centre of the hips, or the centre of a wheeled base's axle, raised by the
stroke of the torso. `hand` (H) is the last arm link, x along the fingers, z along the closing direction. `head` turns
with the head, if there is one. `<source>_camera` (C) is z forward, x right, y down. `lidar` is L. `X_AB` is the pose of
frame B in frame A. SI units throughout.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NewType, Protocol

import numpy as np
from numpy.typing import NDArray

from skills import quantities as quantities
from skills.capabilities import ArmCapabilities as ArmCapabilities
from skills.capabilities import BaseKind as BaseKind
from skills.capabilities import CameraCapabilities as CameraCapabilities
from skills.capabilities import Capabilities as Capabilities
from skills.capabilities import GripperCapabilities as GripperCapabilities
from skills.capabilities import GripperKind as GripperKind
from skills.capabilities import HeadCapabilities as HeadCapabilities
from skills.capabilities import InverseKinematics as InverseKinematics
from skills.capabilities import Mount as Mount
from skills.quantities import Angle, Coordinate

if TYPE_CHECKING:  # Drake takes a third of a second to import; commands that move nothing do without
    from pydrake.math import RigidTransform

FloatArray = NDArray[np.float64]
"""Array of floats; each use says its shape."""
Picture = NDArray[np.uint8]
"""Picture, (H, W) grey or (H, W, 3) RGB."""
CommandId = NewType("CommandId", int)
"""Number of a motion command, to query its status."""


@dataclass(frozen=True)
class Pose2D:
    """Planar pose: x_m, y_m, yaw_rad (counter-clockwise from x)."""

    x_m: Coordinate
    y_m: Coordinate
    yaw_rad: Angle

    def transform(self, z_m: float = 0.0) -> RigidTransform:
        """Returns this pose as a RigidTransform at height `z_m`."""
        import pydrake.math as drake  # faster at each call than the import of its names

        return drake.RigidTransform(drake.RotationMatrix.MakeZRotation(self.yaw_rad), [self.x_m, self.y_m, z_m])

    @staticmethod
    def from_transform(X_AB: RigidTransform) -> Pose2D:
        """Returns the planar part of X_AB."""
        (xx, _, _, x), (yx, _, _, y), _ = X_AB.GetAsMatrix34().tolist()
        return Pose2D(x, y, math.atan2(yx, xx))


@dataclass(frozen=True)
class FrameTree:
    """Frames at one instant: child -> (parent, X_parent_child). The root is `odom`."""

    edges: Mapping[str, tuple[str, RigidTransform]]

    def pose(self, child: str, parent: str = "odom") -> RigidTransform:
        """Returns X_parent_child. Raises KeyError when a frame is unknown."""
        return self._from_root(parent).inverse() @ self._from_root(child)

    def _from_root(self, frame: str) -> RigidTransform:
        from pydrake.math import RigidTransform

        X = RigidTransform()
        while frame != "odom":
            frame, X_PF = self.edges[frame]
            X = X_PF @ X
        return X


@dataclass(frozen=True)
class Odometry:
    """Dead reckoning: pose of the body in `odom` (drifts), velocity in the body frame (vx, vy in m/s, wz in rad/s)."""

    stamp_s: float
    X_OB: RigidTransform
    velocity: tuple[float, float, float]

    @cached_property
    def pose(self) -> Pose2D:
        """Planar part of X_OB."""
        return Pose2D.from_transform(self.X_OB)


@dataclass(frozen=True)
class Imu:
    """Angular velocity (rad/s) and specific force (m/s^2), both in the body frame."""

    stamp_s: float
    angular_velocity_B: tuple[float, float, float]
    linear_acceleration_B: tuple[float, float, float]


@dataclass(frozen=True)
class OwnLocalisation:
    """Pose of `odom` in the frame S of the robot's own map."""

    stamp_s: float
    X_SO: Pose2D


@dataclass(frozen=True)
class Scan:
    """LiDAR revolution: ranges_m[ring, azimuth], NaN for no return; angles in the lidar frame; X_BL and X_OB."""

    stamp_s: float
    ranges_m: NDArray[np.float32]
    elevations_rad: FloatArray
    azimuths_rad: FloatArray
    X_BL: RigidTransform
    X_OB: RigidTransform

    @cached_property
    def pose(self) -> Pose2D:
        """Planar part of X_OB."""
        return Pose2D.from_transform(self.X_OB)

    @cached_property
    def sensor_pose(self) -> tuple[FloatArray, FloatArray]:
        """Rotation (3, 3) and position (3,) of the LiDAR in the levelled body frame, on the floor below the body."""
        import pydrake.math as drake

        R_FB = drake.RotationMatrix.MakeZRotation(-self.pose.yaw_rad) @ self.X_OB.rotation()
        p_FL = R_FB.multiply(self.X_BL.translation()) + np.array([0.0, 0.0, self.X_OB.translation()[2]])
        return np.ascontiguousarray((R_FB @ self.X_BL.rotation()).matrix()), p_FL

    def repeats(self, other: Scan) -> bool:
        """Returns whether all ranges, noise included, equal those of another scan, as from a frozen sensor."""
        first = slice(0, 1)  # as a rule noise differs in the first ring already
        return all(self.ranges_m[part].tobytes() == other.ranges_m[part].tobytes() for part in (first, slice(None)))

    def points_B(self) -> FloatArray:
        """Returns the points (N, 3) of all valid returns in the body frame."""
        ranges = self.ranges_m.astype(np.float64)
        points_L = (unit_rays(self.elevations_rad, self.azimuths_rad) * ranges[..., None])[np.isfinite(ranges)]
        return np.asarray(points_L @ self.X_BL.rotation().matrix().T + self.X_BL.translation())


def unit_rays(elevations_rad: FloatArray, azimuths_rad: FloatArray) -> FloatArray:
    """Unit vectors (rings, azimuths, 3) along a LiDAR's rays, in the lidar frame."""
    e, a = elevations_rad[:, None], azimuths_rad[None, :]
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e) + 0.0 * a], axis=-1)


@dataclass(frozen=True)
class Intrinsics:
    """Pinhole intrinsics in pixels."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float


@dataclass(frozen=True)
class Image:
    """Picture with depth, taken at `stamp_s` from frame `camera_frame`.

    `colour` is (H, W, 3) RGB, or None for a grey camera; `grey` is (H, W). `depth_m` is the depth in metres along the
    optical axis, 0 where it is unknown. `depth_intrinsics` registers it to the picture: same pose, perhaps fewer
    pixels. `frames` is the frame tree at capture time. Arrays that were not requested have the shape (0, 0).
    """

    stamp_s: float
    source: str
    camera_frame: str
    intrinsics: Intrinsics
    depth_intrinsics: Intrinsics
    colour: NDArray[np.uint8] | None
    grey: NDArray[np.uint8]
    depth_m: NDArray[np.float32]
    frames: FrameTree


@dataclass(frozen=True)
class Joints:
    """Joint state by name: position (rad), velocity (rad/s), effort (N m); m, m/s and N for joints that slide."""

    stamp_s: float
    position_rad: Mapping[str, float]
    velocity_rad_s: Mapping[str, float]
    effort_nm: Mapping[str, float]


@dataclass(frozen=True)
class Gripper:
    """Opening (0 closed; see `GripperKind`), force at the tips (N), and whether it reports that it holds an object."""

    stamp_s: float
    opening: float
    force_n: float
    holding: bool


@dataclass(frozen=True)
class Battery:
    """State of charge from 0 to 1."""

    stamp_s: float
    charge: float


@dataclass(frozen=True)
class DoorHandle:
    """Handle of a door that the robot faces: its position (x, y, z) in the body frame (m).

    `hinge_left`: the hinges are on the left, else on the right. `pull`: the door opens towards the robot, else away
    from it.
    """

    p_BH: tuple[float, float, float]
    hinge_left: bool
    pull: bool


@dataclass(frozen=True)
class ArmTrajectory:
    """Joint positions (K, arm joints) at times from the start (K,), interpolated linearly.

    The constructor raises ValueError when shapes do not match, times do not increase or positions are not finite.
    """

    times_s: FloatArray
    positions_rad: FloatArray

    def __post_init__(self) -> None:
        if self.times_s.ndim != 1 or self.positions_rad.ndim != 2 or len(self.times_s) != len(self.positions_rad):
            raise ValueError("ArmTrajectory: times_s must be (K,) and positions_rad (K, joints)")
        if len(self.times_s) == 0 or np.any(np.diff(self.times_s) <= 0) or not np.all(np.isfinite(self.positions_rad)):
            raise ValueError("ArmTrajectory: times_s must increase and positions be finite")


class CommandState(enum.Enum):
    """State of a command."""

    RUNNING = "running"  # accepted and being carried out
    DONE = "done"  # reached its goal (a drive: its expiry)
    STOPPED = "stopped"  # replaced, stopped or expired before the goal
    REFUSED = "refused"  # never started: lease, limits, fault


class CommandCause(enum.Enum):
    """Cause for which a command did not succeed; it decides how a caller can react."""

    NONE = "none"  # it runs, or it succeeded
    INVALID = "invalid"  # its values are not allowed: command something else
    UNSUPPORTED = "unsupported"  # the robot has no such part or ability
    NO_LEASE = "no lease"  # another holds the lease
    STOPPED = "stopped"  # another command replaced or stopped it
    LATE = "late"  # its time was over before it was done
    BLOCKED = "blocked"  # something is in the way, or the goal is out of reach
    UNPOWERED = "unpowered"  # the motors have no power
    ESTOPPED = "estopped"  # an E-stop is pressed
    FAULT = "fault"  # the robot has a fault, or has fallen: a person must see to it
    NO_ANSWER = "no answer"  # the robot does not answer: it may have moved
    REFUSED = "refused"  # any other refusal


@dataclass(frozen=True)
class CommandStatus:
    """State of a command; when it did not succeed, also the reason in words and the cause."""

    state: CommandState
    reason: str = ""
    cause: CommandCause = CommandCause.NONE


@dataclass(frozen=True)
class Lease:
    """Right to move a robot. Within an epoch, only the lease with the highest `number` is valid.

    The robot's computer chooses a new `epoch` whenever it starts: leases of earlier epochs stay invalid.
    """

    robot_name: str
    holder: str
    number: int = 0
    epoch: str = ""


class Clock(Protocol):
    """Clock of the robot. A plant's clock steps the simulation; a real robot's clock waits."""

    def now(self) -> float:
        """Returns the seconds since the clock began."""

    def advance(self, dt_s: float) -> None:
        """Lets dt_s seconds pass."""


class Robot(Protocol):
    """Interface of one robot. Motion verbs return at once with a command id for `command_status`."""

    @property
    def name(self) -> str:
        """Name of the robot, as a person addresses it: "Hey Alice"."""

    def capabilities(self) -> Capabilities:
        """Returns the robot's geometry and limits."""

    def odometry(self) -> Odometry:
        """Returns the latest dead reckoning."""

    def own_localisation(self) -> OwnLocalisation | None:
        """Returns the pose in the robot's own map, None while unlocalised; only with `Capabilities.localises`."""

    def imu(self) -> Imu | None:
        """Returns the latest inertial measurement; None when the robot has no IMU."""

    def scan(self) -> Scan | None:
        """Returns the latest LiDAR revolution; None before the first one."""

    def image(self, source: str, *, visual: bool = True, depth: bool = True) -> Image:
        """Takes a picture with depth, or only one of the two (`visual`, `depth`); may block.

        Raises ValueError when there is no such source, and NoImageError when the camera returns no picture this time.
        """

    def joints(self) -> Joints:
        """Returns the latest joint state."""

    def gripper(self) -> Gripper:
        """Returns the latest gripper state."""

    def battery(self) -> Battery:
        """Returns the latest battery state."""

    def faults(self) -> tuple[str, ...]:
        """Returns the present faults; an empty tuple when there are none."""

    def drive(self, vx: float, vy: float, wz: float, *, until_s: float, lease: Lease) -> CommandId:
        """Drives at a body-frame velocity (m/s, m/s, rad/s) until the clock reads `until_s`.

        The body keeps the posture of the last `stand`.
        """

    def stand(self, height_m: float, pitch_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Holds the body origin at a height above the floor and a pitch (positive looks down).

        A later `drive` keeps this posture; on receiving `stand`, a robot may end a drive that is still running.
        """

    def sit(self, *, until_s: float, lease: Lease) -> CommandId:
        """Lowers the body to the floor."""

    def dock(self, station: int, *, until_s: float, lease: Lease) -> CommandId:
        """Docks at the nearby docking station with this number; refused without `Capabilities.docks`."""

    def undock(self, *, until_s: float, lease: Lease) -> CommandId:
        """Stands up and leaves the docking station; refused without `Capabilities.docks`."""

    def open_door(self, handle: DoorHandle, *, until_s: float, lease: Lease) -> CommandId:
        """Opens a door with the arm and walks through; refused without `Capabilities.opens_doors`."""

    def move_arm(self, trajectory: ArmTrajectory, *, until_s: float, lease: Lease) -> CommandId:
        """Follows a joint trajectory; done when the arm rests at the last position."""

    def point_head(self, pan_rad: float, tilt_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Turns the head to pan and tilt angles (see `HeadCapabilities`); done when the head rests there."""

    def set_gripper(self, opening: float, force_n: float, *, until_s: float, lease: Lease) -> CommandId:
        """Moves the gripper to an opening with at most force_n at its tip and keeps it; done when there or blocked."""

    def carry(self, holding: bool, *, lease: Lease) -> None:
        """Tells the robot whether the gripper holds an object that it must keep when communication is lost."""

    def stop(self, *, lease: Lease, only: CommandId | None = None) -> CommandId:
        """Stops all motion, or only the command `only` if it still runs; the gripper keeps its clamp force."""

    def command_status(self, command: CommandId) -> CommandStatus:
        """Returns the status of a command. Raises KeyError for an unknown id."""

    def lease_holder(self) -> Lease | None:
        """Returns the valid lease; None while nobody holds one."""

    def acquire_lease(self, holder: str) -> Lease:
        """Takes a free lease. Raises LeaseError when another holds it."""

    def take_lease(self, holder: str) -> Lease:
        """Takes the lease away from its holder; the robot stops."""

    def return_lease(self, lease: Lease) -> None:
        """Returns the lease; the robot stops. Ignores a lease that is no longer valid."""


@dataclass(frozen=True)
class ConnectedRobot:
    """Robot that a backend has connected, its clock, and `notes` on its sensors for the report.

    `make_ready` makes the robot stand. It is called just before a run, because a standing robot needs commands all the
    time, while planning and loading take long.
    """

    robot: Robot
    clock: Clock
    make_ready: Callable[[], None] = lambda: None
    notes: tuple[str, ...] = ()


class RobotBackend(Protocol):
    """Connects to robots of one make. Its fields are the options of an address: `spot://HOST?power_on=yes`."""

    def connect(self, address: str, name: str) -> AbstractContextManager[ConnectedRobot]:
        """Connects to the robot at an address without scheme and options; `name` is its name in missions.

        At exit, also when the block raises, the robot is left in the state in which it was found. Raises InputError
        when the robot cannot be reached or is not ready.
        """


class NoImageError(RuntimeError):
    """Error of a camera that returns no picture this time; a later call may succeed."""


class LeaseError(RuntimeError):
    """Error raised when another client holds the lease."""


class RobotStoppedError(RuntimeError):
    """Error of a robot that has stopped for good, for example by its E-stop; the run ends."""
