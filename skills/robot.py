"""Robot protocol: the interface through which skills see a robot. Its verbs follow the Spot SDK.

Every motion command carries an expiry time on the robot's clock: a robot that hears nothing stops by itself. Sense
verbs return the latest immutable stamped snapshot and never block, except `image` (ask for it through the `Worker`).

Frames: `odom` (O) is fixed to the floor where the robot woke up and drifts against the world (W); `body` (B) is x
forward, y left, z up at the centre of the hips, or at the centre of a wheeled base's axle and moving up and down with
its torso; `hand` (H) is the last arm link, x along the fingers, z along their closing; `head` (on a robot with one)
turns with it; `<source>_camera` (C) is z forward, x right, y down; `lidar` (L). `X_AB` is the pose of frame B in frame
A. SI units throughout.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
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
"""Number of a motion command, by which its status is asked for."""


@dataclass(frozen=True)
class Pose2D:
    """Planar pose: x_m, y_m, yaw_rad (counter-clockwise from x)."""

    x_m: Coordinate
    y_m: Coordinate
    yaw_rad: Angle

    def transform(self, z_m: float = 0.0) -> RigidTransform:
        """Returns the same pose as a RigidTransform at height z_m."""
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

    @property
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
    """LiDAR revolution: ranges_m[ring, azimuth] with NaN for no return, angles in the lidar frame, X_BL."""

    stamp_s: float
    ranges_m: NDArray[np.float32]
    elevations_rad: FloatArray
    azimuths_rad: FloatArray
    X_BL: RigidTransform
    X_OB: RigidTransform

    def repeats(self, other: Scan) -> bool:
        """Returns whether all ranges equal those of another scan, noise included."""
        ranges, others = self.ranges_m, other.ranges_m
        if ranges is others:
            return True
        first = slice(0, 1)  # as a rule noise differs in the first ring already
        equal = (np.array_equal(ranges[part], others[part], equal_nan=True) for part in (first, slice(None)))
        return all(equal)

    def points_B(self) -> FloatArray:
        """Returns the valid returns as an (N, 3) array in the body frame."""
        ranges = self.ranges_m.astype(np.float64)
        points_L = (unit_rays(self.elevations_rad, self.azimuths_rad) * ranges[..., None])[np.isfinite(ranges)]
        return np.asarray(points_L @ self.X_BL.rotation().matrix().T + self.X_BL.translation())


def unit_rays(elevations_rad: FloatArray, azimuths_rad: FloatArray) -> FloatArray:
    """Unit vectors (rings, azimuths, 3) of a LiDAR's rays in its frame."""
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

    `colour` is (H, W, 3) RGB, or None for a grey camera; `grey` is (H, W). `depth_m` is in metres along the optical
    axis, 0 where there is none, registered to the picture by `depth_intrinsics` (same pose, perhaps fewer pixels).
    `frames` is the frame tree at capture time. Arrays that were not asked for have the shape (0, 0).
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
    """Opening (0 closed; see `GripperKind`), clamp force at the tips (N), whether it believes to hold an object."""

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
    """Handle of a door before the robot: its position (x, y, z) in the body frame (m), as the robot faces the door.

    The door's hinges are on the left (`hinge_left`) or on the right, and it opens towards the robot (`pull`) or away.
    """

    p_BH: tuple[float, float, float]
    hinge_left: bool
    pull: bool


@dataclass(frozen=True)
class ArmTrajectory:
    """Joint positions (K, arm joints) at times from the start (K,), interpolated linearly. Raises ValueError."""

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
    """Cause for which a command did not succeed; it says what can be done about it."""

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
    """State of a command, with the reason and its cause when it did not succeed."""

    state: CommandState
    reason: str = ""
    cause: CommandCause = CommandCause.NONE


@dataclass(frozen=True)
class Lease:
    """Right to move a robot. Of an epoch the one with the highest `number` counts.

    The robot's computer chooses another `epoch` whenever it starts: a lease of an earlier one never counts again.
    """

    robot_name: str
    holder: str
    number: int = 0
    epoch: str = ""


class Clock(Protocol):
    """Clock of the robot. A plant's clock steps the simulation, a real robot's waits."""

    def now(self) -> float:
        """Returns the seconds since the clock began."""

    def advance(self, dt_s: float) -> None:
        """Lets dt_s seconds pass."""


