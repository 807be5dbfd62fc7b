"""Grasp candidates from the shape of what is seen, and which of them the arm can carry out.

The gripper closes along the hand's z axis, which is kept level: from the side with the wrist rolled for what stands,
from above for what lies. Along a long object the local width counts, so that a hammer is taken by its handle.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from skills.geometry import wrap
from skills.robot import FloatArray, GripperCapabilities, GripperKind

_ABOVE_SURFACE_M, _LEAST_ABOVE_SURFACE_M, _THIN_ABOVE_M = 0.004, 0.003, 0.001
_LEAST_GRIP_M, THIN_M, _LEAST_OF_THIN = 0.008, 0.020, 0.35
_BIN_M, _BREADTH_M = 0.01, 0.036
_LEAST_BEYOND, _BESIDE_THIN_M = 0.25, 0.012
_ENDING_LEVEL_M, _BEVEL_M, _SHORTER_CLOSED_M = 0.017, 0.003, 0.004
_YIELD_M, _LEAST_TOUCHING, _LOOSE_COST = 0.006, 0.55, 1.5
_FROM_ABOVE_RAD = np.radians(50.0)
_HIGHEST_FLAT_MM = 40
_BELOW_PALM_M, _OVER_TOP_M, _TIPS_UP_M = 0.05, 0.01, 0.012


@dataclass(frozen=True)
class Target:
    """An object to grasp, in the body frame: its points (N, 3), outline box, and the height of its surface (m)."""

    points_B: FloatArray
    centre_B: tuple[float, float]
    yaw_rad: float
    length_m: float
    width_m: float
    height_m: float
    base_m: float
    round: bool

    @property
    def upright(self) -> bool:
        """Returns whether it stands high enough to be taken from the side."""
        return self.height_m > 0.075


@dataclass(frozen=True)
class GraspCandidate:
    """A hand pose about an object, the width between the fingers (m), its cost, its tilt (rad, 0 level).

    `lever_m` is how far beside the grip the object's centre of mass seems to be, level and across the fingers.
    """

    X_BH: RigidTransform
    width_m: float
    cost: float
    tilt_rad: float
    lever_m: float = 0.0

    def retreated(self, distance_m: float) -> RigidTransform:
        """The hand pose drawn back along the fingers."""
        return self.X_BH @ RigidTransform([-distance_m, 0.0, 0.0])


@dataclass(frozen=True)
class _Placement:
    """A place to grasp along an object: point (x, y), direction of the approach seen from above, local width, cost."""

    xy: FloatArray
    azimuth_rad: float
    width_m: float
    half_depth_m: float
    cost: float
    lever_m: float = 0.0


def grasp_candidates(
    target: Target, p_BS: FloatArray, gripper: GripperCapabilities, beside_m: tuple[float, float] = (0.010, 0.017)
) -> list[GraspCandidate]:
    """Candidates, the best first; empty when it is too wide or too flat. p_BS is the shoulder.

    `beside_m` is left beside the fixed finger, about what stands and about what lies low.
    """
    ahead, placements = _placements(target, p_BS)
    tried = [
        _candidate(target, placement, attitude, side, gripper, beside_m[0 if target.upright else 1])
        for placement in placements
        if placement.width_m < gripper.max_grasp_m
        for attitude, side in itertools.product(_attitudes(target, placement.width_m, gripper), (1.0, -1.0))
    ]
    found = [candidate for candidate in tried if candidate is not None]
    if not target.upright:
        towards = np.array([np.cos(ahead), np.sin(ahead), 0.0])
        found = [each for each in found if each.X_BH.rotation().matrix()[:, 0] @ towards > -0.3]
    return sorted(found, key=lambda candidate: candidate.cost)


def narrowest_m(target: Target, p_BS: FloatArray) -> float | None:
    """The least width (m) over which fingers could close on an object; None where they find no place along it."""
    return min((placement.width_m for placement in _placements(target, p_BS)[1]), default=None)


def least_height_m(target: Target, p_BS: FloatArray, gripper: GripperCapabilities) -> float | None:
    """How high (m, in whole mm) an object without grasps had to be for one; None where its height is not the reason."""
    for height_mm in range(int(1000 * target.height_m) + 1, _HIGHEST_FLAT_MM):
        if grasp_candidates(replace(target, height_m=0.001 * height_mm), p_BS, gripper):
            return 0.001 * height_mm
    return None


def _placements(target: Target, p_BS: FloatArray) -> tuple[float, list[_Placement]]:
    """The direction from the shoulder (rad), and the places to grasp along an object."""
    ahead = float(np.arctan2(target.centre_B[1] - p_BS[1], target.centre_B[0] - p_BS[0]))
    return ahead, _round_placements(target, ahead) if target.round else list(_long_placements(target, ahead))


def _attitudes(target: Target, width_m: float, gripper: GripperCapabilities) -> Sequence[tuple[float, float]]:
    """Tilts of the fingers below level and, for what is taken from above, leans about its long axis; rad.

    With the first lean fingers of different length end level on both sides of something of a width.
    """
    if target.upright:
        return [(float(np.radians(tilt)), 0.0) for tilt in (0.0, 10.0, 20.0, 32.0, 45.0, 60.0, 75.0, 90.0)]
    down = [(90.0, 0.0), (78.0, 0.0), (66.0, 0.0), (54.0, 0.0), (44.0, 0.0)]
    ending_level = np.degrees(np.arctan2(_closed_tip_x_m(gripper) - gripper.fixed_tip_x_m, width_m + _ENDING_LEVEL_M))
    leaning = [(90.0, lean) for lean in (ending_level, -ending_level, 22.0, -22.0, 32.0, -32.0, 44.0, -44.0)]
    return [(float(np.radians(tilt)), float(np.radians(lean))) for tilt, lean in (*down, *leaning)]


def _round_placements(target: Target, ahead_rad: float) -> list[_Placement]:
    """A round object can be approached from any side; from the shoulder's is best."""
    centre = np.array(target.centre_B)
    return [
        _Placement(centre, ahead_rad + turn, target.width_m, 0.5 * target.width_m, 0.5 * abs(turn))
        for turn in (0.0, 0.3, -0.3, 0.6, -0.6, 0.9, -0.9)
    ]


