"""Object in the hand: its corners, and the rotations of the hand at which the object is upright again."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from skills.api import Payload
from skills.manipulation.arm.collision import Box, box_between, box_corners
from skills.manipulation.arm.poses import hand_rotation
from skills.robot import FloatArray, GripperCapabilities

ABOVE_M = 0.10
"""Height of the object's lowest point over the surface before the hand goes down."""
LEAST_ABOVE_M = 0.05
"""The same height where a spot is out of reach from `ABOVE_M`."""
TILT_RAD = 0.3
"""Tilt of a flat object at `LEAST_ABOVE_M`, if the level hand does not reach its spot."""
OFF_SURFACE_M = 0.01
"""Gap between an object and its surface below which the two count as in contact."""
_THINNEST_M = 0.01
"""Least side of the box around an object."""
_LESS_M = 0.01
"""Margin by which the box of a held object is smaller on each side than its observation."""
_LEVEL = 0.5
"""Fingers whose direction has a larger horizontal component point to a side, not down."""
_FLAT = 1.2
"""Ratio of height to width below which an object cannot fall over."""
_LONG = 1.5
"""Least ratio of an object's level sides for which it may have to lie along an edge."""
_TURNS_BELOW_RAD = 0.36
"""Largest tilt of a hand in which an upright object turns square to the fingers."""
_SIDE_DROP_M = 0.12
"""Assumed extent below and above the fingers of an unknown object that is held from the side."""
_TOP_DEPTH_M = 0.06
"""Assumed extent along the fingers of an unknown object that is held from above."""


@dataclass(frozen=True)
class HeldObject:
    """Object in the hand: rotation of the hand when the object stood, and its corners (N, 3) in the hand frame."""

    R_BH: RotationMatrix
    corners_H: FloatArray

    @property
    def p_HO(self) -> FloatArray:
        """The object's centre (3,) in the hand frame (m)."""
        return np.asarray(0.5 * (self.corners_H.min(axis=0) + self.corners_H.max(axis=0)))

    @property
    def box_H(self) -> Box:
        """Box around the object in the hand frame."""
        return box_between(self.corners_H.min(axis=0), self.corners_H.max(axis=0), _THINNEST_M)

    def box(self, X_BH: RigidTransform) -> Box:
        """Upright box (B) around the object in a hand at X_BH; its bottom is raised by `OFF_SURFACE_M`."""
        corners_B = self.corners_H @ X_BH.rotation().matrix().T + X_BH.translation()
        return box_between(corners_B.min(axis=0) + [0.0, 0.0, OFF_SURFACE_M], corners_B.max(axis=0), _THINNEST_M)

    def drop_m(self, rotation: RotationMatrix) -> float:
        """Distance (m) from the hand's origin down to the object's lowest point, at a rotation of the hand."""
        return -float(np.min(self.corners_H @ rotation.matrix()[2]))

    @property
    def half_width_m(self) -> float:
        """Half the shorter horizontal side of the standing object."""
        return 0.5 * float(self._sides_m[self._level_axes[1]])

    @property
    def _sides_m(self) -> FloatArray:
        return np.asarray(np.ptp(self.corners_H, axis=0))

    @property
    def _level_axes(self) -> tuple[int, int]:
        """Hand axes that were horizontal before the grasp lifted the object; the one along its longer side first."""
        upright = int(np.argmax(np.abs(self.R_BH.matrix()[2])))
        first, second = (axis for axis in range(3) if axis != upright)
        return (first, second) if self._sides_m[first] >= self._sides_m[second] else (second, first)

    def rotations(self, azimuth_rad: float, along_rad: float | None = None) -> list[RotationMatrix]:
        """Returns rotations of the hand at which the object is upright as before.

        Fingers point down, or within 0.4 rad of an azimuth. The last rotations of downward fingers align a long object
        with the direction `along_rad`.
        """
        x_axis = self.R_BH.matrix()[:, 0]
        level = math.hypot(x_axis[0], x_axis[1]) > _LEVEL
        ahead = azimuth_rad - math.atan2(x_axis[1], x_axis[0]) if level else azimuth_rad
        turns = [ahead + turn for turn in (0.0, 0.4, -0.4)] if level else [ahead + k * math.pi / 4 for k in range(8)]
        longer, shorter = self._level_axes
        if along_rad is not None and not level and self._sides_m[longer] > _LONG * self._sides_m[shorter]:
            x, y, _ = self.R_BH.matrix()[:, longer]
            turns += [along_rad - math.atan2(y, x), along_rad - math.atan2(y, x) + math.pi]
        return [RotationMatrix.MakeZRotation(turn) @ self.R_BH for turn in turns]

    def approaches(self) -> Sequence[tuple[float, float]]:
        """Heights above the surface (m) and tilts (rad) from which the object can be lowered, the best first."""
        tilted = [(LEAST_ABOVE_M, TILT_RAD)] if self._is_flat() else []
        return [(ABOVE_M, 0.0), (LEAST_ABOVE_M, 0.0), *tilted]

    def _is_flat(self) -> bool:
        """Returns whether the object is so flat that it cannot fall over after a tilted release."""
        x, y, height = np.ptp(self.corners_H @ self.R_BH.matrix().T, axis=0)
        return bool(height < _FLAT * min(x, y))

    def above(
        self, p_BT: FloatArray, p_BS: FloatArray, above_m: float, tilt_rad: float = 0.0, along_rad: float | None = None
    ) -> Iterator[RigidTransform]:
        """Yields hand poses that hold the object, upright as before, at a height above a point p_BT on a surface.

        p_BS is the shoulder. Downward fingers tilt by `tilt_rad` away from the shoulder. A long object may lie along
        the direction `along_rad`, such as that of the surface's edge.
        """
        azimuth = math.atan2(p_BT[1] - p_BS[1], p_BT[0] - p_BS[0])
        ahead = RotationMatrix.MakeZRotation(azimuth)
        tilt = ahead @ RotationMatrix.MakeYRotation(-tilt_rad) @ ahead.inverse()
        for rotation in (tilt @ each for each in self.rotations(azimuth, along_rad)):
            middle = rotation @ self.p_HO
            p_BH = np.array([*(p_BT - middle)[:2], p_BT[2] + above_m + self.drop_m(rotation)])
            yield RigidTransform(rotation, p_BH)


