"""Motions of the hand in space: straight from pose to pose, gaze at a point, velocities."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from bosdyn.api import arm_command_pb2
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from errand_spot.messages import frame_tree, points_of, transform, vector
from errand_spot.server.arm import USUAL_RAD_S, ArmMotion, Named, Status
from errand_spot.server.computer import HAND_X_M, Computer, Snapshot, Solver
from errand_spot.server.leases import ARM
from errand_spot.server.mobility import BaseMotion, Trajectory, way_to
from errand_spot.server.refusals import known_frame, times_of, unsupported
from skills.robot import ArmTrajectory, FloatArray, Pose2D

_USUAL_M_S, _CYLINDRICAL_M_S, _FASTEST_HAND_M_S, _FASTEST_TURN_RAD_S, _LEAP_RAD = 0.4, 0.5, 1.0, 3.0, 0.4
_TRACK_S: Final = 0.1
_MOVED_M, _MOVED_RAD = 0.02, 0.04
_LOST_M, _LOST_RAD = 0.1, 0.3
"""Distance and turn from a goal in the world at which it no longer holds."""
_BEHIND_M: Final = 0.75
_FOLLOWING_S: Final = 60.0
_PER_SEGMENT: Final = 6
_FARTHEST_M: Final = 2.0
_FOLDED_RAD, _CLOSE_M, _GAZE_STEP_S, _GAZE_FROM_M = 0.3, 0.05, 0.25, (0.75, 0.0, 0.25)
_GAZE_REACH_M, _GAZE_STEP_M = 0.6, 0.06
"""Distance of a gazing hand from the shoulder, and its change in a step, while the body walks."""
_SHOULDER_M: Final = np.array([0.292, 0.0, 0.188])
"""Position of the shoulder in the body."""
_STEP_M, _STEP_RAD = 0.2, 0.6
"""Largest error and turn of a step towards a pose."""
_TRIES, _SMALL_RAD, _DAMPING, _TURN_WEIGHT, _MOST_OFF_M, _NEAR_M = 15, 1e-4, 1e-3, 0.05, 0.2, 0.02
"""Steps, finite difference, damping and weight of turns for a goal that the hand reaches only turned otherwise."""
_Positions: Final = arm_command_pb2.NamedArmPositionsCommand
X_HAND: Final = RigidTransform([HAND_X_M, 0.0, 0.0])
"""Pose of the API's frame `hand` in `link_wr1`, the default tool."""

_Passed = tuple[float, RigidTransform]
"""Time (s, the robot's clock) at which the wrist passes a pose in `odom`."""


