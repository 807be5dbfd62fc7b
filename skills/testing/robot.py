"""Kinematic robot with the whole Robot protocol: expiry, lease, limits, LiDAR, depth, arm, gripper."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from skills.command_table import Active, LeaseManager, ScriptedCommands, refusal_of
from skills.faults.fault_kinds import joints_under_pull
from skills.geometry import compose
from skills.manipulation.arm.kinematics import ArmModel, arm_model
from skills.robot import (
    ArmTrajectory,
    BaseKind,
    Battery,
    Capabilities,
    CommandCause,
    CommandId,
    CommandState,
    CommandStatus,
    DoorHandle,
    FloatArray,
    FrameTree,
    Gripper,
    Image,
    Imu,
    Joints,
    Lease,
    Odometry,
    Pose2D,
    Scan,
)
from skills.testing.blocks import FRONT_CAMERAS, Block, can_at, mount_of, take_picture, take_scan
from skills.testing.clock import VirtualClock

_ACCELERATION_M_S2 = 2.5
_BRAKING_M_S2 = 8.0
_RISE_M_S = 0.4
_GRIPPER_RAD_S = 3.0
_ARM_RAD_S = 4.0
_SCAN_PERIOD_S = 0.1
_TRAJECTORY_START_RAD = 0.25
_BATTERY_RUNTIME_S = 5400.0
_CHARGING_S = 600.0
_FINGER_M = 0.03
_LEAST_CLAMP_N = 2.0

BASE_ONLY = Capabilities(
    footprint_m=((0.55, 0.25), (-0.55, 0.25), (-0.55, -0.25), (0.55, -0.25)),
    max_speed_m_s=1.6,
    max_turn_rate_rad_s=2.0,
    standing_height_m=0.52,
    height_range_m=(0.4, 0.6),
    pitch_range_rad=(-0.3, 0.3),
    arm=None,
    gripper=None,
    cameras=FRONT_CAMERAS,
    description="",
)
"""A mobile base with two cameras and no arm."""


@dataclass(frozen=True)
class Start:
    """Initial state: true pose in the world, arm angles (default: stowed), gripper, charge.

    `in_gripper_rad` is the opening at which a closing gripper touches an object between its fingers (None: no object).
    With `holding` the gripper starts closed around the object. A `docked` robot charges. From `pulled_at_s` on, a
    person pulls at the object.
    """

    pose: Pose2D = field(default_factory=lambda: Pose2D(0.0, 0.0, 0.0))
    arm_rad: tuple[float, ...] | None = None
    in_gripper_rad: float | None = None
    holding: bool = False
    charge: float = 0.9
    docked: bool = False
    pulled_at_s: float | None = None


class ScriptedRobot:
    """Robot that moves exactly as commanded, without a real robot's safety functions; `calls` records the verbs used.

    It drives through the `blocks` of its world, but can pick and place loose ones. A grip of less than 2 N drops the
    object. Odometry is exact except for `odometry_scale` and `yaw_drift_rad_per_m`. `lidar` is the number of azimuths
    and the noise (m); `fine_camera` is the camera with a fine lens. It moves when its clock advances. Implements
    `skills.robot.Robot`.
    """

    def __init__(
        self,
        clock: VirtualClock,
        *,
        name: str = "Alice",
        capabilities: Capabilities = BASE_ONLY,
        blocks: Sequence[Block] = (),
        start: Start | None = None,
        seed: int = 0,
    ) -> None:
        start = start or Start()
        self._name, self._capabilities, self._clock = name, capabilities, clock
        self.blocks = list(blocks)
        self.pose, self.odometry_pose = start.pose, Pose2D(0.0, 0.0, 0.0)
        self.velocity: FloatArray = np.zeros(3)
        self.odometry_scale, self.yaw_drift_rad_per_m, self.lidar = 1.0, 0.0, (360, 0.01)
        self.fine_camera = capabilities.object_camera
        self.height_m, self.pitch_rad, self.head_rad = capabilities.standing_height_m, 0.0, (0.0, 0.0)
        arm = capabilities.arm
        self.q_rad = np.array([] if arm is None else start.arm_rad or arm.stowed_rad[: len(arm.joint_names)])
        self.opening = (start.in_gripper_rad or 0.3) if start.holding else 0.0
        self.in_gripper_rad = self.opening if start.holding else start.in_gripper_rad
        self.clamp_force_n = 20.0 if start.holding else 0.0
        self.held: Block | None = can_at(0.0, 0.0, 0.0) if start.holding else None
        self.carries, self._leases = False, LeaseManager(name)
        self._hangs_down_m = 0.057  # of the held object, below the fingers' middle
        self.charge, self.docked, self._pulled_at_s = start.charge, start.docked, start.pulled_at_s
        self.present_faults: tuple[str, ...] = ()
        self.refuse_because: dict[str, str] = {}
        self.refusal_cause = CommandCause.REFUSED
        self.calls: list[str] = []
        self._commands, self._rng = ScriptedCommands(), np.random.default_rng(seed)
        self._scan: Scan | None = None
        clock.attach(self._pass_time)

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self._name

    @property
    def arm(self) -> ArmModel:
        """Kinematics of the arm. Raises ValueError when the robot has no arm."""
        return arm_model(self._capabilities)

    @property
    def holding(self) -> bool:
        """Returns whether the gripper is closed around an object."""
        met_rad = self.in_gripper_rad
        return met_rad is not None and self.clamp_force_n > 0.0 and self.opening <= met_rad + 0.02

    def capabilities(self) -> Capabilities:
        """Capabilities of the robot."""
        return self._capabilities

    def odometry(self) -> Odometry:
        """Latest dead reckoning."""
        self.calls.append("odometry")
        vx, vy, wz = self.velocity.tolist()
        return Odometry(self._clock.now(), self._X_OB(), (vx, vy, wz))

    def own_localisation(self) -> None:
        """Returns None: the robot has no map of its own."""
        self.calls.append("own_localisation")

    def imu(self) -> Imu:
        """Latest inertial measurement: at rest except for the turn rate."""
        self.calls.append("imu")
        return Imu(self._clock.now(), (0.0, 0.0, float(self.velocity[2])), (0.0, 0.0, 9.81))

    def scan(self) -> Scan | None:
        """Latest LiDAR scan, at 10 Hz."""
        self.calls.append("scan")
        now_s = self._clock.now()
        if self._scan is None or now_s - self._scan.stamp_s > _SCAN_PERIOD_S - 1e-9:
            self._scan = take_scan(self.blocks, self._X_WB(), self._X_OB(), now_s, self._rng, *self.lidar)
        return self._scan

    def image(self, source: str, *, visual: bool = True, depth: bool = True) -> Image:
        """Takes a picture with colour and depth, whatever is requested. Raises ValueError for an unknown source."""
        self.calls.append("image")
        cameras = {each.source: each for each in self._capabilities.cameras}
        if (camera := cameras.get(source)) is None:
            raise ValueError(f"{self._name} has no camera '{source}'; it has {', '.join(cameras)}")
        mount = mount_of(camera, fine=camera is self.fine_camera)
        edges = {"body": ("odom", self._X_OB())}
        if self._capabilities.arm is not None:
            edges["hand"] = ("body", self.arm.X_BH(self.q_rad))
        if self._capabilities.head is not None:
            edges["head"] = ("body", self._capabilities.head.X_BF(*self.head_rad))
        X_BF = FrameTree(edges).pose(mount.frame, "body")
        stamp_s = self._clock.now()
        return take_picture(self.blocks, self._X_WB() @ X_BF, mount, FrameTree(edges), source, stamp_s, self._rng)

    def joints(self) -> Joints:
        """Latest joint state."""
        self.calls.append("joints")
        names = () if self._capabilities.arm is None else self._capabilities.arm.joint_names
        position = dict(zip(names, self.q_rad.tolist(), strict=True))
        if self._capabilities.head is not None:
            position |= dict(zip(self._capabilities.head.joint_names, self.head_rad, strict=True))
        still = dict.fromkeys(position, 0.0)
        joints = Joints(self._clock.now(), position, still, still)
        is_pulled = self._pulled_at_s is not None and joints.stamp_s >= self._pulled_at_s
        return joints_under_pull(joints, self._capabilities) if is_pulled else joints

    def gripper(self) -> Gripper:
        """Latest gripper state."""
        self.calls.append("gripper")
        return Gripper(self._clock.now(), self.opening, self.clamp_force_n if self.holding else 0.0, self.holding)

    def battery(self) -> Battery:
        """Latest battery state."""
        self.calls.append("battery")
        return Battery(self._clock.now(), self.charge)

    def faults(self) -> tuple[str, ...]:
        """Present faults; an empty tuple when there are none."""
        self.calls.append("faults")
        return self.present_faults

    def drive(self, vx: float, vy: float, wz: float, *, until_s: float, lease: Lease) -> CommandId:
        """Drives at a body-frame velocity until the clock reads until_s."""
        sideways = vy != 0.0 and self._capabilities.base_kind is BaseKind.DIFFERENTIAL
        fault, velocity = "this base cannot go sideways" if sideways else "", np.array([vx, vy, wz])
        return self._begin("drive", velocity, until_s, lease, fault, values=(vx, vy, wz))

    def stand(self, height_m: float, pitch_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Holds the body origin at a height above the floor and a pitch."""
        low, high = self._capabilities.height_range_m
        fault = "" if low <= height_m <= high else f"height {height_m:.2f} m is not in [{low}, {high}]"
        return self._begin("stand", (height_m, pitch_rad), until_s, lease, fault)

    def sit(self, *, until_s: float, lease: Lease) -> CommandId:
        """Lowers the body to the floor."""
        return self._begin("stand", (0.2, 0.0), until_s, lease, verb="sit")

    def dock(self, station: int, *, until_s: float, lease: Lease) -> CommandId:
        """Refuses: there is no docking station."""
        return self._begin("dock", station, until_s, lease, lacks="there is no docking station")

    def undock(self, *, until_s: float, lease: Lease) -> CommandId:
        """Refuses: there is no docking station."""
        return self._begin("undock", None, until_s, lease, lacks="there is no docking station")

    def open_door(self, handle: DoorHandle, *, until_s: float, lease: Lease) -> CommandId:
        """Refuses: there is no door command."""
        return self._begin("open_door", handle, until_s, lease, lacks="there is no door command")

    def move_arm(self, trajectory: ArmTrajectory, *, until_s: float, lease: Lease) -> CommandId:
        """Follows a joint trajectory that begins near the arm's angles."""
        lacks, goal = "there is no arm" if self._capabilities.arm is None else "", (trajectory, self.q_rad.copy())
        return self._begin("move_arm", goal, until_s, lease, "" if lacks else self._arm_fault(trajectory), lacks=lacks)

    def _arm_fault(self, trajectory: ArmTrajectory) -> str:
        """Reason why the arm cannot follow a trajectory; empty when it can."""
        if trajectory.positions_rad.shape[1] != len(self.q_rad):
            return f"the arm has {len(self.q_rad)} joints, not {trajectory.positions_rad.shape[1]}"
        off = float(np.max(np.abs(trajectory.positions_rad[0] - self.q_rad)))
        near = off <= _TRAJECTORY_START_RAD + _ARM_RAD_S * float(trajectory.times_s[0])
        return "" if near else "the trajectory does not begin where the arm is"

    def point_head(self, pan_rad: float, tilt_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Points the head, which arrives at once."""
        head = self._capabilities.head
        fault, lacks = (None, "there is no head") if head is None else (head.refusal(pan_rad, tilt_rad), "")
        return self._begin("point_head", (pan_rad, tilt_rad), until_s, lease, fault, lacks=lacks)

    def set_gripper(self, opening: float, force_n: float, *, until_s: float, lease: Lease) -> CommandId:
        """Moves the gripper, which stops at an object between its fingers."""
        gripper = self._capabilities.gripper
        fault, lacks = (None, "there is no gripper") if gripper is None else (gripper.refusal(opening, force_n), "")
        return self._begin("set_gripper", (opening, force_n), until_s, lease, fault, lacks=lacks)

    def carry(self, holding: bool, *, lease: Lease) -> None:
        """Notes whether the gripper must keep its object."""
        self.calls.append("carry")
        if lease == self._leases.current:
            self.carries = holding

    def stop(self, *, lease: Lease, only: CommandId | None = None) -> CommandId:
        """Stops all motion, or only the given command; the gripper keeps its force."""
        self.calls.append("stop")
        if lease != self._leases.current:
            return self._commands.refuse("the lease was taken away", CommandCause.NO_LEASE)
        self._commands.stop(only)
        return self._commands.note(CommandState.DONE)

    def command_status(self, command: CommandId) -> CommandStatus:
        """Status of a command. Raises KeyError for an unknown id."""
        self.calls.append("command_status")
        return self._commands.status(command)

    def acquire_lease(self, holder: str) -> Lease:
        """Takes a free lease. Raises LeaseError when another holds it."""
        return self._leases.acquire(holder)

    def take_lease(self, holder: str) -> Lease:
        """Takes the lease away from its holder; the robot stops."""
        self._commands.stop(None, CommandCause.NO_LEASE)
        return self._leases.take(holder)

    def return_lease(self, lease: Lease) -> None:
        """Returns the lease; the robot stops."""
        self.calls.append("return_lease")
        if self._leases.give_back(lease):
            self._commands.stop(None, CommandCause.NO_LEASE)

    def lease_holder(self) -> Lease | None:
        """Valid lease; None while nobody holds one."""
        return self._leases.current

    @property
    def moving_parts(self) -> tuple[str, ...]:
        """Parts that truly move now: "drive", "stand", "move_arm", "point_head", "set_gripper"."""
        driving = ("drive",) if float(np.max(np.abs(self.velocity))) > 0.01 else ()
        return (*driving, *(part for part in self._commands.moving_parts if part != "drive"))

    def _begin(
        self,
        part: str,
        goal: object,
        until_s: float,
        lease: Lease,
        fault: str | None = None,
        *,
        values: Iterable[float] = (),
        lacks: str = "",
        verb: str = "",
    ) -> CommandId:
        self.calls.append(verb := verb or part)
        now_s, taken = self._clock.now(), None if lease == self._leases.current else "the lease was taken away"
        refusals = (
            refusal_of(verb, taken, values, until_s=until_s, now_s=now_s),
            (lacks, CommandCause.UNSUPPORTED),
            (fault, CommandCause.INVALID),
            (self.refuse_because.get(verb), self.refusal_cause),
        )
        for why, cause in filter(None, refusals):
            if why:
                return self._commands.refuse(why, cause)
        return self._commands.begin(part, goal, now_s, until_s)

    def _X_WB(self) -> RigidTransform:
        return self._tilted(self.pose, self.height_m, self.pitch_rad)

    def _X_OB(self) -> RigidTransform:
        return self._tilted(self.odometry_pose, self.height_m, self.pitch_rad)

    @staticmethod
    @lru_cache(maxsize=64)  # the same object as long as nothing moves, so that the pose of a context is cached, too
    def _tilted(pose: Pose2D, height_m: float, pitch_rad: float) -> RigidTransform:
        level = pose.transform(height_m)
        return level @ RigidTransform(RotationMatrix.MakeYRotation(pitch_rad)) if pitch_rad else level

    def _pass_time(self, dt_s: float) -> None:
        self._commands.expire(self._clock.now())
        if "drive" in self._commands.moving_parts or self.velocity.any():
            self._move_base(dt_s)
        moves = self._move_body, self._move_arm, self._move_head, self._move_gripper
        for part, move in zip(("stand", "move_arm", "point_head", "set_gripper"), moves, strict=True):
            if (active := self._commands.running(part)) is not None:
                move(active, dt_s)
        used = -dt_s / _CHARGING_S if self.docked else dt_s / _BATTERY_RUNTIME_S
        self.charge = min(1.0, max(0.0, self.charge - used))

    def _accelerate(self, dt_s: float) -> None:
        """Accelerates towards the commanded velocity; brakes harder without a command."""
        active = self._commands.running("drive")
        wanted = 0.0 if active is None else active.goal
        most = (_BRAKING_M_S2 if active is None else _ACCELERATION_M_S2) * dt_s
        self.velocity = self.velocity + (wanted - self.velocity).clip(-most, most)

    def _move_base(self, dt_s: float) -> None:
        self._accelerate(dt_s)
        x, y, turn = (self.velocity * dt_s).tolist()
        self.pose = compose(self.pose, Pose2D(x, y, turn))
        scale, drift = self.odometry_scale, self.yaw_drift_rad_per_m * math.hypot(x, y)
        self.odometry_pose = compose(self.odometry_pose, Pose2D(scale * x, scale * y, turn + drift))

    def _move_body(self, active: Active, dt_s: float) -> None:
        height_m, self.pitch_rad = active.goal
        off = height_m - self.height_m
        self.height_m += max(-_RISE_M_S * dt_s, min(_RISE_M_S * dt_s, off))
        if abs(height_m - self.height_m) < 1e-6:
            self._commands.finish("stand", CommandState.DONE)

    def _move_head(self, active: Active, dt_s: float) -> None:
        self.head_rad = active.goal
        self._commands.finish("point_head", CommandState.DONE)

    def _move_arm(self, active: Active, dt_s: float) -> None:
        trajectory, q_before = active.goal
        times, positions = trajectory.times_s, trajectory.positions_rad
        if times[0] > 0.0:
            times, positions = np.concatenate([[0.0], times]), np.vstack([q_before, positions])
        t, before = self._clock.now() - active.since_s, self.q_rad
        along = float(np.interp(t, times, np.arange(len(times))))
        here, there = positions[math.floor(along)], positions[math.ceil(along)]
        self.q_rad = here + (along % 1.0) * (there - here)
        if self.held is not None and self._below_fingers_m() < self._hangs_down_m:
            self.q_rad = before  # the held object stands already
        if t >= times[-1]:
            self._commands.finish("move_arm", CommandState.DONE)

    def _move_gripper(self, active: Active, dt_s: float) -> None:
        opening, self.clamp_force_n = active.goal
        if opening < self.opening and self.in_gripper_rad is None and self.clamp_force_n >= _LEAST_CLAMP_N:
            self._grasp()
        opens = self.in_gripper_rad is not None and opening > self.in_gripper_rad + 0.02
        if self.held is not None and (opens or self.clamp_force_n < _LEAST_CLAMP_N):
            self._release(self.held)
        before, least, most = self.opening, self.in_gripper_rad, _GRIPPER_RAD_S * dt_s
        self.opening += max(-most, min(most, opening - self.opening))
        if least is not None and before >= least > self.opening:
            self.opening = opening = least
        if abs(self.opening - opening) < 1e-6:
            self._commands.finish("set_gripper", CommandState.DONE)

    def _between_fingers_W(self) -> FloatArray:
        gripper = self._capabilities.gripper
        grip_m = 0.0 if gripper is None else gripper.grip_x_m
        return np.asarray(self._X_WB() @ self.arm.X_BH(self.q_rad) @ np.array([grip_m, 0.0, 0.0]))

    def _grasp(self) -> None:
        """Grasps the loose block between the fingers, if there is one."""
        gripper = self._capabilities.gripper
        place_W = self._between_fingers_W()
        block = next((b for b in self.blocks if b.loose and b.holds(place_W, _FINGER_M)), None)
        if block is None or gripper is None:
            return
        width_m = min(block.x1 - block.x0, block.y1 - block.y0)
        self.in_gripper_rad = gripper.widest * min(1.0, width_m / gripper.max_opening_m)
        self.held, self._hangs_down_m = block, float(place_W[2]) - block.z0
        self.blocks.remove(block)

    def _release(self, held: Block) -> None:
        """Puts the held block onto the block or floor below."""
        x, y, z = (float(v) for v in self._between_fingers_W())
        self.blocks.append(held.standing_at(x, y, z - self._below_fingers_m()))
        self.held = self.in_gripper_rad = None

    def _below_fingers_m(self) -> float:
        """Height (m) of the point between the fingers above the block or floor below."""
        x, y, z = (float(v) for v in self._between_fingers_W())
        tops = [b.z1 for b in self.blocks if b.x0 <= x <= b.x1 and b.y0 <= y <= b.y1 and b.z1 <= z]
        return z - max(tops, default=0.0)
