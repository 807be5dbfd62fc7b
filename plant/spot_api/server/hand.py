"""Motions of the hand in space: straight from pose to pose, gaze at a point, velocities."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from bosdyn.api import arm_command_pb2
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from plant.spot_api.messages import finite, points_of, seconds, transform, vector
from plant.spot_api.server.arm import USUAL_RAD_S, ArmMotion, Status
from plant.spot_api.server.computer import HAND_X_M, Computer, Snapshot, Solver
from plant.spot_api.server.mobility import soon, unknown_frame
from skills.robot import ArmTrajectory, FloatArray

_USUAL_M_S: Final = 0.4
_PER_SEGMENT: Final = 6
_FARTHEST_M: Final = 2.0
X_HAND: Final = RigidTransform([HAND_X_M, 0.0, 0.0])
"""Pose of the API's frame `hand` in `link_wr1`, the default tool."""


class Cartesian(ArmMotion):
    """Moves a tool of the wrist through poses in a frame; a goal out of reach ends it as stalled."""

    field = "arm_cartesian_feedback"
    complete = arm_command_pb2.ArmCartesianCommand.Feedback.STATUS_TRAJECTORY_COMPLETE
    going = arm_command_pb2.ArmCartesianCommand.Feedback.STATUS_IN_PROGRESS
    stalled = arm_command_pb2.ArmCartesianCommand.Feedback.STATUS_TRAJECTORY_STALLED

    def __init__(self, request: Any, snapshot: Snapshot, now_s: float) -> None:
        frame = _known(request.root_frame_name, snapshot)
        X_WT = (
            transform(request.wrist_tform_tool, "wrist_tform_tool") if request.HasField("wrist_tform_tool") else X_HAND
        )
        X_RT = transform(request.root_tform_task, "root_tform_task")
        given, field = request.pose_trajectory_in_task, "arm_cartesian_command.pose_trajectory_in_task"
        points = points_of(given, field)
        offset_s = seconds(given.reference_time) - now_s if given.HasField("reference_time") else 0.0
        self._times_s = [soon(offset_s + seconds(point.time_since_reference), field) for point in points]
        X_OR = snapshot.X_AB("odom", frame)
        self._X_OW = [X_OR @ X_RT @ transform(point.pose, "pose") @ X_WT.inverse() for point in points]
        super().__init__()

    def begin(self, computer: Computer) -> None:
        """Starts to move straight from pose to pose; the poses stay where they are in `odom`."""
        X_BO, before = computer.snapshot.X_AB("body", "odom"), computer.arm_rad()
        X_OW, time_s = computer.snapshot.X_AB("odom", "link_wr1"), 0.0
        times, postures = list[float](), list[FloatArray]()
        for goal_s, X_OGoal in zip(self._times_s, self._X_OW, strict=True):
            far_m = float(np.linalg.norm(X_OGoal.translation() - X_OW.translation()))
            end_s = max(goal_s, time_s + 1.5 * far_m / _USUAL_M_S)
            for share in np.linspace(0.0, 1.0, _PER_SEGMENT + 1)[1:]:
                posture = _posture_at(computer, X_BO @ _between(X_OW, X_OGoal, float(share)), before)
                if posture is not None:
                    times.append(time_s + share * (end_s - time_s))
                    postures.append(posture)
                    before = posture
            if posture is None:  # nothing moves unless all goals are in reach
                self.feedback = self._made(self.stalled)
                return
            X_OW, time_s = X_OGoal, end_s
        self._follow(computer, times, postures)

    def tick(self, computer: Computer) -> None:
        """Reports how far the hand is from its goal."""
        super().tick(computer)
        X_WG = computer.snapshot.X_AB("link_wr1", "odom") @ self._X_OW[-1]
        made = arm_command_pb2.ArmCommand.Feedback()
        made.CopyFrom(self.feedback)
        made.arm_cartesian_feedback.measured_pos_distance_to_goal = float(np.linalg.norm(X_WG.translation()))
        made.arm_cartesian_feedback.measured_rot_distance_to_goal = X_WG.rotation().ToAngleAxis().angle()
        self.feedback = made