class Cartesian(ArmMotion):
    """Moves a tool of the wrist through poses in a frame; towards a goal out of reach as far as the arm can."""

    field = "arm_cartesian_feedback"
    _unfolding: Named | None = None
    complete = arm_command_pb2.ArmCartesianCommand.Feedback.STATUS_TRAJECTORY_COMPLETE
    going = arm_command_pb2.ArmCartesianCommand.Feedback.STATUS_IN_PROGRESS
    stalled = arm_command_pb2.ArmCartesianCommand.Feedback.STATUS_TRAJECTORY_STALLED

    def __init__(self, request: Any, snapshot: Snapshot, now_s: float) -> None:
        frame = known_frame(request.root_frame_name, snapshot.frames)
        X_WT = (
            transform(request.wrist_tform_tool, "wrist_tform_tool") if request.HasField("wrist_tform_tool") else X_HAND
        )
        X_RT = transform(request.root_tform_task, "root_tform_task")
        axes = ("x_axis", "y_axis", "z_axis", "rx_axis", "ry_axis", "rz_axis")
        if any(getattr(request, axis) != request.AXIS_MODE_POSITION for axis in axes):
            raise unsupported("arm_cartesian_command with an axis in force mode")
        limited = request.HasField("max_linear_velocity")
        self._fastest_m_s = request.max_linear_velocity.value if limited else _USUAL_M_S
        self._out_of_reach = self._tracks = False
        self._tracked_s, self._stays = 0.0, frame in ("odom", "vision")
        given, field = request.pose_trajectory_in_task, "arm_cartesian_command.pose_trajectory_in_task"
        points, self._times_s = points_of(given, field), times_of(given, now_s, field)
        X_OR = snapshot.X_AB("odom", frame)
        self._X_OW = [X_OR @ X_RT @ transform(point.pose, "pose") @ X_WT.inverse() for point in points]
        self._X_WT, self._X_BGoal = X_WT, snapshot.X_AB("body", "odom") @ self._X_OW[-1]
        super().__init__()

    @property
    def goal_O(self) -> FloatArray:
        """Last position (3,) of the tool in `odom`."""
        return np.asarray((self._X_OW[-1] @ self._X_WT).translation())

    def begin(self, computer: Computer) -> None:
        """Unfolds a stowed arm, then moves straight from pose to pose, of which those in the world stay there."""
        self._begun_s, arm = computer.clock.now(), computer.capabilities.arm
        q, self._unfolding = computer.arm_rad(), None
        if arm is not None and np.abs(q - np.array(arm.stowed_rad)).max() < _FOLDED_RAD:
            self._unfolding = Named(_Positions.Request(position=_Positions.POSITIONS_READY))
            self._unfolding.begin(computer)
        else:
            self._start(computer)

    def _start(self, computer: Computer) -> None:
        X_OW, end_s, self._path = computer.snapshot.X_AB("odom", "link_wr1"), computer.clock.now(), list[_Passed]()
        begun_s = self._begun_s
        self._path.append((end_s, X_OW))
        for goal_s, X_OGoal in zip(self._times_s, self._X_OW, strict=True):
            far_m = min(float(np.linalg.norm(X_OGoal.translation() - X_OW.translation())), _FARTHEST_M)
            end_s, X_OW = max(begun_s + goal_s, end_s + 1.5 * far_m / self._fastest_m_s), X_OGoal
            self._path.append((end_s, X_OW))
        self._plan(computer)

    def _plan(self, computer: Computer) -> None:
        """Plans the rest of the path from the present poses of hand and body; poses out of reach are approached."""
        self._tracks, self._X_OB, before = False, computer.snapshot.X_AB("odom", "body"), computer.arm_rad()
        X_BO, X_OW, now_s = self._X_OB.inverse(), computer.snapshot.X_AB("odom", "link_wr1"), computer.clock.now()
        times, postures, time_s, solver = list[float](), list[FloatArray](), 0.0, computer.solver
        assert solver is not None
        for end_s, X_OGoal in [each for each in self._path[1:] if each[0] > now_s] or self._path[-1:]:
            far_m = min(float(np.linalg.norm(X_OGoal.translation() - X_OW.translation())), _FARTHEST_M)
            goal_s = max(end_s - now_s, time_s + 1.5 * far_m / self._fastest_m_s)
            self._out_of_reach = _posture_at(computer, X_BO @ X_OGoal, before) is None
            for share in np.linspace(0.0, 1.0, _PER_SEGMENT + 1)[1:]:
                X_BW = X_BO @ _between(X_OW, X_OGoal, float(share))
                posture = _posture_at(computer, X_BW, before)
                if posture is None and self._out_of_reach:
                    posture = _turned_posture(solver, X_BW, before, math.inf)
                if posture is not None:
                    times.append(time_s + share * (goal_s - time_s))
                    postures.append(posture)
                    before = posture
            if self._out_of_reach:
                break
            X_OW, time_s = X_OGoal, goal_s
        self._follow(computer, times, postures)

    def _track(self, computer: Computer) -> None:
        """Moves the hand along its path, within the arm's reach, while the body moves below it."""
        now_s = computer.clock.now()
        if now_s < self._tracked_s + _TRACK_S:
            return
        self._tracks, self._tracked_s, q = True, now_s, computer.arm_rad()
        ahead_s = now_s + 2.0 * _TRACK_S
        later = next((k for k, (end_s, _) in enumerate(self._path) if end_s > ahead_s), None)
        X_OW = self._path[-1][1]
        if later:
            (a_s, X_OA), (b_s, X_OB) = self._path[later - 1 : later + 1]
            X_OW = _between(X_OA, X_OB, (ahead_s - a_s) / (b_s - a_s))
        X_BW = _body_ahead(computer).InvertAndCompose(X_OW)
        posture = _posture_at(computer, X_BW, q)
        if posture is None and computer.solver is not None:
            posture = _turned_posture(computer.solver, X_BW, q)
        _step_to(computer, posture, q)

    def tick(self, computer: Computer) -> None:
        """Goes on along the path, and reports how far the hand is from its goal."""
        if self._unfolds(computer):
            return
        frame, X_FGoal = ("odom", self._X_OW[-1]) if self._stays else ("body", self._X_BGoal)
        X_WG = computer.snapshot.X_AB("link_wr1", frame) @ X_FGoal
        off_m, off_rad = float(np.linalg.norm(X_WG.translation())), X_WG.rotation().ToAngleAxis().angle()
        live = self._stays and self.status == Status.STATUS_PROCESSING
        done = getattr(self.feedback, self.field).status == self.complete
        done &= not live or (off_m < _LOST_M and off_rad < _LOST_RAD)
        moved = _moved(computer, self._X_OB)
        moves = computer.base_moves(shifted=moved)
        if live and moves:
            self._track(computer)
        elif live and (moved or self._tracks):
            self._plan(computer)
        if live and not done and (moves or moved):
            self.feedback = self._made(self.going)
        elif not done:
            super().tick(computer)
        made = arm_command_pb2.ArmCommand.Feedback()
        made.CopyFrom(self.feedback)
        self._measure(made, computer.snapshot, off_m, off_rad)
        self.feedback = made

    def _measure(self, made: Any, _snapshot: Snapshot, off_m: float, off_rad: float) -> None:
        """Fills in how far the hand is from its goal."""
        made.arm_cartesian_feedback.measured_pos_distance_to_goal = off_m
        made.arm_cartesian_feedback.measured_rot_distance_to_goal = off_rad

    def _progress(self, computer: Computer) -> int:
        progress = super()._progress(computer)
        return self.stalled if self._out_of_reach and progress == self.complete else progress

    def _unfolds(self, computer: Computer) -> bool:
        """Goes on unfolding the arm; returns whether it still unfolds."""
        if self._unfolding is None or self.status != Status.STATUS_PROCESSING:
            return self._unfolding is not None
        self._unfolding.tick(computer)
        if self._unfolding.feedback.named_arm_position_feedback.status == self._unfolding.going:
            return True
        self._unfolding = None
        self._start(computer)
        return False


