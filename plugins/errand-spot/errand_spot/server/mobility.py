"""Motions of the base: stand, sit, drive at a velocity, drive to poses, stop."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Final

import numpy as np
from bosdyn.api import basic_command_pb2, mobility_command_pb2, trajectory_pb2
from bosdyn.api.spot import robot_command_pb2 as spot_command_pb2
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from scipy.interpolate import PchipInterpolator, make_interp_spline

from errand_spot.messages import InvalidRequestError, duration, points_of
from errand_spot.server.computer import PERIOD_S, Computer, Snapshot
from errand_spot.server.obstacles import Clearance
from errand_spot.server.posture import Posture
from errand_spot.server.refusals import check_values, known_frame, times_of
from skills.geometry import compose, relative_pose
from skills.path import progress_m
from skills.robot import FloatArray, Pose2D

Status = basic_command_pb2.RobotCommandFeedbackStatus
Feedback = mobility_command_pb2.MobilityCommand.Feedback
Held = tuple[float, float] | None
"""Height (m) and pitch (rad) of a body that walks; None for those that it has."""
_GAIN_1_S: Final = 1.5
_NEAR_M, _NEAR_RAD = 0.02, 0.03
_STILL_M_S, _STILL_RAD_S = 0.02, 0.04
_USUAL_M_S, _USUAL_RAD_S, _PATH_M_S = 0.8, 1.0, 0.5
_SET_M, _SET_RAD, _MOVES = 0.006, 0.01, 0.05
"""Tolerances of a body over its feet, and the least velocity (m/s, rad/s) of a body that moves."""
_SHIFT_GAIN_1_S, _SHIFT_MOST = 2.0, 0.3
_STOPPING_M, _SLOPE_S = 0.2, 0.05
_STUCK_S, _PROGRESS = 1.5, 0.03
"""Time without progress (m plus rad) after which a robot counts as blocked."""
_STANCE_M, _STANCE_RAD = 0.5, 0.7
"""Farthest stance to which the robot steps."""
FEET_M: Final = {"fl": (0.32, 0.17), "fr": (0.32, -0.17), "hl": (-0.32, 0.17), "hr": (-0.32, -0.17)}
"""Positions of the feet around their middle."""
FLAT_FRAMES: Final = ("odom", "vision", "body", "flat_body", "gpe")
"""Frames in which a planar motion may be given."""


class BaseMotion:
    """Motion of the base, with its feedback. Other threads read `feedback`, which is replaced whole."""

    field: ClassVar[str]
    """Field of the feedback."""
    keeps_feet: ClassVar[bool] = False
    """Whether the feet stay where they are."""
    first: ClassVar[Any] = None
    """Part of the feedback before it begins."""

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
        if (part := part or self.first) is not None:
            getattr(made, self.field).CopyFrom(part)
        return made


class Stand(BaseMotion):
    """Stands in a posture; the feet stay where they are."""

    field, keeps_feet = "stand_feedback", True
    first = basic_command_pb2.StandCommand.Feedback(status=basic_command_pb2.StandCommand.Feedback.STATUS_IN_PROGRESS)

    def __init__(self, posture: Posture) -> None:
        self._posture = posture
        self._rows: FloatArray | None = None
        self._given: tuple[float, float] | None = None
        self._begun, self._begun_s, self._shifts = np.zeros(5), 0.0, False
        super().__init__()

    def begin(self, computer: Computer) -> None:
        """Starts to stand up, and to move the body."""
        self._begun_s = computer.now_s()
        X_OB = computer.snapshot.odometry.X_OB
        self._begun[3:] = X_OB.translation()[2], RollPitchYaw(X_OB.rotation()).pitch_angle()
        self.tick(computer)

    def tick(self, computer: Computer) -> None:
        """Moves the body on, and reports whether the robot stands in its last posture."""
        if self.status != Status.STATUS_PROCESSING:
            return
        odometry, since_s = computer.snapshot.odometry, computer.now_s() - self._begun_s
        if self._rows is None and float(np.abs(odometry.velocity).max()) < _MOVES:
            computer.feet_O = feet_O = computer.feet_O or odometry.pose
            body_F = relative_pose(feet_O, odometry.pose)
            self._begun[:3], self._rows = (body_F.x_m, body_F.y_m, body_F.yaw_rad), self._posture.rows(feet_O)
            planar = np.abs([*self._rows[:, :3], self._begun[:3]]).max(axis=0)
            self._shifts = bool(planar[:2].max() > _SET_M or planar[2] > _SET_RAD)
        posture = self._posture.last
        if self._rows is not None:
            values = self._posture.at(self._rows, self._begun, since_s)
            posture = float(values[3]), float(values[4])
            self._shift(computer, values[:3], over=since_s >= self._posture.ends_s)
        if self._given is None or math.dist(posture, self._given) > 1e-4:
            self._command, self._given = computer.stand(*posture), posture
        ended = self._rows is not None and since_s >= self._posture.ends_s and not self._shifts
        done = ended and computer.stands(self._command, posture[0])
        part = basic_command_pb2.StandCommand.Feedback
        status = part.STATUS_IS_STANDING if done else part.STATUS_IN_PROGRESS
        state = part.STANDING_CONTROLLED if done else part.STANDING_UNKNOWN
        self.feedback = self._made(part(status=status, standing_state=state))

    def _shift(self, computer: Computer, goal: FloatArray, *, over: bool) -> None:
        """Moves the body towards a pose over its feet, until it is there and its time is `over`."""
        feet_O = computer.feet_O
        if not self._shifts or feet_O is None:
            return
        odometry = computer.snapshot.odometry
        error = error_to(odometry.pose, compose(feet_O, Pose2D(*goal.tolist())))
        still = float(np.abs(odometry.velocity).max()) < _MOVES
        near = math.hypot(error[0], error[1]) < _SET_M and abs(error[2]) < _SET_RAD
        self._shifts = not (over and near and still)
        most = _SHIFT_MOST if self._shifts else 0.0
        drive(computer, np.clip(_SHIFT_GAIN_1_S * error, -most, most), math.inf)


class Sit(BaseMotion):
    """Sits down."""

    field, keeps_feet = "sit_feedback", True
    first = basic_command_pb2.SitCommand.Feedback(status=basic_command_pb2.SitCommand.Feedback.STATUS_IN_PROGRESS)

    def begin(self, computer: Computer) -> None:
        """Starts to sit down."""
        computer.sit()

    def tick(self, computer: Computer) -> None:
        """Reports whether the robot sits."""
        part = basic_command_pb2.SitCommand.Feedback
        sits = computer.snapshot.sitting
        self.feedback = self._made(part(status=part.STATUS_IS_SITTING if sits else part.STATUS_IN_PROGRESS))


class Halt(BaseMotion):
    """Stops or freezes."""

    keeps_feet = True

    def __init__(self, field: str) -> None:
        self.field = field  # type: ignore[misc]
        super().__init__()

    def begin(self, computer: Computer) -> None:
        """Stops the base where it is."""
        computer.robot.drive(0.0, 0.0, 0.0, until_s=computer.clock.now() + 0.2, lease=computer.lease)


class _Driving(BaseMotion):
    """Stands up if need be, then drives until its end; then it has timed out."""

    end_s: float
    posture: Held
    _stands = False
    _ready: Callable[[], bool]

    @property
    def moving(self) -> bool:
        """Returns whether it drives."""
        return bool(self.status == Status.STATUS_PROCESSING)

    def begin(self, computer: Computer) -> None:
        """Stands up if the robot does not stand, and in the posture of the command."""
        self._ready = computer.stand_first(self.posture)
        self.tick(computer)

    def tick(self, computer: Computer) -> None:
        """Drives on, from the time at which the robot stands."""
        if self.status == Status.STATUS_PROCESSING and computer.left_s(self.end_s) <= 0.0:
            self.end(Status.STATUS_COMMAND_TIMED_OUT)
        if self.status != Status.STATUS_PROCESSING or not (self._stands or self._ready()):
            return
        if not self._stands:
            self._stands = True
            self._start(computer)
        self._drive(computer)

    def _start(self, computer: Computer) -> None:
        """Prepares to drive."""
        raise NotImplementedError

    def _drive(self, computer: Computer) -> None:
        raise NotImplementedError


class Velocity(_Driving):
    """Drives at a velocity (m/s, m/s, rad/s) in a frame, and stops in front of obstacles."""

    field = "se2_velocity_feedback"

    def __init__(self, request: Any, params: Any, end_s: float, posture: Held = None) -> None:
        self._velocity = _velocity(request.velocity)
        slew = _velocity(request.slew_rate_limit)
        if slew.min() < 0.0:
            raise InvalidRequestError("se2_velocity_request.slew_rate_limit must not be negative")
        self._step, self._now = np.where(slew > 0.0, slew, math.inf) * PERIOD_S, np.zeros(3)
        self._frame, self.posture, self.end_s = known_frame(request.se2_frame_name, FLAT_FRAMES), posture, end_s
        self._limit, self._clearance = speed_limit(params), Clearance(params.obstacle_params)
        super().__init__()

    def _start(self, computer: Computer) -> None:
        """Begins with the velocity that the robot has."""
        self._now = self._turn(computer).T @ computer.snapshot.odometry.velocity

    def _drive(self, computer: Computer) -> None:
        self._now = self._now + np.clip(self._velocity - self._now, -self._step, self._step)
        wanted = self._limit(self._turn(computer) @ self._now)
        drive(computer, self._clearance.limit(computer, wanted), self.end_s)

    def _turn(self, computer: Computer) -> FloatArray:
        """Rotation (3, 3) of planar velocities from the command's frame to the body's."""
        yaw_rad = Pose2D.from_transform(computer.snapshot.X_AB("body", self._frame)).yaw_rad
        return np.asarray(RotationMatrix.MakeZRotation(yaw_rad).matrix())


class Trajectory(_Driving):
    """Drives along poses in a frame at their times, and stops at the last, or in front of an obstacle."""

    field = "se2_trajectory_feedback"
    Part: Final = basic_command_pb2.SE2TrajectoryCommand.Feedback
    _Going: Final = {"status": Part.STATUS_IN_PROGRESS, "body_movement_status": Part.BODY_STATUS_MOVING}
    first = Part(final_goal_status=Part.FINAL_GOAL_STATUS_IN_PROGRESS, **_Going)

    def __init__(self, request: Any, params: Any, end_s: float, snapshot: Snapshot, posture: Held = None) -> None:
        """Takes the poses over into `odom`, in which they stay. Raises RefusedError or InvalidRequestError."""
        field, X_OF = "se2_trajectory_request.trajectory", snapshot.X_OF(request.se2_frame_name, FLAT_FRAMES)
        poses = [Pose2D.from_transform(X_OF @ planar(point.pose)) for point in points_of(request.trajectory, field)]
        self._times_s, self._goal = times_of(request.trajectory, snapshot.time_s, field), poses[-1]
        self._rows = np.array([[pose.x_m, pose.y_m, pose.yaw_rad] for pose in poses])
        self._cubic = request.trajectory.interpolation == trajectory_pb2.POS_INTERP_CUBIC
        self.posture, self.end_s, self._limit = posture, end_s, speed_limit(params)
        self._clearance = Clearance(params.obstacle_params)
        self._begun_s, self._moved_s, self._moved_from = 0.0, 0.0, snapshot.odometry.pose
        super().__init__()

    def _start(self, computer: Computer) -> None:
        """Starts the clock of the path, here."""
        pose, self._begun_s = computer.snapshot.odometry.pose, computer.now_s()
        self._moved_s, self._moved_from = self._begun_s, pose
        ahead = [k for k, time_s in enumerate(self._times_s) if time_s > 0.0] or [len(self._times_s) - 1]
        times_s = np.array([0.0, *(self._times_s[k] for k in ahead)]) + 1e-6 * np.arange(len(ahead) + 1)
        rows = np.array([[pose.x_m, pose.y_m, pose.yaw_rad], *self._rows[ahead]])
        rows[:, 2] = np.unwrap(rows[:, 2])
        self._path = PchipInterpolator(times_s, rows) if self._cubic else make_interp_spline(times_s, rows, k=1)
        self._lasts_s = float(times_s[-1])

    def _drive(self, computer: Computer) -> None:
        odometry, now_s = computer.snapshot.odometry, computer.now_s()
        pose, speed, left_s = odometry.pose, np.abs(odometry.velocity), self._begun_s + self._times_s[-1] - now_s
        target, velocity = self._target(now_s - self._begun_s, pose)
        to_goal = error_to(pose, self._goal)
        far_m = math.hypot(*to_goal[:2])
        arrived = bool(left_s <= 0.0 and far_m < _NEAR_M and abs(to_goal[2]) < _NEAR_RAD)
        still = bool(speed[:2].max() < _STILL_M_S and speed[2] < _STILL_RAD_S)
        error = error_to(pose, target)
        velocity = np.zeros(3) if arrived else self._limit(velocity + _GAIN_1_S * error)
        drive(computer, self._clearance.limit(computer, velocity), self.end_s)
        part, blocked = self.Part, self.Part.FINAL_GOAL_STATUS_BLOCKED  # which lasts until the robot has moved
        status = part.STATUS_STOPPING if left_s <= 0.0 and far_m < _STOPPING_M else part.STATUS_IN_PROGRESS
        goal = part.FINAL_GOAL_STATUS_ACHIEVABLE if arrived else part.FINAL_GOAL_STATUS_IN_PROGRESS
        if self._stuck(error, pose, now_s) and (still or self._part().final_goal_status == blocked):
            goal = blocked
        if (still or goal == blocked) and goal != part.FINAL_GOAL_STATUS_IN_PROGRESS:
            status = part.STATUS_STOPPED
        rests = still and status == part.STATUS_STOPPED
        body = part.BODY_STATUS_SETTLED if rests else part.BODY_STATUS_MOVING
        self.feedback = self._made(part(status=status, body_movement_status=body, final_goal_status=goal))

    def _stuck(self, error: FloatArray, pose: Pose2D, now_s: float) -> bool:
        """Returns whether the robot is behind its path and has not moved for a while."""
        moved = error_to(self._moved_from, pose)
        if math.hypot(*moved[:2]) + abs(moved[2]) > _PROGRESS or np.abs(error).max() < 2.0 * _NEAR_RAD:
            self._moved_s, self._moved_from = now_s, pose
        return now_s - self._moved_s > _STUCK_S

    @property
    def moving(self) -> bool:
        """Returns whether it drives and has not stopped at its last pose, or in front of an obstacle."""
        return super().moving and bool(self._part().status != self.Part.STATUS_STOPPED)

    @property
    def arrived(self) -> bool:
        """Returns whether it has stopped at its last pose."""
        part = self._part()
        achieved = part.final_goal_status == self.Part.FINAL_GOAL_STATUS_ACHIEVABLE
        return bool(part.status == self.Part.STATUS_STOPPED and achieved)

    def _target(self, since_s: float, pose: Pose2D) -> tuple[Pose2D, FloatArray]:
        """Pose at a time since the start, and its velocity (3,) in the frame of the body at `pose`."""
        times_s = np.minimum([since_s, since_s + _SLOPE_S], self._lasts_s)
        here, there = self._path(times_s)
        vx, vy, wz = (there - here) / _SLOPE_S
        c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        return Pose2D(*here.tolist()), np.array([c * vx + s * vy, c * vy - s * vx, wz])


def way_to(poses_O: Sequence[Pose2D], end_s: float, snapshot: Snapshot, *, padding_m: float | None = 0.0) -> Trajectory:
    """Returns a motion straight to a pose in `odom`, or slowly along several, until a robot time.

    It stops in front of obstacles, at the usual distance or at `padding_m`; with None only before no-go regions.
    """
    request = basic_command_pb2.SE2TrajectoryCommand.Request(se2_frame_name="odom")
    params = spot_command_pb2.MobilityParams()
    rows = np.array([[each.x_m, each.y_m, each.yaw_rad] for each in poses_O])
    rows[:, 2] = np.unwrap(rows[:, 2])
    for (x, y, yaw), at_m in zip(rows.tolist(), progress_m(rows).tolist(), strict=True):
        point = request.trajectory.points.add(time_since_reference=duration(at_m / _PATH_M_S))
        point.pose.position.x, point.pose.position.y, point.pose.angle = x, y, yaw
    params.obstacle_params.disable_vision_body_obstacle_avoidance = padding_m is None
    params.obstacle_params.obstacle_avoidance_padding = padding_m or 0.0
    return Trajectory(request, params, end_s, snapshot)


class Stance(BaseMotion):
    """Steps until the feet stand where a client wants them, if they keep their distances and are near."""

    field = "stance_feedback"
    Part: Final = basic_command_pb2.StanceCommand.Feedback

    def __init__(self, request: Any, end_s: float, snapshot: Snapshot) -> None:
        """Raises RefusedError or InvalidRequestError."""
        stance, field = request.stance, "stance_request.stance"
        if set(stance.foot_positions) != set(FEET_M):
            raise InvalidRequestError(f"{field}.foot_positions: {', '.join(FEET_M)} are needed")
        pose_O = Pose2D.from_transform(snapshot.X_OF(stance.se2_frame_name, FLAT_FRAMES))
        places = [stance.foot_positions[foot] for foot in FEET_M]
        wanted = np.array([[p.x, p.y] for p in places])
        x, y = wanted.mean(axis=0)
        yaw = math.atan2(*(wanted[:2].mean(axis=0) - [x, y])[::-1])
        c, s = math.cos(yaw), math.sin(yaw)
        stands = [x, y] + np.array(list(FEET_M.values())) @ np.array([[c, s], [-s, c]])
        off_m = float(np.linalg.norm(stands - wanted, axis=1).max())
        goal_O = compose(pose_O, Pose2D(float(x), float(y), yaw))
        away = error_to(snapshot.odometry.pose, goal_O)
        near = math.hypot(*away[:2]) < _STANCE_M and abs(away[2]) < _STANCE_RAD
        fits = near and off_m < (stance.accuracy or 0.05)
        self._way = way_to([goal_O], end_s, snapshot) if fits else None
        super().__init__()
        self._report()

    def begin(self, computer: Computer) -> None:
        """Starts to step."""
        if self._way is not None:
            self._way.begin(computer)

    def tick(self, computer: Computer) -> None:
        """Steps on."""
        if self._way is not None and self.status == Status.STATUS_PROCESSING:
            self._way.tick(computer)
            self.status = self._way.status
            self._report()

    def _report(self) -> None:
        status = self.Part.STATUS_TOO_FAR_AWAY
        if self._way is not None:
            status = self.Part.STATUS_STANCED if self._way.arrived else self.Part.STATUS_GOING_TO_STANCE
        self.feedback = self._made(self.Part(status=status))


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


def planar(message: Any) -> RigidTransform:
    """Transform of a planar pose."""
    return Pose2D(message.position.x, message.position.y, message.angle).transform()


def _velocity(message: Any) -> FloatArray:
    return np.array([message.linear.x, message.linear.y, message.angular])


def mobility_params(request: Any) -> Any:
    """Returns the mobility parameters of a request. Raises InvalidRequestError."""
    params = spot_command_pb2.MobilityParams()
    if request.HasField("params") and not request.params.Unpack(params):
        raise InvalidRequestError(f"mobility_command.params is a {request.params.TypeName()}, not a MobilityParams")
    check_values(params, "params")
    return params


def speed_limit(params: Any) -> Callable[[FloatArray], FloatArray]:
    """Returns a function that limits velocities (3,) by the parameters, or to usual speeds.

    It keeps the planar direction; along an axis whose limit is 0 the robot does not move.
    """
    most, least = np.array([_USUAL_M_S, _USUAL_M_S, _USUAL_RAD_S]), -np.array([_USUAL_M_S, _USUAL_M_S, _USUAL_RAD_S])
    for name, limits in (("max_vel", most), ("min_vel", least)):
        if params.HasField("vel_limit") and params.vel_limit.HasField(name):
            given = getattr(params.vel_limit, name)
            limits[:] = _velocity(given)
    if most.min() < 0.0 or least.max() > 0.0:
        raise InvalidRequestError("params.vel_limit: max_vel must be at least 0, min_vel at most 0")

    def limit(velocity: FloatArray) -> FloatArray:
        bound = np.where(velocity > 0.0, most, -least)
        shares = np.minimum(1.0, bound / np.maximum(np.abs(velocity), 1e-9))
        shares[:2] = np.where(bound[:2] > 0.0, shares[:2][bound[:2] > 0.0].min(initial=1.0), 0.0)
        return np.asarray(velocity * shares)

    return limit