class Gaze(ArmMotion):
    """Turns the hand's camera to a point, where the hand is or at a pose of its tool."""

    field = "arm_gaze_feedback"
    complete = arm_command_pb2.GazeCommand.Feedback.STATUS_TRAJECTORY_COMPLETE
    going = arm_command_pb2.GazeCommand.Feedback.STATUS_IN_PROGRESS
    stalled = arm_command_pb2.GazeCommand.Feedback.STATUS_TOOL_TRAJECTORY_STALLED

    def __init__(self, request: Any, snapshot: Snapshot) -> None:
        frame = _known(request.frame1_name, snapshot)
        points = points_of(request.target_trajectory_in_frame1, "arm_gaze_command.target_trajectory_in_frame1")
        target = vector(points[-1].point, "target")
        self._target_O = snapshot.X_AB("odom", frame) @ np.array(target)
        self._at_O: FloatArray | None = None
        if request.tool_trajectory_in_frame2.points:
            X_OF = snapshot.X_AB("odom", _known(request.frame2_name, snapshot))
            X_OT = X_OF @ transform(request.tool_trajectory_in_frame2.points[-1].pose, "tool")
            self._at_O = np.asarray(X_OT.translation())
        super().__init__()

    def begin(self, computer: Computer) -> None:
        """Starts to turn; nearer or lower where the hand cannot look from there."""
        X_BO, now = computer.snapshot.X_AB("body", "odom"), computer.arm_rad()
        target_B = np.asarray(X_BO @ self._target_O)
        hand_B = np.asarray(computer.snapshot.X_AB("body", "hand").translation())
        ready_B = np.array([0.75, 0.0, 0.25])
        for at_B in ([] if self._at_O is None else [np.asarray(X_BO @ self._at_O)]) + [hand_B, ready_B]:
            away = target_B - at_B
            if np.linalg.norm(away) < 0.05:
                continue
            X_BW = RigidTransform(_looking(away), at_B) @ X_HAND.inverse()
            if (posture := _posture_at(computer, X_BW, now)) is not None:
                self._follow(computer, [1.5 * float(np.abs(posture - now).max()) / USUAL_RAD_S], [posture])
                return
        self.feedback = self._made(self.stalled)

    def _made(self, progress: int) -> Any:
        made, done = super()._made(progress), progress == self.complete
        part = made.arm_gaze_feedback
        part.gazing_at_target = part.hand_position_at_goal = part.hand_roll_at_goal = done
        return made


def _between(X_AB: RigidTransform, X_AC: RigidTransform, share: float) -> RigidTransform:
    """Pose at a share of the straight way from B to C; the rotation turns about one axis."""
    turn = X_AB.rotation().InvertAndCompose(X_AC.rotation()).ToAngleAxis()
    moved = (1.0 - share) * X_AB.translation() + share * X_AC.translation()
    return RigidTransform(X_AB.rotation() @ RotationMatrix(AngleAxis(share * turn.angle(), turn.axis())), moved)


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
            v = request.cylindrical_velocity.linear_velocity
            self._linear = tuple(finite(getattr(v, name), name) * 0.5 for name in ("r", "theta", "z"))
        else:
            self._frame = _known(request.cartesian_velocity.frame_name, snapshot)
            self._linear = vector(request.cartesian_velocity.velocity_in_frame_name, "velocity_in_frame_name")
        super().__init__()

    def begin(self, computer: Computer) -> None:
        """Starts to move."""
        self._q = computer.arm_rad()

    def tick(self, computer: Computer) -> None:
        """Moves the hand on by one step."""
        if self.status != Status.STATUS_PROCESSING:
            return
        if computer.now_s() >= self._end_s:
            self.end(Status.STATUS_COMMAND_TIMED_OUT)
            return
        step_s, X_BW = 0.1, computer.solver.X_BH(self._q) if computer.solver else RigidTransform()
        X_BHand = X_BW @ X_HAND
        moved = RigidTransform(
            X_BHand.rotation() @ RotationMatrix(Rotation.from_rotvec(np.array(self._angular) * step_s).as_matrix()),
            X_BHand.translation() + step_s * self._velocity_B(computer, X_BHand),
        )
        posture = _posture_at(computer, moved @ X_HAND.inverse(), self._q)
        if posture is None or np.abs(posture - self._q).max() > 0.4:
            return
        share = 0.25
        begun, self._q = self._q, self._q + share * (posture - self._q)
        trajectory = ArmTrajectory(np.array([0.0, 2 * share * step_s]), np.array([begun, self._q]))
        computer.robot.move_arm(trajectory, until_s=computer.until_s(self._end_s), lease=computer.lease)

    def _velocity_B(self, computer: Computer, X_BHand: RigidTransform) -> FloatArray:
        if not self._cylindrical:
            R_BF = computer.snapshot.X_AB("body", self._frame).rotation()
            return np.asarray(R_BF @ np.array(self._linear))
        r, theta, z = self._linear
        shoulder_B = np.array([0.292, 0.0, 0.188])
        x, y, _ = X_BHand.translation() - shoulder_B
        heading, radius = math.atan2(y, x), math.hypot(x, y)
        out, aside = np.array([math.cos(heading), math.sin(heading)]), np.array([-math.sin(heading), math.cos(heading)])
        return np.array([*(r * out + theta * radius * aside), z])

    def _made(self, _progress: int) -> Any:
        made = arm_command_pb2.ArmCommand.Feedback(status=self.status)
        made.arm_velocity_feedback.SetInParent()
        return made


def _known(frame: str, snapshot: Snapshot) -> str:
    """Returns a frame of the tree. Raises RefusedError."""
    if frame not in snapshot.frames:
        raise unknown_frame(frame)
    return frame


def solutions(solver: Solver, X_BW: RigidTransform) -> list[FloatArray]:
    """Joint angles that put the wrist at a pose; none for one that is far away."""
    near = float(np.abs(X_BW.translation()).max()) < _FARTHEST_M
    return list(solver.inverse(X_BW)) if near else []


def _posture_at(computer: Computer, X_BW: RigidTransform, near_rad: FloatArray) -> FloatArray | None:
    """Joint angles that put the wrist at a pose, the nearest to a posture; None out of reach."""
    found = [] if computer.solver is None else solutions(computer.solver, X_BW)
    return min(found, key=lambda q: float(np.abs(q - near_rad).max()), default=None)