class Impedance(Cartesian):
    """Moves a tool along the path of an impedance command, as stiff as the arm is; it presses with no set force."""

    field, _Part = "arm_impedance_feedback", arm_command_pb2.ArmImpedanceCommand.Feedback
    complete, going, stalled = (
        _Part.STATUS_TRAJECTORY_COMPLETE,
        _Part.STATUS_IN_PROGRESS,
        _Part.STATUS_TRAJECTORY_STALLED,
    )

    def __init__(self, request: Any, snapshot: Snapshot, now_s: float) -> None:
        wrench = request.feed_forward_wrench_at_tool_in_desired_tool
        if any((*vector(wrench.force, "force"), *vector(wrench.torque, "torque"))):
            raise unsupported("arm_impedance_command with a feed-forward wrench")
        if 0.0 in request.diagonal_stiffness_matrix.values:
            raise unsupported("arm_impedance_command with an axis without stiffness")
        path = arm_command_pb2.ArmCartesianCommand.Request(
            root_frame_name=request.root_frame_name, pose_trajectory_in_task=request.task_tform_desired_tool
        )
        for name in ("root_tform_task", "wrist_tform_tool"):
            if request.HasField(name):
                getattr(path, name).CopyFrom(getattr(request, name))
        self._frame, self._X_RT = request.root_frame_name, transform(request.root_tform_task, "root_tform_task")
        super().__init__(path, snapshot, now_s)

    def _measure(self, made: Any, snapshot: Snapshot, off_m: float, off_rad: float) -> None:
        frames = dict(snapshot.frames)
        frames["task"] = (self._frame, self._X_RT)
        frames["tool"] = ("link_wr1", self._X_WT)
        frames["desired_tool"] = frames["desired_tool_at_end"] = ("odom", self._X_OW[-1] @ self._X_WT)
        made.arm_impedance_feedback.transforms_snapshot.CopyFrom(frame_tree(frames))


