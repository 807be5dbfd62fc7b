"""Posture of the standing body over its feet: height, pitch, turn and shift, at once or over time."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from errand_spot.messages import InvalidRequestError, points_of, transform
from errand_spot.server.computer import Computer, Snapshot
from errand_spot.server.refusals import times_of, unsupported
from skills.robot import FloatArray, Pose2D

SHIFT_M, TWIST_RAD = 0.12, 0.5
"""Largest shift and turn of the body over its feet; a robot clips what is larger, and so does this one."""
ROLL_RAD: Final = 0.15
"""Largest roll that a command may ask for; the body stays level."""
_SHIFTED: Final = 0.01
"""Least shift (m) or turn (rad) that counts."""


class Posture:
    """Poses of the body by the mobility parameters of a command: x, y, yaw, height and pitch over its feet, over time.

    A pose in a frame that is fixed to the floor stays there.
    """

    def __init__(self, params: Any, computer: Computer, snapshot: Snapshot) -> None:
        """Raises RefusedError for what the body cannot do, or InvalidRequestError."""
        control, can = params.body_control, computer.capabilities
        self._range = np.array([can.height_range_m, can.pitch_range_rad])
        self._X_OR: RigidTransform | None = None
        self._times_s, self._poses = [0.0], [RigidTransform([0.0, 0.0, can.standing_height_m])]
        which = control.WhichOneof("param")
        if which in (None, "body_assist_for_manipulation"):
            return
        trajectory, field, X_RN = control.base_offset_rt_footprint, f"body_control.{which}", self._poses[0]
        if which == "body_pose":
            trajectory, X_RN = control.body_pose.base_offset_rt_root, None
            self._X_OR = snapshot.X_OF(control.body_pose.root_frame_name)
        if trajectory.points:
            self._times_s = times_of(trajectory, snapshot.time_s, field)
            poses = [transform(point.pose, field) for point in points_of(trajectory, field)]
            self._poses = [X if X_RN is None else X_RN @ X for X in poses]
        elif which == "body_pose":
            raise InvalidRequestError(f"{field} has no points")
        if any(abs(RollPitchYaw(X.rotation()).roll_angle()) > ROLL_RAD for X in self._poses):
            raise unsupported(f"{field}: a roll of the body above {ROLL_RAD:g} rad")

    @property
    def last(self) -> tuple[float, float]:
        """Last height (m) and pitch (rad), within the robot's range."""
        height_m, pitch_rad = np.clip(self._values(self._poses[-1])[3:], *self._range.T).tolist()
        return height_m, pitch_rad

    def walking(self) -> tuple[float, float] | None:
        """Height (m) and pitch (rad) for a walk; None for the usual ones. Raises RefusedError.

        A walk takes no heed of a pose in a frame that is fixed to the floor, as on the robot.
        """
        if self._X_OR is not None:
            return None
        if len(self._poses) > 1 or np.abs(self._values(self._poses[-1])[:3]).max() > _SHIFTED:
            raise unsupported("body_control: a shift, a turn or a path of the body over its feet during a walk")
        return self.last

    @property
    def ends_s(self) -> float:
        """Time of the last pose (s)."""
        return self._times_s[-1]

    def rows(self, feet_O: Pose2D) -> FloatArray:
        """Values (N, 5) of the poses over feet, within the robot's range: x, y, yaw, height, pitch."""
        X_FO = feet_O.transform().inverse()
        poses = self._poses if self._X_OR is None else [X_FO @ self._X_OR @ X for X in self._poses]
        most = np.array([SHIFT_M, SHIFT_M, TWIST_RAD])
        low, high = self._range.T
        return np.clip([self._values(X) for X in poses], [*-most, *low], [*most, *high])

    def at(self, rows: FloatArray, begun: FloatArray, since_s: float) -> FloatArray:
        """Values (5,) at a time since the start, on straight lines from the values at the start."""
        times_s = [0.0, *self._times_s]
        if since_s >= times_s[-1]:
            return np.asarray(rows[-1])
        return np.array([np.interp(since_s, times_s, [a, *column]) for a, column in zip(begun, rows.T, strict=True)])

    @staticmethod
    def _values(X: RigidTransform) -> list[float]:
        angles, (x, y, z) = RollPitchYaw(X.rotation()), X.translation().tolist()
        return [x, y, angles.yaw_angle(), z, angles.pitch_angle()]