def held_object(payload: Payload, gripper: GripperCapabilities, R_BH: RotationMatrix) -> HeldObject:
    """Returns the object that the payload describes; for an unknown object, a guess from the hand's rotation."""
    if payload.corners_H is not None and payload.R_BH is not None:
        return HeldObject(payload.R_BH, payload.corners_H)
    if abs(R_BH.matrix()[2, 2]) < _LEVEL:
        low_H = R_BH.matrix().T @ np.array([0.0, 0.0, -_SIDE_DROP_M])
        return HeldObject(R_BH, np.array([gripper.grip_x_m, 0.0, 0.0]) + np.array([low_H, -low_H]))
    tip_H = np.array([gripper.tip_x_m, 0.0, 0.0])
    return HeldObject(hand_rotation(0.5 * math.pi, 0.0, 1.0), np.array([tip_H, tip_H - [_TOP_DEPTH_M, 0.0, 0.0]]))


def square_hand_pose(X_BH: RigidTransform, p_HT: FloatArray) -> RigidTransform:
    """Returns the hand pose that would have grasped an upright object, held at p_HT, square to the fingers.

    The fingers form a groove. An upright object in a slightly tilted hand turns in the groove until it is square to the
    fingers (measured in the plant: from 10 to 0 degrees within half a minute), and is upright below a level hand. A
    pose with a larger tilt is returned unchanged.
    """
    x, y, z = X_BH.rotation().matrix()[:, 0]
    if abs(z) > np.sin(_TURNS_BELOW_RAD):
        return X_BH
    level_axis = np.array([-y, x, 0.0]) / np.hypot(x, y)
    level = RotationMatrix(AngleAxis(-float(np.arcsin(-z)), level_axis)) @ X_BH.rotation()
    return RigidTransform(level, X_BH @ p_HT - level @ p_HT)


def held_box(X_HB: RigidTransform, box: Box) -> Box:
    """Returns a box in B as the upright box around it in H, shrunk a little, for the object once it is held."""
    corners = box_corners(Box(X_HB @ box.X_FG, box.size_m))
    return box_between(corners.min(axis=0) + _LESS_M, corners.max(axis=0) - _LESS_M, _THINNEST_M)