class FollowArm(BaseMotion):
    """Walks until the hand's Cartesian goal lies ahead of the body; stands during other motions of the arm."""

    field = "follow_arm_feedback"

    def __init__(self, request: Any) -> None:
        offset = vector(request.body_offset_from_hand, "body_offset_from_hand")
        self._ahead = np.array(offset if any(offset) else (_BEHIND_M, 0.0, 0.0))
        self._walks, self._way = not request.disable_walking, None
        super().__init__()

    _way: Trajectory | None

    def begin(self, computer: Computer) -> None:
        """Starts to walk, with the heading that the body has."""
        arm = computer.motion(ARM)
        if self._walks and isinstance(arm, Cartesian):
            pose = computer.snapshot.odometry.pose
            goal_O = arm.goal_O - pose.transform().rotation() @ self._ahead
            goal = Pose2D(float(goal_O[0]), float(goal_O[1]), pose.yaw_rad)
            self._way = way_to([goal], computer.now_s() + _FOLLOWING_S, computer.snapshot)
            self._way.begin(computer)

    def tick(self, computer: Computer) -> None:
        """Walks on."""
        if self._way is not None:
            self._way.tick(computer)

    def end(self, status: int) -> None:
        """Ends it with a status."""
        if self._way is not None:
            self._way.end(status)
        super().end(status)

    @property
    def moving(self) -> bool:
        """Returns whether the body is on its way."""
        return self._way is not None and self._way.moving


