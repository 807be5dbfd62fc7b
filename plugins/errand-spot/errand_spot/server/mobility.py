"""Motions of the base: stand, sit, drive at a velocity, drive to poses, stop."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, Final

import numpy as np
from bosdyn.api import basic_command_pb2, mobility_command_pb2, robot_command_pb2
from bosdyn.api.spot import robot_command_pb2 as spot_command_pb2
from pydrake.math import RigidTransform

from errand_spot.messages import InvalidRequestError, finite, points_of, seconds, transform
from errand_spot.server.computer import PERIOD_S, Computer, Snapshot
from skills.robot import FloatArray, Pose2D

Status = basic_command_pb2.RobotCommandFeedbackStatus
Answer = robot_command_pb2.RobotCommandResponse
Feedback = mobility_command_pb2.MobilityCommand.Feedback
LONGEST_S: Final = 600.0
_GAIN_1_S: Final = 1.5
_NEAR_M, _NEAR_RAD = 0.02, 0.03
_STILL_M_S, _STILL_RAD_S = 0.02, 0.04
_USUAL_M_S, _USUAL_RAD_S = 0.8, 1.0
FLAT_FRAMES: Final = ("odom", "vision", "body", "flat_body", "gpe")
"""Frames in which a planar motion may be given."""


class RefusedError(Exception):
    """Error of a refused command, with a status of the API and the reason."""

    def __init__(self, status: int, message: str) -> None:
        self.status = status
        super().__init__(message)


def unsupported(command: str) -> RefusedError:
    """Returns the error of a command that the simulated robot cannot do."""
    return RefusedError(Answer.STATUS_UNSUPPORTED, f"{command} is not simulated")


def unknown_frame(name: str) -> RefusedError:
    """Returns the error of a command in a frame that the robot does not know."""
    return RefusedError(Answer.STATUS_UNKNOWN_FRAME, f"frame {name!r} is unknown")


def end_of(message: Any, now_s: float, name: str) -> float:
    """Returns a command's end time (robot time). Raises RefusedError or InvalidRequestError."""
    if not message.HasField("end_time"):
        raise InvalidRequestError(f"{name}: end_time is missing")
    end_s = seconds(message.end_time)
    if end_s <= now_s:
        raise RefusedError(Answer.STATUS_EXPIRED, f"{name}: end_time was {now_s - end_s:.2f} s ago")
    return now_s + soon(end_s - now_s, f"{name}: end_time")


def soon(ahead_s: float, name: str) -> float:
    """Returns the duration until a time (s), 0 for a past one. Raises RefusedError for one too far ahead."""
    if ahead_s > LONGEST_S:
        said = f"{name} is {ahead_s:.0f} s ahead; at most {LONGEST_S:.0f} s are allowed"
        raise RefusedError(Answer.STATUS_TOO_DISTANT, said)
    return max(0.0, ahead_s)


class BaseMotion:
    """Motion of the base, with its feedback. Other threads read `feedback`, which is replaced whole."""

    field: ClassVar[str]
    """Field of the feedback."""

    def __init__(self) -> None:
        self.status: int = Status.STATUS_PROCESSING
        self.feedback = self._made()

    def begin(self, computer: Computer) -> None:
        """Starts it."""

    def tick(self, computer: Computer) -> None:
        """Goes on with it after a step."""

    @property
    def moving(self) -> bool:
        """Returns whether the base is to move on."""
        return False

    def end(self, status: int) -> None:
        """Ends it with a status."""
        if self.status == Status.STATUS_PROCESSING:
            self.status = status
        self.feedback = self._made(self._part())

    def _part(self) -> Any:
        return getattr(self.feedback, self.field)

    def _made(self, part: Any = None) -> Any:
        made = Feedback(status=self.status)
        getattr(made, self.field).SetInParent()
        if part is not None:
            getattr(made, self.field).CopyFrom(part)
        return made


class Stand(BaseMotion):
    """Stands at the height and pitch of the mobility parameters."""

    field = "stand_feedback"

    def __init__(self, height_m: float, pitch_rad: float) -> None:
        self._height_m, self._pitch_rad = height_m, pitch_rad
        super().__init__()

    def begin(self, computer: Computer) -> None:
        """Starts to stand up."""
        self._command = computer.stand(self._height_m, self._pitch_rad)
        self.tick(computer)

    def tick(self, computer: Computer) -> None:
        """Reports whether the robot stands."""
        done = computer.stands(self._command, self._height_m)
        part = basic_command_pb2.StandCommand.Feedback
        self.feedback = self._made(
            part(
                status=part.STATUS_IS_STANDING if done else part.STATUS_IN_PROGRESS,
                standing_state=part.STANDING_CONTROLLED if done else part.STANDING_UNKNOWN,
            )
        )


