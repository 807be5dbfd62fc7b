"""Poses of the hand and arm angles that put a held object down on a surface."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from skills.api import PlanningError, Surface
from skills.geometry import inside_polygon
from skills.manipulation.arm.arm_skill import Goal
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.kinematics import ArmModel
from skills.manipulation.arm.motion import ArmPlanner
from skills.robot import FloatArray

ABOVE_M, LEAST_ABOVE_M, TILT_RAD = 0.10, 0.05, 0.3
"""Height of the object's lowest point over the surface (m) before the hand goes down.

Spots out of reach use the lower height; flat objects are tilted there as well.
"""
LEVEL = 0.5
"""Fingers whose direction has a larger level share point to a side, not down."""
_FLAT = 1.2
"""An object cannot fall over when it is lower than this multiple of its width."""
_LEAST_BACK_M = 0.08
"""The open hand must be able to move back from a spot by this distance."""
_MARGIN_RAD = 0.05
_OFF_SURFACE_M, _EDGE_M = 0.01, 0.1


@dataclass(frozen=True)
class HeldObject:
    """What the hand holds: how the hand was turned when the object stood, and its corners (N, 3) in the hand frame."""

    R_BH: RotationMatrix
    corners_H: FloatArray

    @property
    def p_HO(self) -> FloatArray:
        """The object's middle in the hand frame (3,), m."""
        return np.asarray(0.5 * (self.corners_H.min(axis=0) + self.corners_H.max(axis=0)))

    @property
    def box_H(self) -> Box:
        """The box about it in the hand frame."""
        x, y, z = np.maximum(self.corners_H.max(axis=0) - self.corners_H.min(axis=0), 0.01)
        return Box(RigidTransform(self.p_HO), (float(x), float(y), float(z)))

    def box(self, X_BH: RigidTransform) -> Box:
        """The upright box about it where the hand holds it at X_BH (B), a little lifted off what it stands on."""
        corners_B = self.corners_H @ X_BH.rotation().matrix().T + X_BH.translation()
        low, high = corners_B.min(axis=0) + [0.0, 0.0, _OFF_SURFACE_M], corners_B.max(axis=0)
        x, y, z = np.maximum(high - low, 0.01)
        return Box(RigidTransform(0.5 * (low + high)), (float(x), float(y), float(z)))

    def drop_m(self, rotation: RotationMatrix) -> float:
        """How far below the hand's origin the object reaches, with the hand turned so."""
        return -float(np.min(self.corners_H @ rotation.matrix()[2]))

    def rotations(self, azimuth_rad: float) -> list[RotationMatrix]:
        """How the hand may be turned for the object to stand as it stood.

        Fingers that do not point down point towards an azimuth, or somewhat aside.
        """
        x_axis = self.R_BH.matrix()[:, 0]
        level = math.hypot(x_axis[0], x_axis[1]) > LEVEL
        ahead = azimuth_rad - math.atan2(x_axis[1], x_axis[0]) if level else azimuth_rad
        turns = (0.0, 0.4, -0.4) if level else tuple(k * math.pi / 4 for k in range(8))
        return [RotationMatrix.MakeZRotation(ahead + turn) @ self.R_BH for turn in turns]

    def approaches(self) -> Sequence[tuple[float, float]]:
        """Heights over the surface (m) and tilts (rad) from which the object can go down, the best first."""
        tilted = [(LEAST_ABOVE_M, TILT_RAD)] if self._is_flat() else []
        return [(ABOVE_M, 0.0), (LEAST_ABOVE_M, 0.0), *tilted]

    def _is_flat(self) -> bool:
        """Returns whether the object is too low for its width to fall over when the gripper lets go of it tilted."""
        x, y, height = np.ptp(self.corners_H @ self.R_BH.matrix().T, axis=0)
        return bool(height < _FLAT * min(x, y))

    def above(
        self, p_BT: FloatArray, p_BS: FloatArray, above_m: float, tilt_rad: float = 0.0
    ) -> Iterator[RigidTransform]:
        """Poses of the hand with the object so far over a point of a surface, as it stood; p_BS is the shoulder.

        Tilted, fingers that point down point away from the shoulder a little.
        """
        azimuth = math.atan2(p_BT[1] - p_BS[1], p_BT[0] - p_BS[0])
        ahead = RotationMatrix.MakeZRotation(azimuth)
        tilt = ahead @ RotationMatrix.MakeYRotation(-tilt_rad) @ ahead.inverse()
        for rotation in (tilt @ each for each in self.rotations(azimuth)):
            middle = rotation @ self.p_HO
            p_BH = np.array([*(p_BT - middle)[:2], p_BT[2] + above_m + self.drop_m(rotation)])
            yield RigidTransform(rotation, p_BH)