class Gaze(ArmMotion):
    """Turns the hand's camera to a point, at the hand's present position or a pose of its tool."""

    field = "arm_gaze_feedback"
    complete = arm_command_pb2.GazeCommand.Feedback.STATUS_TRAJECTORY_COMPLETE
    going = arm_command_pb2.GazeCommand.Feedback.STATUS_IN_PROGRESS
    stalled = arm_command_pb2.GazeCommand.Feedback.STATUS_TOOL_TRAJECTORY_STALLED

    def __init__(self, request: Any, snapshot: Snapshot) -> None:
        field, now_s = "arm_gaze_command.target_trajectory_in_frame1", snapshot.time_s
        given, X_OF = request.target_trajectory_in_frame1, snapshot.X_OF(request.frame1_name)
        self._targets_O = [X_OF @ np.array(vector(point.point, field)) for point in points_of(given, field)]
        self._times_s, self._tool_times_s = times_of(given, now_s, field), [0.0]
        self._tools_O, self._misses_tool = list[FloatArray](), False
        if (tool := request.tool_trajectory_in_frame2).points:
            field = "arm_gaze_command.tool_trajectory_in_frame2"
            X_OF = snapshot.X_OF(request.frame2_name)
            self._tools_O = [(X_OF @ transform(each.pose, field)).translation() for each in points_of(tool, field)]
            self._tool_times_s = times_of(tool, now_s, field)
        super().__init__()

    def begin(self, computer: Computer) -> None:
        """Starts to turn, and follows the target; the hand is nearer or lower where it cannot look from there."""
        self._begun_s, self._tracked_s = computer.clock.now(), 0.0
        self._hand_B = np.array(computer.snapshot.X_AB("body", "hand").translation())
        self._plan(computer)

    def tick(self, computer: Computer) -> None:
        """Reports the state; while the body moves, the hand keeps looking at the target."""
        if self.status == Status.STATUS_PROCESSING:
            moved = _moved(computer, self._X_OB)
            if computer.base_moves(shifted=moved):
                self._track(computer)
                self.feedback = self._made(self.going)
                return
            if moved or self._tracked_s:
                self._plan(computer)
        super().tick(computer)

    def _plan(self, computer: Computer) -> None:
        """Plans the rest of the gaze from the present poses of hand and body."""
        self._X_OB, now, self._tracked_s = computer.snapshot.X_AB("odom", "body"), computer.arm_rad(), 0.0
        since_s, lasts_s = computer.clock.now() - self._begun_s, max(self._times_s[-1], self._tool_times_s[-1])
        left_s = max(lasts_s - since_s, 0.0)
        times_s = np.linspace(0.0, left_s, 1 + math.ceil(left_s / _GAZE_STEP_S))
        places = [self._hand_B, np.array(_GAZE_FROM_M), self._freest(since_s, self._X_OB)]
        for place_B in [self._hand_B, *places] if self._tools_O else places:
            self._hand_B, postures = place_B, [now]
            for time_s in times_s:
                posture = self._posture(computer, since_s + float(time_s), self._X_OB, postures[-1])
                if posture is None:
                    break
                postures.append(posture)
            if len(postures) > len(times_s):
                first_s = 1.5 * float(np.abs(postures[1] - now).max()) / USUAL_RAD_S
                timed = [each for each in zip(times_s.tolist(), postures[1:], strict=True) if each[0] >= first_s]
                self._follow(computer, *zip(*(timed or [(first_s, postures[-1])]), strict=True))
                return
            self._misses_tool, self._tools_O = self._misses_tool or bool(self._tools_O), []
        self.command, self.feedback = None, self._made(self.stalled)

    def _progress(self, computer: Computer) -> int:
        progress = super()._progress(computer)
        return self.stalled if self._misses_tool and progress == self.complete else progress

    def _track(self, computer: Computer) -> None:
        """Looks at the target while the body moves on."""
        now_s, q = computer.clock.now(), computer.arm_rad()
        if now_s >= self._tracked_s + _TRACK_S:
            self._tracked_s, ahead_s = now_s, now_s + 2.0 * _TRACK_S - self._begun_s
            X_OB = _body_ahead(computer)
            self._hand_B += _at_most(self._freest(ahead_s, X_OB) - self._hand_B, _GAZE_STEP_M)
            _step_to(computer, self._posture(computer, ahead_s, X_OB, q), q)

    def _posture(self, computer: Computer, since_s: float, X_OB: RigidTransform, near: FloatArray) -> FloatArray | None:
        """Joint angles that look at the target at a time, from the tool's path if there is one; None out of reach."""
        X_BO, hand_B = X_OB.inverse(), self._hand_B
        if self._tools_O:
            hand_B = X_BO @ _at(since_s, self._tool_times_s, self._tools_O)
        away = X_BO @ _at(since_s, self._times_s, self._targets_O) - hand_B
        if np.linalg.norm(away) < _CLOSE_M:
            return None
        return _posture_at(computer, RigidTransform(_looking(away), hand_B) @ X_HAND.inverse(), near)

    def _freest(self, since_s: float, X_OB: RigidTransform) -> FloatArray:
        """Position of the hand in the body from which it can look at the target however the body turns."""
        away = X_OB.inverse() @ _at(since_s, self._times_s, self._targets_O) - _SHOULDER_M
        return np.asarray(_SHOULDER_M + _GAZE_REACH_M * away / max(float(np.linalg.norm(away)), _CLOSE_M))

    def _made(self, progress: int) -> Any:
        made, done = super()._made(progress), progress == self.complete
        part = made.arm_gaze_feedback
        part.gazing_at_target = part.hand_position_at_goal = part.hand_roll_at_goal = done
        return made


def _moved(computer: Computer, X_OB: RigidTransform) -> bool:
    """Returns whether the body has left a pose in `odom`."""
    off = X_OB.InvertAndCompose(computer.snapshot.X_AB("odom", "body"))
    return float(np.linalg.norm(off.translation())) > _MOVED_M or off.rotation().ToAngleAxis().angle() > _MOVED_RAD