class Sit(BaseMotion):
    """Sits down."""

    field = "sit_feedback"

    def begin(self, computer: Computer) -> None:
        """Starts to sit down."""
        computer.sit()

    def tick(self, computer: Computer) -> None:
        """Reports whether the robot sits."""
        part = basic_command_pb2.SitCommand.Feedback
        sits = computer.snapshot.sitting
        self.feedback = self._made(part(status=part.STATUS_IS_SITTING if sits else part.STATUS_IN_PROGRESS))


class Halt(BaseMotion):
    """Stops, freezes, or stays in its stance."""

    def __init__(self, field: str) -> None:
        self.field = field  # type: ignore[misc]
        super().__init__()
        if field == "stance_feedback":
            part = basic_command_pb2.StanceCommand.Feedback
            self.feedback = self._made(part(status=part.STATUS_STANCED))

    def begin(self, computer: Computer) -> None:
        """Stops the base where it is."""
        computer.robot.drive(0.0, 0.0, 0.0, until_s=computer.clock.now() + 0.2, lease=computer.lease)


class _Driving(BaseMotion):
    """Drives until its end; then it has timed out."""

    end_s: float

    @property
    def moving(self) -> bool:
        """Returns whether it drives."""
        return bool(self.status == Status.STATUS_PROCESSING)

    def tick(self, computer: Computer) -> None:
        """Drives on."""
        if self.status == Status.STATUS_PROCESSING and computer.left_s(self.end_s) <= 0.0:
            self.end(Status.STATUS_COMMAND_TIMED_OUT)
        if self.status == Status.STATUS_PROCESSING:
            self._drive(computer)

    def _drive(self, computer: Computer) -> None:
        raise NotImplementedError

    def _posture(self, computer: Computer, params: Any) -> None:
        """Stands up if the robot sits, at the height and pitch of the parameters."""
        if computer.sits or params.HasField("body_control"):
            computer.stand(*posture(params, computer))


class Velocity(_Driving):
    """Drives at a velocity (m/s, m/s, rad/s) in a frame."""

    field = "se2_velocity_feedback"

    def __init__(self, request: Any, params: Any, end_s: float) -> None:
        v = request.velocity
        self._velocity = tuple(
            finite(value, f"se2_velocity_request.velocity.{name}")
            for name, value in (("linear.x", v.linear.x), ("linear.y", v.linear.y), ("angular", v.angular))
        )
        self._frame, self._params, self.end_s = known_frame(request.se2_frame_name), params, end_s
        self._limit = speed_limit(params)
        super().__init__()

    def begin(self, computer: Computer) -> None:
        """Starts to drive."""
        self._posture(computer, self._params)
        self._drive(computer)

    def _drive(self, computer: Computer) -> None:
        vx, vy, wz = self._velocity
        turn_rad = _yaw(computer.snapshot.X_AB("body", self._frame))
        ahead = math.cos(turn_rad) * vx - math.sin(turn_rad) * vy
        aside = math.sin(turn_rad) * vx + math.cos(turn_rad) * vy
        drive(computer, self._limit(np.array([ahead, aside, wz])), self.end_s)


class Trajectory(_Driving):
    """Drives along poses in a frame, and stops at the last."""

    field = "se2_trajectory_feedback"
    at_goal: Final[int] = basic_command_pb2.SE2TrajectoryCommand.Feedback.STATUS_AT_GOAL

    def __init__(self, request: Any, params: Any, end_s: float, snapshot: Snapshot) -> None:
        """Takes the poses over into `odom`, in which they stay."""
        frame = known_frame(request.se2_frame_name)
        points = points_of(request.trajectory, "se2_trajectory_request.trajectory")
        X_OF = snapshot.X_AB("odom", frame)
        self._poses = [Pose2D.from_transform(X_OF @ _planar(point.pose)) for point in points]
        self._times_s = [seconds(point.time_since_reference) for point in points]
        if any(later < earlier for earlier, later in zip(self._times_s, self._times_s[1:], strict=False)):
            raise InvalidRequestError("se2_trajectory_request.trajectory: the times of its points must increase")
        self._params, self.end_s, self._limit = params, end_s, speed_limit(params)
        self._begun_s = 0.0
        super().__init__()

    def begin(self, computer: Computer) -> None:
        """Starts to drive."""
        self._begun_s = computer.now_s()
        self._posture(computer, self._params)
        self._drive(computer)

    def _drive(self, computer: Computer) -> None:
        odometry, goal = computer.snapshot.odometry, self._poses[-1]
        error = error_to(odometry.pose, self._target(computer.now_s() - self._begun_s))
        to_goal, speed = error_to(odometry.pose, goal), np.abs(odometry.velocity)
        arrived = bool(math.hypot(*to_goal[:2]) < _NEAR_M and abs(to_goal[2]) < _NEAR_RAD)
        still = bool(speed[:2].max() < _STILL_M_S and speed[2] < _STILL_RAD_S)
        part = basic_command_pb2.SE2TrajectoryCommand.Feedback
        self.feedback = self._made(
            part(
                status=self.at_goal if arrived and still else part.STATUS_GOING_TO_GOAL,
                body_movement_status=part.BODY_STATUS_SETTLED if still else part.BODY_STATUS_MOVING,
                final_goal_status=part.FINAL_GOAL_STATUS_ACHIEVABLE if arrived else part.FINAL_GOAL_STATUS_IN_PROGRESS,
            )
        )
        velocity = np.zeros(3) if arrived else self._limit(_GAIN_1_S * error)
        drive(computer, velocity, self.end_s)

    @property
    def moving(self) -> bool:
        """Returns whether it drives and is not at its last pose."""
        return super().moving and bool(self._part().status != self.at_goal)

    def _target(self, since_s: float) -> Pose2D:
        """Pose at a time since the start: with one pose this one, else between two."""
        later = next((k for k, time_s in enumerate(self._times_s) if time_s > since_s), len(self._poses) - 1)
        return self._poses[later]