@dataclass(frozen=True)
class PrePlacePose:
    """Joint angles (J,) with the object over its spot, and the height (m) of its lowest point over the surface."""

    q_rad: FloatArray
    height_m: float


@dataclass(frozen=True)
class Release:
    """How the hand lets go: what stands beside, as boxes (B), and how far the gripper is open then (rad)."""

    beside: Sequence[Box]
    opening: float


def above_goal(
    on_top_B: list[FloatArray], held: HeldObject, planner: ArmPlanner, release: Release
) -> Callable[[ArmScene, FloatArray], FloatArray]:
    """A goal with the object over the first of some points of a surface that the arm can reach, as it stood before.

    The open hand must find its way out again without touching what stands beside.
    """

    def goal(scene: ArmScene, q: FloatArray) -> FloatArray:
        """Arm angles above the first spot that can be reached and gone down to. Raises PlanningError."""
        for (above_m, tilt_rad), p_BT in itertools.product(held.approaches(), on_top_B):
            for X_BH in held.above(p_BT, scene.model.p_BS, above_m, tilt_rad):
                for solution in scene.model.inverse(X_BH, margin_rad=_MARGIN_RAD):
                    q_above = scene.model.turned_near(solution, q)
                    if scene.free(q_above) and _can_put_down(scene, q_above, above_m, planner, release):
                        return q_above
        raise PlanningError("no free spot is within the arm's reach")

    return goal


def with_held(goal: Goal, box_H: Box) -> Goal:
    """That goal; on the path to it the box is in the hand, unless that touches something at the path's very ends."""

    def chosen(scene: ArmScene, q: FloatArray) -> FloatArray:
        q_goal = goal(scene, q)
        scene.hold([box_H])
        if not (scene.free(q) and scene.free(q_goal)):
            scene.hold(())
        return q_goal

    return chosen


def reaches(model: ArmModel, X_BH: RigidTransform) -> bool:
    """Whether the arm reaches a pose of the hand with the object above its spot and the one at which it stands."""
    lowered = RigidTransform(X_BH.rotation(), X_BH.translation() - [0.0, 0.0, LEAST_ABOVE_M])
    return model.reaches(X_BH, _MARGIN_RAD) and model.reaches(lowered, _MARGIN_RAD)


def _can_put_down(scene: ArmScene, q_rad: FloatArray, above_m: float, planner: ArmPlanner, release: Release) -> bool:
    """Returns whether the hand can go down from there and, with its finger open, back again."""
    X_BH = scene.model.X_BH(q_rad)
    lowered = RigidTransform(X_BH.rotation(), X_BH.translation() - [0.0, 0.0, above_m])
    back = lowered @ RigidTransform([-_LEAST_BACK_M, 0.0, 0.0])
    try:
        down = planner.line(scene.model, q_rad, lowered)
        with scene.with_only(release.beside, release.opening):
            planner.line(scene.model, down[-1], back, scene)
    except PlanningError:
        return False
    return True


def clear_heights(heights_m: Sequence[float], now_m: float, held_W: FloatArray, surface: Surface) -> Sequence[float]:
    """Those heights of the body (m), the first in any case, at which what is held does not press on a surface.

    `held_W` are its corners (N, 3) while the body is `now_m` high, with the arm as it stays. Only what is above the
    surface or its edge can come to press on it.
    """
    room_m = float(held_W[:, 2].min()) - surface.height_m
    if room_m < 0.0 or not inside_polygon(held_W[:, :2], surface.polygon_W, _EDGE_M).any():
        return heights_m
    lowest_m = now_m - room_m + _OFF_SURFACE_M
    return [*heights_m[:1], *(height_m for height_m in heights_m[1:] if height_m > lowest_m)]