def _body_ahead(computer: Computer) -> RigidTransform:
    """Pose of the moving body in `odom` at the end of the next step of the arm."""
    X_BAhead = Pose2D(*(2.0 * _TRACK_S * value for value in computer.snapshot.odometry.velocity)).transform()
    return computer.snapshot.X_AB("odom", "body") @ X_BAhead


def _step_to(computer: Computer, posture: FloatArray | None, now: FloatArray) -> None:
    """Moves the arm by one step towards a posture, if there is one."""
    if posture is not None:
        most = 2.0 * _TRACK_S * USUAL_RAD_S
        positions = np.array([now, now + np.clip(posture - now, -most, most)])
        trajectory = ArmTrajectory(np.array([0.0, 2.0 * _TRACK_S]), positions)
        computer.robot.move_arm(trajectory, until_s=computer.clock.now() + 1.0, lease=computer.lease)


def _between(X_AB: RigidTransform, X_AC: RigidTransform, share: float) -> RigidTransform:
    """Pose at a share of the straight line from B to C; the rotation turns about one axis."""
    turn = X_AB.rotation().InvertAndCompose(X_AC.rotation()).ToAngleAxis()
    moved = (1.0 - share) * X_AB.translation() + share * X_AC.translation()
    return RigidTransform(X_AB.rotation() @ RotationMatrix(AngleAxis(share * turn.angle(), turn.axis())), moved)


def _at(time_s: float, times_s: Sequence[float], points: Sequence[FloatArray]) -> FloatArray:
    """Point (3,) of a path at a time."""
    return np.array([np.interp(time_s, times_s, column) for column in np.array(points).T])


def _at_most(vector_: Sequence[float] | FloatArray, most: float) -> FloatArray:
    """The vector, shortened if it is longer than `most`."""
    return np.asarray(vector_) * min(1.0, most / max(float(np.linalg.norm(vector_)), 1e-9))


def _looking(away: FloatArray) -> RotationMatrix:
    """Rotation whose x axis points along a vector, with z as far up as possible."""
    x = away / np.linalg.norm(away)
    side = np.cross([0.0, 0.0, 1.0], x)
    y = side / np.linalg.norm(side) if np.linalg.norm(side) > 1e-6 else np.array([0.0, 1.0, 0.0])
    return RotationMatrix(np.column_stack([x, y, np.cross(x, y)]))


