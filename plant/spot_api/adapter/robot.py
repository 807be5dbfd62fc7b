"""A Spot behind the Robot protocol, driven through its API.

Readings are those of the last `poll`; commands are sent at once and followed by `poll`. The robot's clock of the
protocol begins when the connection is made.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import Any, Final

import numpy as np
from bosdyn.api import (
    arm_command_pb2,
    basic_command_pb2,
    gripper_command_pb2,
    image_pb2,
    lease_pb2,
    manipulation_api_pb2,
    mobility_command_pb2,
    point_cloud_pb2,
    robot_command_pb2,
    robot_state_pb2,
)
from bosdyn.client.robot_command import RobotCommandBuilder
from bosdyn.geometry import EulerZXY
from pydrake.math import RigidTransform

from plant.spot_api.adapter.answers import CAUSES, status_of
from plant.spot_api.adapter.connection import Connection, LostError, RobotClock
from plant.spot_api.adapter.readings import TIP_RADIUS_M, Readings, picture, readings, scan
from plant.spot_api.messages import frames_of, pose_between
from skills.robot import (
    ArmTrajectory,
    Battery,
    Capabilities,
    CommandCause,
    CommandId,
    CommandState,
    CommandStatus,
    FrameTree,
    Gripper,
    Image,
    Imu,
    Joints,
    Lease,
    LeaseError,
    NoImageError,
    Odometry,
    Scan,
)

DRIVE_EXPIRY_S: Final = 0.6
FASTEST_M_S, FASTEST_RAD_S = 0.8, 1.0
OLD_STATE_S, SILENT_S = 0.5, 3.0
_SYNCHRONISED_EVERY_S: Final = 10.0
_RETAIN_S: Final = 1.0
_SCAN_S: Final = 0.09
_MOST_POINTS: Final = 250
_LIDAR: Final = "velodyne-point-cloud"
Answer = robot_command_pb2.RobotCommandResponse


@dataclass
class _Sent:
    """A command that was sent: its number at the robot and the part that it moves; `status` is the last known."""

    number: int
    part: str
    status: CommandStatus = field(default_factory=lambda: CommandStatus(CommandState.RUNNING))
    until_s: float = math.inf


class ApiRobot:
    """Spot, through a connection. Implements `skills.robot.Robot`."""

    def __init__(self, name: str, connection: Connection, clock: RobotClock, capabilities: Capabilities) -> None:
        """Reads the robot's first state. Raises LostError."""
        self._name, self._connection, self._clock = name, connection, clock
        self._capabilities = replace(capabilities, drive_expiry_s=DRIVE_EXPIRY_S)
        self._lock = Lock()
        self._sent: dict[CommandId, _Sent] = {}
        self._next, self._lease_number, self._retained_s, self._synchronised_s = 1, 0, -math.inf, clock.now()
        self._current: Lease | None = None
        self._posture = (capabilities.standing_height_m, 0.0)
        self._scan: Scan | None = None
        self._carries: bool | None = None  # what the robot has yet to hear
        self._readings = self._read()

    # -- know and sense ----------------------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self._name

    def capabilities(self) -> Capabilities:
        """Capabilities of Spot."""
        return self._capabilities

    def odometry(self) -> Odometry:
        """Latest dead reckoning."""
        return self._readings.odometry

    def imu(self) -> Imu | None:
        """Returns None: the API gives no inertial readings."""
        return None

    def scan(self) -> Scan | None:
        """Latest LiDAR revolution, None before the first."""
        return self._scan

    def joints(self) -> Joints:
        """Latest joint state."""
        return self._readings.joints

    def gripper(self) -> Gripper:
        """Latest gripper state."""
        return self._readings.gripper

    def battery(self) -> Battery:
        """Latest battery state."""
        return self._readings.battery

    @property
    def powered(self) -> bool:
        """Returns whether the motors have power."""
        return self._readings.powered

    def faults(self) -> tuple[str, ...]:
        """Present faults, with a pressed E-stop and a robot that does not answer."""
        stopped = () if self._readings.released else ("the E-stop is pressed",)
        silent_s = self._clock.now() - self._readings.stamp_s
        silent = (f"the robot has not answered for {silent_s:.0f} s",) if silent_s > SILENT_S else ()
        return (*self._readings.faults, *stopped, *silent)

    def image(self, source: str, *, visual: bool = True, depth: bool = True) -> Image:
        """Takes a picture with depth, or only one of the two. Raises ValueError and NoImageError."""
        camera = next((each for each in self._capabilities.cameras if each.source == source), None)
        if camera is None:
            raise ValueError(f"there is no camera {source!r}")
        hand = source == "hand"
        names = ["hand_color_image" if hand else f"{source}_fisheye_image"] if visual else []
        names += ["hand_depth_in_hand_color_frame" if hand else f"{source}_depth"] if depth else []
        Pixels = image_pb2.Image
        request = image_pb2.GetImageRequest()
        for name in names:
            is_depth = "_depth" in name
            form = Pixels.FORMAT_RAW if is_depth else Pixels.FORMAT_JPEG
            request.image_requests.add(image_source_name=name, image_format=form, quality_percent=95.0)
        try:
            answers = self._connection.call("image", "GetImage", request, timeout_s=2.0).image_responses
        except LostError as error:
            raise NoImageError(str(error)) from error
        first = answers[0].shot
        frames = self._frame_tree(frames_of(first.transforms_snapshot))
        stamp_s = self._stamp(first.acquisition_time)
        return picture(source, f"{source}_camera", answers, stamp_s, frames, coloured=hand)

    def _frame_tree(self, frames: Any) -> FrameTree:
        """The protocol's frames from those of the API; heights are over the feet."""
        X_OB = self._readings.odometry.X_OB if "odom" not in frames else pose_between(frames, "odom", "body")
        x, y, _ = X_OB.translation()
        X_OB.set_translation([x, y, self._readings.odometry.X_OB.translation()[2]])
        made = {"body": ("odom", X_OB)}
        if "arm0.link_wr1" in frames:
            made["hand"] = ("body", pose_between(frames, "body", "arm0.link_wr1"))
        for camera in self._capabilities.cameras:
            made[f"{camera.source}_camera"] = ("hand" if camera.on_hand else "body", camera.X_FC)
        return FrameTree(made)

    # -- act ---------------------------------------------------------------------------------------------------------

    def drive(self, vx: float, vy: float, wz: float, *, until_s: float, lease: Lease) -> CommandId:
        """Drives at a body-frame velocity; the robot stops by itself at `until_s`, or 0.6 s from now."""
        if not all(map(math.isfinite, (vx, vy, wz))):
            return self._refused(f"drive: velocity ({vx}, {vy}, {wz}) is not finite", CommandCause.INVALID)
        end_s = min(until_s, self._clock.now() + DRIVE_EXPIRY_S)
        command = RobotCommandBuilder.synchro_velocity_command(vx, vy, wz, params=self._params())
        return self._send(command, "base", lease, end_s=end_s)

    def stand(self, height_m: float, pitch_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Holds the body origin at a height above the floor and a pitch."""
        before, self._posture = self._posture, (height_m, pitch_rad)
        command = RobotCommandBuilder.synchro_stand_command(params=self._params())
        sent = self._send(command, "posture", lease, until_s)
        if self.command_status(sent).state is CommandState.REFUSED:
            self._posture = before
        return sent

    def sit(self, *, until_s: float, lease: Lease) -> CommandId:
        """Lowers the body to the floor."""
        return self._send(RobotCommandBuilder.synchro_sit_command(), "posture", lease, until_s)

    def move_arm(self, trajectory: ArmTrajectory, *, until_s: float, lease: Lease) -> CommandId:
        """Follows a joint trajectory; done when the robot says so."""
        keep = np.unique(np.linspace(0, len(trajectory.times_s) - 1, _MOST_POINTS).astype(int))
        times, positions = trajectory.times_s[keep], trajectory.positions_rad[keep]
        made = arm_command_pb2.ArmJointMoveCommand.Request()
        for time_s, q in zip(times, positions, strict=True):
            point = made.trajectory.points.add()
            point.time_since_reference.FromNanoseconds(round(max(0.0, float(time_s)) * 1e9))
            for joint, value in zip(("sh0", "sh1", "el0", "el1", "wr0", "wr1"), q, strict=True):
                getattr(point.position, joint).value = float(value)
        made.trajectory.maximum_velocity.value, made.trajectory.maximum_acceleration.value = 2.5, 15.0
        made.trajectory.reference_time.FromNanoseconds(round(self._clock.robot_time_s() * 1e9))
        command = robot_command_pb2.RobotCommand()
        command.synchronized_command.arm_command.arm_joint_move_command.CopyFrom(made)
        return self._send(command, "arm", lease, until_s)

    def point_head(self, pan_rad: float, tilt_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Refuses: Spot has no head."""
        return self._refused("point_head: the robot has no head", CommandCause.UNSUPPORTED)

    def set_gripper(self, opening: float, force_n: float, *, until_s: float, lease: Lease) -> CommandId:
        """Moves the gripper to an opening with at most force_n at its tip."""
        made = gripper_command_pb2.ClawGripperCommand.Request()
        made.trajectory.points.add(point=-opening)
        made.maximum_torque.value = force_n * TIP_RADIUS_M
        command = robot_command_pb2.RobotCommand()
        command.synchronized_command.gripper_command.claw_gripper_command.CopyFrom(made)
        return self._send(command, "gripper", lease, until_s)

    def carry(self, holding: bool, *, lease: Lease) -> None:
        """Says whether the robot keeps what it holds when the communication is lost; said again until it answers."""
        if lease == self._current:
            self._carries = holding
            self._say_carry()

    def _say_carry(self) -> None:
        State, request = robot_state_pb2.ManipulatorState, manipulation_api_pb2.ApiGraspOverrideRequest()
        carried, free = State.CARRY_STATE_CARRIABLE, State.CARRY_STATE_NOT_CARRIABLE
        request.carry_state_override.override_request = carried if self._carries else free
        try:
            self._connection.call("manipulation", "OverrideGrasp", request)
        except LostError as error:
            if error.cause is CommandCause.NO_ANSWER:
                return
        self._carries = None

    def stop(self, *, lease: Lease, only: CommandId | None = None) -> CommandId:
        """Stops base and arm, or only the part of a command; the gripper keeps its clamp force."""
        with self._lock:
            part = self._sent[only].part if only is not None and only in self._sent else None
            running = only is None or (part is not None and self._sent[only].status.state is CommandState.RUNNING)
        if not running:
            return self._noted(CommandStatus(CommandState.DONE))
        command = robot_command_pb2.RobotCommand()
        if part in (None, "base", "posture"):
            stop = mobility_command_pb2.MobilityCommand.Request(stop_request=basic_command_pb2.StopCommand.Request())
            command.synchronized_command.mobility_command.CopyFrom(stop)
        if part in (None, "arm"):
            command.MergeFrom(_arm_stop())
        if part == "gripper":
            return self._noted(CommandStatus(CommandState.DONE))
        stopped = self._send(command, part or "all", lease, math.inf)
        with self._lock:
            for sent in self._sent.values():
                mine = sent.part == part if part else sent.part != "gripper"
                if mine and sent.status.state is CommandState.RUNNING:
                    sent.status = CommandStatus(CommandState.STOPPED, "stopped by command", CommandCause.STOPPED)
            if self._sent[stopped].status.state is CommandState.STOPPED:
                self._sent[stopped].status = CommandStatus(CommandState.DONE)
        return stopped

    def command_status(self, command: CommandId) -> CommandStatus:
        """Returns the last known status of a command. Raises KeyError for an unknown id."""
        with self._lock:
            return self._sent[command].status

    # -- own ---------------------------------------------------------------------------------------------------------

    def lease_holder(self) -> Lease | None:
        """Lease that counts now, as far as the robot has said."""
        return self._current

    def acquire_lease(self, holder: str) -> Lease:
        """Takes the lease within this program, and acquires the robot's. Raises LeaseError when another has it."""
        if self._current is not None:
            raise LeaseError(f"{self._name}: the lease is held by {self._current.holder!r}")
        return self._own(holder, take=False)

    def take_lease(self, holder: str) -> Lease:
        """Takes the lease from its holder, another client included. Raises LeaseError when the robot refuses."""
        return self._own(holder, take=True)

    def _own(self, holder: str, *, take: bool) -> Lease:
        try:
            if self._connection.lease is None:
                self._connection.acquire(take=take)
        except LostError as error:
            raise LeaseError(f"{self._name}: {error}") from error
        self._lease_number += 1
        self._current = Lease(self._name, holder, self._lease_number, self._connection.lease.epoch)
        return self._current

    def return_lease(self, lease: Lease) -> None:
        """Returns the lease; the robot stops. The robot's own lease is kept until the connection is closed."""
        if lease == self._current:
            self.stop(lease=lease)
            self._current = None

    # -- upkeep ------------------------------------------------------------------------------------------------------

    def poll(self) -> None:
        """Reads state and LiDAR, follows the commands that run, and retains lease and clock.

        What the robot does not answer keeps its last value: old readings stop the drive, and are a fault later.
        """
        with suppress(LostError):
            self._readings = self._read()
            if self._connection.has_lidar and (self._scan is None or self._clock.now() - self._scan.stamp_s > _SCAN_S):
                self._scan = self._read_scan()
            with self._lock:
                running = [sent for sent in self._sent.values() if sent.status.state is CommandState.RUNNING]
            for sent in running:
                self._follow(sent)
            if self._carries is not None:
                self._say_carry()
            now_s = self._clock.now()
            if self._connection.lease is not None and now_s - self._retained_s > _RETAIN_S:
                self._retained_s = now_s
                if not self._connection.retain():
                    self._current, self._connection.lease = None, None
            if now_s - self._synchronised_s > _SYNCHRONISED_EVERY_S:
                self._connection.synchronise()
                self._synchronised_s = now_s

    def _read(self) -> Readings:
        state = self._connection.state()
        return readings(state, self._stamp(state.kinematic_state.acquisition_timestamp), self._capabilities)

    def _stamp(self, message: Any) -> float:
        """Time of a message on the protocol's clock."""
        return self._clock.now() - (self._clock.robot_time_s() - float(message.seconds) - float(message.nanos) * 1e-9)

    def _read_scan(self) -> Scan | None:
        request = point_cloud_pb2.GetPointCloudRequest()
        request.point_cloud_requests.add(
            point_cloud_source_name=_LIDAR, cloud_type=point_cloud_pb2.PointCloudRequest.CLOUD_TYPE_POINTS
        )
        (answer,) = self._connection.call(_LIDAR, "GetPointCloud", request).point_cloud_responses
        if answer.status != point_cloud_pb2.PointCloudResponse.STATUS_OK:
            return self._scan
        cloud, source = answer.point_cloud, answer.point_cloud.source
        frames = frames_of(source.transforms_snapshot)
        points = np.frombuffer(cloud.data, np.float32).reshape(-1, 3).astype(np.float64)
        X_BF = pose_between(frames, "body", source.frame_name_sensor)
        X_BL = self._X_BL()
        points_L = (X_BL.inverse() @ X_BF @ points.T).T
        X_OB = pose_between(frames, "odom", "body")
        return scan(points_L, self._stamp(source.acquisition_time), X_BL, X_OB)

    def _X_BL(self) -> RigidTransform:
        """Pose of the LiDAR on the rear rails, as in the description."""
        height_m = (self._capabilities.lidar_height_m or 0.0) - self._capabilities.standing_height_m
        return RigidTransform([-0.2, 0.0, height_m])

    def _follow(self, sent: _Sent) -> None:
        """Reads how far a command has come."""
        request = robot_command_pb2.RobotCommandFeedbackRequest(robot_command_id=sent.number)
        answer = self._connection.call("robot-command", "RobotCommandFeedback", request).feedback
        status = status_of(answer.synchronized_feedback, sent.part)
        if status.state is CommandState.RUNNING and self._clock.now() >= sent.until_s:
            status = CommandStatus(CommandState.STOPPED, "expired before it was done", CommandCause.LATE)
        with self._lock:
            if sent.status.state is not CommandState.RUNNING:
                return
            sent.status = status
        if status.state is CommandState.STOPPED and sent.part == "arm" and self._current is not None:
            self._send(_arm_stop(), "arm", self._current)  # the API's arm commands have no end of their own

    # -- inside ------------------------------------------------------------------------------------------------------

    def _params(self) -> Any:
        """Mobility parameters with the posture last asked for, and limits of speed."""
        height_m, pitch_rad = self._posture
        params = RobotCommandBuilder.mobility_params(
            body_height=height_m - self._capabilities.standing_height_m, footprint_R_body=EulerZXY(pitch=pitch_rad)
        )
        for limit, sign in ((params.vel_limit.max_vel, 1.0), (params.vel_limit.min_vel, -1.0)):
            limit.linear.x = limit.linear.y = sign * FASTEST_M_S
            limit.angular = sign * FASTEST_RAD_S
        return params

    def _send(
        self, command: Any, part: str, lease: Lease, until_s: float = math.inf, *, end_s: float | None = None
    ) -> CommandId:
        if lease != self._current:
            gone = f"{part}: lease {lease.number} of {lease.holder!r} no longer counts"
            return self._refused(gone, CommandCause.NO_LEASE)
        now_s = self._clock.now()
        if min(until_s, math.inf if end_s is None else end_s) <= now_s:
            late = f"{part}: expires at {until_s:.2f} s, and it is {now_s:.2f} s already"
            return self._refused(late, CommandCause.LATE)
        if part == "base" and end_s is not None:
            if now_s - self._readings.stamp_s > OLD_STATE_S:
                old = f"drive: the last state is {now_s - self._readings.stamp_s:.1f} s old"
                return self._refused(old, CommandCause.NO_ANSWER)
            end = self._clock.robot_time_s() + end_s - now_s
            given = command.synchronized_command.mobility_command.se2_velocity_request
            given.end_time.FromNanoseconds(round(end * 1e9))
        try:
            answer = self._connection.command(command)
        except LostError as error:
            return self._refused(f"{part}: {error}", error.cause)
        if answer.lease_use_result.status not in (0, lease_pb2.LeaseUseResult.STATUS_OK):
            owner = answer.lease_use_result.owner.client_name or "another client"
            self._current, self._connection.lease = None, None
            return self._refused(f"{part}: the lease is held by {owner}", CommandCause.NO_LEASE)
        if answer.status != Answer.STATUS_OK:
            why = answer.message or Answer.Status.Name(answer.status)
            return self._refused(f"{part}: {why}", CAUSES.get(answer.status, CommandCause.REFUSED))
        made = _Sent(answer.robot_command_id, part, until_s=until_s if end_s is None else math.inf)
        with self._lock:
            for sent in self._sent.values():
                same = sent.part == part or {sent.part, part} <= {"base", "posture"}
                if same and sent.status.state is CommandState.RUNNING:
                    sent.status = CommandStatus(
                        CommandState.STOPPED, "replaced by another command", CommandCause.STOPPED
                    )
            return self._kept(made)

    def _refused(self, reason: str, cause: CommandCause) -> CommandId:
        return self._noted(CommandStatus(CommandState.REFUSED, reason, cause))

    def _noted(self, status: CommandStatus) -> CommandId:
        with self._lock:
            return self._kept(_Sent(0, "", status))

    def _kept(self, sent: _Sent) -> CommandId:
        number, self._next = CommandId(self._next), self._next + 1
        self._sent[number] = sent
        while len(self._sent) > 1000:
            del self._sent[next(iter(self._sent))]
        return number


def _arm_stop() -> Any:
    command = robot_command_pb2.RobotCommand()
    command.synchronized_command.arm_command.arm_stop_command.SetInParent()
    return command