def _long_placements(target: Target, ahead_rad: float) -> Iterator[_Placement]:
    """Places along a box's axes with the local width there; both axes for one that is nearly square."""
    square = target.length_m < 1.4 * target.width_m
    for turn in (0.0, 0.5 * np.pi) if square else (0.0,):
        yaw = target.yaw_rad + turn
        along, across = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
        offsets = target.points_B[:, :2] - np.array(target.centre_B)
        s, t = offsets @ along, offsets @ across
        middle = _balance(s, t)
        for shift in (0.0,) if square else (0.0, 0.03, -0.03, 0.06, -0.06, 0.09, -0.09):
            local = np.abs(s - middle - shift) < _BREADTH_M
            if np.count_nonzero(local) < 8:
                continue
            low, high = np.percentile(t[local], [1, 99])
            sides = ((-t[local], -low), (t[local], high))
            touching = min(_touching(s[local], side, edge_m, float(np.ptp(s))) for side, edge_m in sides)
            if touching < _LEAST_TOUCHING:
                continue
            xy = np.array(target.centre_B) + (0.0 if square else middle + shift) * along + 0.5 * (low + high) * across
            half_depth = 0.5 * (target.length_m if turn == 0.0 else target.width_m) if target.upright else 0.02
            for azimuth in (yaw, yaw + np.pi):
                off = abs(wrap(azimuth - ahead_rad))
                cost = 4.0 * abs(shift) + 2.0 * (high - low) + 0.15 * off + _LOOSE_COST * (1.0 - touching)
                yield _Placement(xy, azimuth, float(high - low), half_depth, cost, abs(shift))