class Robot(Protocol):
    """Interface of one robot. Motion verbs return at once with a command id for `command_status`."""

    @property
    def name(self) -> str:
        """Name of the robot, as in "Hey Alice"."""

    def capabilities(self) -> Capabilities:
        """Returns the robot's geometry and limits."""

    def odometry(self) -> Odometry:
        """Returns the latest dead reckoning."""

    def own_localisation(self) -> OwnLocalisation | None:
        """Returns the robot's place in its own map, None while it knows none; only where `Capabilities.localises`."""

    def imu(self) -> Imu | None:
        """Returns the latest inertial measurement; None if the robot gives none."""

    def scan(self) -> Scan | None:
        """Returns the latest LiDAR revolution, None before the first."""

    def image(self, source: str, *, visual: bool = True, depth: bool = True) -> Image:
        """Takes a picture with depth now, or only one of the two; may block.

        Raises ValueError when there is no such source, NoImageError when the camera gives no picture just now.
        """

    def joints(self) -> Joints:
        """Returns the latest joint state."""

    def gripper(self) -> Gripper:
        """Returns the latest gripper state."""

    def battery(self) -> Battery:
        """Returns the latest battery state."""

    def faults(self) -> tuple[str, ...]:
        """Returns the present faults, an empty tuple when there are none."""

    def drive(self, vx: float, vy: float, wz: float, *, until_s: float, lease: Lease) -> CommandId:
        """Drives at a body-frame velocity (m/s, m/s, rad/s) until the clock reads until_s.

        The body keeps the posture that was last asked for.
        """

    def stand(self, height_m: float, pitch_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Holds the body origin at a height above the floor and a pitch (positive looks down).

        A drive that comes later takes the posture over; a robot may end an earlier one.
        """

    def sit(self, *, until_s: float, lease: Lease) -> CommandId:
        """Lowers the body to the floor."""

    def dock(self, station: int, *, until_s: float, lease: Lease) -> CommandId:
        """Docks at the docking station of a number, nearby; only where `Capabilities.docks`, else refused."""

    def undock(self, *, until_s: float, lease: Lease) -> CommandId:
        """Stands up and leaves the docking station; refused like `dock`."""

    def open_door(self, handle: DoorHandle, *, until_s: float, lease: Lease) -> CommandId:
        """Opens a door with the arm and walks through; only where `Capabilities.opens_doors`, else refused."""

    def move_arm(self, trajectory: ArmTrajectory, *, until_s: float, lease: Lease) -> CommandId:
        """Follows a joint trajectory; done when the arm is still at its end."""

    def point_head(self, pan_rad: float, tilt_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Turns the head to angles of `HeadCapabilities`; done when it is there and still."""

    def set_gripper(self, opening: float, force_n: float, *, until_s: float, lease: Lease) -> CommandId:
        """Moves the gripper to an opening with at most force_n at its tip, which stays; done when there or blocked."""

    def carry(self, holding: bool, *, lease: Lease) -> None:
        """Says whether the gripper holds an object that it must keep when the communication is lost."""

    def stop(self, *, lease: Lease, only: CommandId | None = None) -> CommandId:
        """Stops all motion, or only the given command if it still runs; the gripper keeps its clamp force."""

    def command_status(self, command: CommandId) -> CommandStatus:
        """Returns the status of a command. Raises KeyError for an unknown id."""

    def lease_holder(self) -> Lease | None:
        """Returns the lease that counts now; None while it is free."""

    def acquire_lease(self, holder: str) -> Lease:
        """Takes a free lease. Raises LeaseError when another holds it."""

    def take_lease(self, holder: str) -> Lease:
        """Takes the lease from its holder; the robot stops."""

    def return_lease(self, lease: Lease) -> None:
        """Returns the lease; the robot stops. Ignores a lease that was taken away."""


@dataclass(frozen=True)
class ConnectedRobot:
    """Robot that a backend has connected, its clock, and what the report says about its sensors.

    `make_ready` lets it stand. It is called just before a run, because a robot that is ready must hear something all
    the time, and planning and loading take long.
    """

    robot: Robot
    clock: Clock
    make_ready: Callable[[], None] = lambda: None
    notes: tuple[str, ...] = ()


class NoImageError(RuntimeError):
    """Error of a camera that gives no picture just now; it may do so again."""


class LeaseError(RuntimeError):
    """Error of a lease that another holds."""


class RobotStoppedError(RuntimeError):
    """Error of a robot that has stopped for good, by its E-stop for example; the run ends."""