def way_to(goal_O: Pose2D, end_s: float, snapshot: Snapshot) -> Trajectory:
    """Returns a motion straight to a pose in `odom`, until a robot time."""
    request = basic_command_pb2.SE2TrajectoryCommand.Request(se2_frame_name="odom")
    goal = request.trajectory.points.add().pose
    goal.position.x, goal.position.y, goal.angle = goal_O.x_m, goal_O.y_m, goal_O.yaw_rad
    return Trajectory(request, spot_command_pb2.MobilityParams(), end_s, snapshot)


def error_to(pose: Pose2D, goal: Pose2D) -> FloatArray:
    """Way from a pose to a goal in the pose's frame: ahead (m), to the left (m), turn (rad)."""
    dx, dy = goal.x_m - pose.x_m, goal.y_m - pose.y_m
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return np.array([c * dx + s * dy, c * dy - s * dx, math.remainder(goal.yaw_rad - pose.yaw_rad, math.tau)])


def drive(computer: Computer, velocity: FloatArray, end_s: float) -> None:
    """Drives until an end (robot time), or for two steps, so that a late plant does not overrun the end."""
    until_s = min(computer.until_s(end_s), computer.clock.now() + 2.0 * PERIOD_S)
    vx, vy, wz = (float(value) for value in velocity)
    computer.robot.drive(vx, vy, wz, until_s=until_s, lease=computer.lease)


def _planar(message: Any) -> RigidTransform:
    x, y = (finite(getattr(message.position, axis), f"pose.position.{axis}") for axis in "xy")
    return Pose2D(x, y, finite(message.angle, "pose.angle")).transform()


def _yaw(X_AB: RigidTransform) -> float:
    return Pose2D.from_transform(X_AB).yaw_rad


def known_frame(name: str) -> str:
    """Returns the frame of a planar motion. Raises RefusedError."""
    if name not in FLAT_FRAMES:
        raise unknown_frame(name)
    return name


def mobility_params(request: Any) -> Any:
    """Returns the mobility parameters of a request. Raises InvalidRequestError."""
    params = spot_command_pb2.MobilityParams()
    if request.HasField("params") and not request.params.Unpack(params):
        raise InvalidRequestError(f"mobility_command.params is a {request.params.TypeName()}, not a MobilityParams")
    return params


def posture(params: Any, computer: Computer) -> tuple[float, float]:
    """Height (m) and pitch (rad) of the body by the mobility parameters, within the robot's range."""
    can = computer.capabilities
    X = RigidTransform()
    if (points := params.body_control.base_offset_rt_footprint.points) and len(points):
        X = transform(points[0].pose, "body_control.base_offset_rt_footprint")
    r = X.rotation().matrix()
    pitch_rad = math.atan2(-r[2, 0], math.hypot(r[0, 0], r[1, 0]))
    height_m = can.standing_height_m + float(X.translation()[2])
    return float(np.clip(height_m, *can.height_range_m)), float(np.clip(pitch_rad, *can.pitch_range_rad))


def speed_limit(params: Any) -> Callable[[FloatArray], FloatArray]:
    """Returns a function that limits velocities (3,) by the parameters, or to usual speeds."""
    most, least = np.array([_USUAL_M_S, _USUAL_M_S, _USUAL_RAD_S]), -np.array([_USUAL_M_S, _USUAL_M_S, _USUAL_RAD_S])
    for name, limits in (("max_vel", most), ("min_vel", least)):
        if params.HasField("vel_limit") and params.vel_limit.HasField(name):
            given = getattr(params.vel_limit, name)
            limits[:] = given.linear.x, given.linear.y, given.angular
    if not (np.isfinite(most).all() and np.isfinite(least).all()):
        raise InvalidRequestError("mobility_command.params.vel_limit must be finite")
    return lambda velocity: np.clip(velocity, np.minimum(least, most), np.maximum(least, most))