def _touching(s: FloatArray, t: FloatArray, edge_m: float, length_m: float) -> float:
    """Over which part of its breadth a finger that closes at edge_m touches an outline (s along, t across, m).

    A finger at the cheek of a hammer's head touches at one end of its breadth only, and the hammer turns out of it; so
    does one that is half beyond the end of a handle. What is shorter (length_m) than the finger is broad has no more.
    """
    bins = np.round(s / _BIN_M).astype(int)
    touched = [np.percentile(t[bins == k], 98) > edge_m - _YIELD_M for k in np.unique(bins)]
    return float(sum(touched) / max(len(touched), min(2.0 * _BREADTH_M, length_m) // _BIN_M))


def _balance(s: FloatArray, t: FloatArray) -> float:
    """Where along a long object (s along, t across, m) its centre of mass is, taken as a solid of revolution.

    A hammer is heavy at its head: held by the far end of its handle it would turn in the gripper.
    """
    bins = np.round(s / _BIN_M).astype(int)
    found = [(k * _BIN_M, np.ptp(np.percentile(t[bins == k], [2, 98]))) for k in np.unique(bins)]
    places, widths = np.array(found).T
    return float(np.average(places, weights=np.maximum(widths, 1e-3) ** 2))


def _candidate(
    target: Target,
    placement: _Placement,
    attitude: tuple[float, float],
    side: float,
    gripper: GripperCapabilities,
    beside_m: float,
) -> GraspCandidate | None:
    tilt, lean = attitude
    cost = placement.cost + 0.4 * tilt
    ahead = np.array([np.cos(placement.azimuth_rad), np.sin(placement.azimuth_rad), 0.0])
    R_BH = RotationMatrix(AngleAxis(lean, ahead)) @ hand_rotation(tilt, placement.azimuth_rad, side)
    if target.upright and tilt > _FROM_ABOVE_RAD:
        below_top, depth = _top_grip(placement.half_depth_m, tilt, gripper)
        height = max(target.height_m - below_top, (gripper.tip_x_m - depth) * np.sin(tilt) + _TIPS_UP_M)
    elif target.upright:
        height = max(float(np.clip(0.56 * target.height_m, 0.05, 0.095)), 0.45 * target.height_m)
        depth = gripper.palm_x_m + placement.half_depth_m + 0.008
    else:
        beside_m = min(beside_m, _BESIDE_THIN_M) if target.height_m < THIN_M else beside_m
        low = _low_grip(R_BH, target.height_m, placement.width_m, gripper, beside_m)
        if low is None:
            return None
        depth, beyond = low
        height = 0.5 * target.height_m
        cost = placement.cost + 0.4 * abs(tilt - 0.5 * np.pi) + 0.5 * abs(lean) + 15.0 * max(0.0, 0.008 - beyond)
    across_m = gripper.fixed_z_m + beside_m + 0.5 * placement.width_m if _hinged(gripper) else 0.0
    p_HT = np.array([depth, 0.0, across_m])
    p_BT = np.array([*placement.xy, target.base_m + height])
    X_BH = RigidTransform(R_BH, p_BT - R_BH.matrix() @ p_HT)
    return GraspCandidate(X_BH, placement.width_m, float(cost), tilt, placement.lever_m)


def _top_grip(half_depth_m: float, tilt_rad: float, gripper: GripperCapabilities) -> tuple[float, float]:
    """How far below its top what stands is taken from above, and how far before the hand that is."""
    ahead_m = _BELOW_PALM_M + half_depth_m * np.cos(tilt_rad)
    return ahead_m * float(np.sin(tilt_rad)) - _OVER_TOP_M, gripper.palm_x_m + ahead_m


def hand_rotation(tilt_rad: float, azimuth_rad: float, side: float) -> RotationMatrix:
    """R_BH of a hand whose fingers point tilt_rad below level towards azimuth_rad; side (1, -1) turns it over."""
    c, s, ahead, down = np.cos(azimuth_rad), np.sin(azimuth_rad), np.cos(tilt_rad), np.sin(tilt_rad)
    x_axis, z_axis = [ahead * c, ahead * s, -down], [-side * s, side * c, 0.0]
    y_axis = [-side * down * c, -side * down * s, -side * ahead]
    return RotationMatrix(np.array([x_axis, y_axis, z_axis]).T)


def _low_grip(
    R_BH: RotationMatrix, height_m: float, width_m: float, gripper: GripperCapabilities, beside_m: float
) -> tuple[float, float] | None:
    """How far before the hand it holds the middle of what lies, and how far its fingers reach past that; m.

    The lowest corner of the closed fingers stays just above the surface; the finger that ends higher counts for what
    they hold. None where that is too little.
    """
    up_H, inner_z = R_BH.matrix()[2], gripper.fixed_z_m
    if not _hinged(gripper):  # the fingers close on both sides alike
        inner_z, beside_m = -0.5 * width_m, 0.0
    down, outer_z = -float(up_H[0]), inner_z + beside_m + width_m
    fixed_end, moving_end = (gripper.fixed_tip_x_m, inner_z), (_closed_tip_x_m(gripper), outer_z)
    thick = gripper.tip_thickness_m
    backs = ((x - _BEVEL_M, z + out) for (x, z), out in ((fixed_end, -thick), (moving_end, thick)))
    corners = [fixed_end, moving_end, *backs]
    lowest = min(up_H[0] * x + up_H[2] * z for x, z in corners) - abs(up_H[1]) * gripper.half_breadth_m
    open_m = max(up_H[0] * x + up_H[2] * z for x, z in (fixed_end, moving_end)) - lowest
    least = -(_LEAST_BEYOND if height_m < 0.04 else 0.5) * height_m
    above = _above_surface(height_m, 0.5 * height_m - open_m - least * down)
    beyond = (0.5 * height_m - above - open_m) / down
    if beyond < least or height_m - above - open_m < min(_LEAST_GRIP_M, _LEAST_OF_THIN * height_m):
        return None
    middle_z = up_H[2] * (outer_z - 0.5 * width_m)
    return float((above - 0.5 * height_m - lowest + middle_z) / down), float(beyond)


def _closed_tip_x_m(gripper: GripperCapabilities) -> float:
    """Where the moving finger ends when it holds something narrow: it turns, and reaches farthest half open."""
    return max(gripper.fixed_tip_x_m, gripper.tip_x_m - _SHORTER_CLOSED_M)


def _hinged(gripper: GripperCapabilities) -> bool:
    return gripper.kind is GripperKind.HINGED


def _above_surface(height_m: float, spare_m: float) -> float:
    """How far the fingertips stay above the surface (m): more for what is high, less for what is flat."""
    usual = _ABOVE_SURFACE_M + 0.4 * max(0.0, height_m - 0.03)
    least = _THIN_ABOVE_M if height_m < THIN_M else _LEAST_ABOVE_SURFACE_M
    return float(np.clip(spare_m - 1e-6, least, usual))