class Moving(ArmMotion):
    """Moves the hand at a velocity until its end."""

    field, going = "arm_velocity_feedback", 0

    def __init__(self, request: Any, snapshot: Snapshot, end_s: float) -> None:
        self._end_s, self._frame = end_s, "odom"
        self._angular = vector(request.angular_velocity_of_hand_rt_odom_in_hand, "angular_velocity")
        self._cylindrical = request.HasField("cylindrical_velocity")
        if self._cylindrical:
            v, fastest = request.cylindrical_velocity.linear_velocity, request.cylindrical_velocity.max_linear_velocity
            self._linear = tuple((fastest.value or _CYLINDRICAL_M_S) * value for value in (v.r, v.theta, v.z))
        else:
            self._frame = known_frame(request.cartesian_velocity.frame_name, snapshot.frames)
            self._linear = vector(request.cartesian_velocity.velocity_in_frame_name, "velocity_in_frame_name")
        super().__init__()

    def begin(self, computer: Computer) -> None:
        """Starts to move."""
        self._q = computer.arm_rad()

    def tick(self, computer: Computer) -> None:
        """Moves the hand on by one step."""
        if self.status != Status.STATUS_PROCESSING:
            return
        if computer.left_s(self._end_s) <= 0.0:
            self.end(Status.STATUS_COMMAND_TIMED_OUT)
            return
        assert computer.solver is not None
        step_s, share, X_BHand = 0.1, 0.25, computer.solver.X_BH(self._q) @ X_HAND
        turn = Rotation.from_rotvec(step_s * _at_most(self._angular, _FASTEST_TURN_RAD_S))
        moved_m = step_s * _at_most(self._velocity_B(computer, X_BHand), _FASTEST_HAND_M_S)
        X_BGoal = RigidTransform(X_BHand.rotation() @ RotationMatrix(turn.as_matrix()), X_BHand.translation() + moved_m)
        X_BW = X_BGoal @ X_HAND.inverse()
        posture = _posture_at(computer, X_BW, self._q)
        if posture is None or np.abs(posture - self._q).max() > _LEAP_RAD:
            posture = _turned_posture(computer.solver, X_BW, self._q, _NEAR_M)
        if posture is None:
            return
        begun, self._q = self._q, self._q + share * np.clip(posture - self._q, -_LEAP_RAD, _LEAP_RAD)
        trajectory = ArmTrajectory(np.array([0.0, 2 * share * step_s]), np.array([begun, self._q]))
        computer.robot.move_arm(trajectory, until_s=computer.until_s(self._end_s), lease=computer.lease)

    def _velocity_B(self, computer: Computer, X_BHand: RigidTransform) -> FloatArray:
        if not self._cylindrical:
            R_BF = computer.snapshot.X_AB("body", self._frame).rotation()
            return np.asarray(R_BF @ np.array(self._linear))
        r, theta, z = self._linear
        x, y, _ = X_BHand.translation() - _SHOULDER_M
        heading, radius = math.atan2(y, x), math.hypot(x, y)
        out, aside = np.array([math.cos(heading), math.sin(heading)]), np.array([-math.sin(heading), math.cos(heading)])
        return np.array([*(r * out + theta * radius * aside), z])

    def _made(self, _progress: int) -> Any:
        made = arm_command_pb2.ArmCommand.Feedback(status=self.status)
        made.arm_velocity_feedback.SetInParent()
        return made


def solutions(solver: Solver, X_BW: RigidTransform) -> list[FloatArray]:
    """Joint angles for the wrist at a pose; none for a distant one."""
    near = float(np.abs(X_BW.translation()).max()) < _FARTHEST_M
    return list(solver.inverse(X_BW)) if near else []


def _posture_at(computer: Computer, X_BW: RigidTransform, near_rad: FloatArray) -> FloatArray | None:
    """Joint angles that put the wrist at a pose, the nearest to a posture; None out of reach."""
    found = [] if computer.solver is None else solutions(computer.solver, X_BW)
    return min(found, key=lambda q: float(np.abs(q - near_rad).max()), default=None)


def _turned_posture(
    solver: Solver, X_BW: RigidTransform, near_rad: FloatArray, most_off_m: float = _MOST_OFF_M
) -> FloatArray | None:
    """Joint angles that put the hand at the place of a pose, turned otherwise if need be; None out of reach.

    Damped least squares (Wampler, 1986) from a posture, in which turns weigh less than places.
    """
    q, goal = near_rad, X_BW @ X_HAND
    for _ in range(_TRIES):
        off = _off(solver.X_BH(q) @ X_HAND, goal)
        steps = _SMALL_RAD * np.eye(len(q))
        J = np.column_stack([off - _off(solver.X_BH(q + step) @ X_HAND, goal) for step in steps]) / _SMALL_RAD
        turn = J.T @ np.linalg.solve(J @ J.T + _DAMPING * np.eye(6), _at_most(off, _STEP_M))
        q = np.clip(q + _at_most(turn, _STEP_RAD), solver.lower_rad, solver.upper_rad)
    return q if np.linalg.norm(_off(solver.X_BH(q) @ X_HAND, goal)[:3]) < most_off_m else None


def _off(X_BH: RigidTransform, X_BG: RigidTransform) -> FloatArray:
    """Way (3) in metres and turn (3), weighed, from a pose to a goal."""
    turn = X_BH.rotation().InvertAndCompose(X_BG.rotation()).ToAngleAxis()
    turn_B = X_BH.rotation() @ (turn.angle() * turn.axis())
    return np.concatenate([X_BG.translation() - X_BH.translation(), _TURN_WEIGHT * turn_B])
