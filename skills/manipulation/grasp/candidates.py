"""Grasp candidates from the shape of an observed object, the reasons for a lack of them, and those tried before.

The gripper closes along the hand's z axis, which is kept level: from the side with the wrist rolled for upright
objects, from above for low ones and for the tops of upright ones.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from skills.class_forms import class_form
from skills.manipulation.arm.poses import hand_rotation
from skills.manipulation.grasp.placements import Placement, Target, placements
from skills.quantities import Coordinate, Cosine
from skills.robot import FloatArray, GripperCapabilities, GripperKind
from skills.world_model import ObjectKind

THIN_M = 0.020
"""Objects lower than this count as thin."""
_ABOVE_SURFACE_M = 0.004
"""Usual distance of the fingertips from the surface."""
_LEAST_ABOVE_SURFACE_M = 0.003
"""Least distance of the fingertips from the surface."""
_THIN_ABOVE_M = 0.001
"""The same for a thin object."""
_LEAST_GRIP_M = 0.008
"""Least height that the fingers must cover of a low object."""
_LEAST_OF_THIN = 0.35
"""The same for a thin object, as a fraction of its height."""
_LEAST_BEYOND = 0.25
"""Largest height of the fingertips above a flat object's centre, as a fraction of its height."""
_WELL_BEYOND_M = 0.006
"""Depth of the fingertips below an object's centre: rounded tips above it press a round handle out."""
_PER_HIGH_M = 60.0
"""Cost of fingers that end higher, per metre."""
_BESIDE_THIN_M = 0.012
"""Gap between the fixed finger and a thin object."""
_ENDING_LEVEL_M = 0.012
"""Gap between fingers and object in the computation of the lean at which fingers of different length end level.

It is less than the gap before they close, because afterwards there is none.
"""
_PER_UNEVEN_M = 60.0
"""Cost of the difference in height of the ends of closed fingers, which press an object round, per metre."""
_BEVEL_M = 0.003
"""Distance by which the back of a fingertip ends behind its tip."""
_SHORTER_CLOSED_M = 0.004
"""Loss of the moving finger's reach from half open to closed."""
_HIGHEST_FLAT_MM = 40
"""Height up to which an object may be refused as too flat."""
_BELOW_PALM_M = 0.05
"""Distance of the grip from the palm when an upright object is grasped from above."""
_OVER_TOP_M = 0.01
"""Distance of the palm over the top of an upright object that is grasped from above."""
_AHEAD_OF_PALM_M = 0.008
"""Gap between the palm and an upright object that is grasped from the side."""
_HOLLOW_M = 0.05
"""Width below which an upright object may be loose in the hollow behind the tips of a hinged gripper."""
_BEHIND_TIPS_M = 0.004
"""Distance of such an object's centre from the end of the fixed finger."""
_TIPS_UP_M = 0.012
"""Least height of the fingertips over the surface when an upright object is grasped from above."""
_SAME_TURN_RAD = 0.35
"""Grasps whose directions differ by less are the same."""
_SAME_PLACE_M = 0.03
"""Grasps whose hands are nearer than this are the same."""


@dataclass(frozen=True)
class GraspCandidate:
    """Hand pose at an object, the width between the fingers (m), its cost, and its tilt (rad, 0 level).

    `lever_m` is the estimated horizontal distance, across the fingers, from the grip to the object's centre of mass.
    """

    X_BH: RigidTransform
    width_m: float
    cost: float
    tilt_rad: float
    lever_m: float = 0.0

    def retreat(self, distance_m: float) -> RigidTransform:
        """Returns the hand pose drawn back along the fingers."""
        return self.X_BH @ RigidTransform([-distance_m, 0.0, 0.0])


def grasp_candidates(
    target: Target, p_BS: FloatArray, gripper: GripperCapabilities, beside_m: tuple[float, float] = (0.010, 0.017)
) -> list[GraspCandidate]:
    """Returns candidates, the best first; an empty list when the object is too wide or too flat. p_BS is the shoulder.

    `beside_m` are the gaps at the fixed finger, for an upright object and for a low one.
    """
    ahead = _ahead_rad(target, p_BS)
    tried = [
        _candidate(target, placement, attitude, side, gripper, beside_m[0 if target.upright else 1])
        for placement in placements(target, p_BS, ahead)
        if placement.width_m < gripper.max_grasp_m
        for attitude, side in itertools.product(_attitudes(target, placement, gripper), (1.0, -1.0))
    ]
    found = [candidate for candidate in tried if candidate is not None]
    if not target.upright:
        towards = np.array([np.cos(ahead), np.sin(ahead), 0.0])
        found = [each for each in found if each.X_BH.rotation().matrix()[:, 0] @ towards > -0.3]
    return sorted(found, key=lambda candidate: candidate.cost)


def _ahead_rad(target: Target, p_BS: FloatArray) -> float:
    """Direction from the shoulder to an object."""
    return float(np.arctan2(target.centre_B[1] - p_BS[1], target.centre_B[0] - p_BS[0]))


def _least_height_m(target: Target, p_BS: FloatArray, gripper: GripperCapabilities) -> float | None:
    """Minimum height (m, in whole mm) at which the object has candidates; None when its height is not the reason."""
    heights_m = (0.001 * height_mm for height_mm in range(int(1000 * target.height_m) + 1, _HIGHEST_FLAT_MM))
    return next((each for each in heights_m if grasp_candidates(replace(target, height_m=each), p_BS, gripper)), None)


def _attitudes(target: Target, placement: Placement, gripper: GripperCapabilities) -> Sequence[tuple[float, float]]:
    """Tilts of the fingers below level and, for grasps from above, roll angles about the object's long axis (rad).

    At the first roll, fingers of different length end at equal height on both sides of an object of this width.
    """
    if placement.rim:
        return [(0.5 * np.pi, 0.0)]
    if target.upright:
        tilts = (60.0, 75.0, 90.0) if placement.below_top_m else (0.0, 10.0, 20.0, 32.0, 45.0)
        return [(float(np.radians(tilt)), 0.0) for tilt in tilts]
    down = [(90.0, 0.0), (78.0, 0.0), (66.0, 0.0), (54.0, 0.0), (44.0, 0.0)]
    uneven_m = _closed_tip_x_m(gripper) - gripper.fixed_tip_x_m
    ending_level = np.degrees(np.arctan2(uneven_m, placement.width_m + _ENDING_LEVEL_M))
    leaning = [(90.0, lean) for lean in (ending_level, -ending_level, 22.0, -22.0, 32.0, -32.0, 44.0, -44.0)]
    return [(float(np.radians(tilt)), float(np.radians(lean))) for tilt, lean in (*down, *leaning)]


def _candidate(
    target: Target,
    placement: Placement,
    attitude: tuple[float, float],
    side: float,
    gripper: GripperCapabilities,
    beside_m: float,
) -> GraspCandidate | None:
    tilt, lean = attitude
    cost = placement.cost + 0.4 * tilt
    ahead = np.array([np.cos(placement.azimuth_rad), np.sin(placement.azimuth_rad), 0.0])
    R_BH = RotationMatrix(AngleAxis(lean, ahead)) @ hand_rotation(tilt, placement.azimuth_rad, side)
    if placement.below_top_m:
        below_top, depth = _top_grip(placement, tilt, gripper)
        height = max(target.height_m - below_top, (gripper.tip_x_m - depth) * np.sin(tilt) + _TIPS_UP_M)
    elif target.upright:
        height = placement.height_m
        depth = gripper.palm_x_m + placement.half_depth_m + _AHEAD_OF_PALM_M
        if gripper.kind is GripperKind.HINGED and placement.width_m < _HOLLOW_M:
            depth = max(depth, gripper.fixed_tip_x_m - _BEHIND_TIPS_M)
    else:
        beside_m = min(beside_m, _BESIDE_THIN_M) if target.height_m < THIN_M else beside_m
        low = _low_grip(R_BH, target.height_m, placement.width_m, gripper, beside_m)
        if low is None:
            return None
        depth, beyond = low
        height = 0.5 * target.height_m
        cost = placement.cost + 0.4 * abs(tilt - 0.5 * np.pi) + 0.5 * abs(lean)
        cost += _PER_HIGH_M * max(0.0, _WELL_BEYOND_M - beyond)
        cost += _PER_UNEVEN_M * _uneven_m(R_BH, placement.width_m, gripper)
    across_m = gripper.fixed_z_m + beside_m + 0.5 * placement.width_m if gripper.kind is GripperKind.HINGED else 0.0
    p_HT = np.array([depth, 0.0, across_m])
    p_BT = np.array([*placement.xy, target.base_m + height])
    X_BH = RigidTransform(R_BH, p_BT - R_BH.matrix() @ p_HT)
    return GraspCandidate(X_BH, placement.width_m, float(cost), tilt, placement.lever_m)


def _top_grip(placement: Placement, tilt_rad: float, gripper: GripperCapabilities) -> tuple[float, float]:
    """Distances of a grasp from above (m): from the top down to the grip, and from the hand to the object's centre."""
    ahead_m = _BELOW_PALM_M + placement.half_depth_m * np.cos(tilt_rad)
    over_top_m = max(_OVER_TOP_M, gripper.tip_x_m - gripper.palm_x_m - placement.below_top_m)
    return ahead_m * float(np.sin(tilt_rad)) - over_top_m, gripper.palm_x_m + ahead_m


def _low_grip(
    R_BH: RotationMatrix, height_m: float, width_m: float, gripper: GripperCapabilities, beside_m: float
) -> tuple[float, float] | None:
    """Distances of a grasp of a low object (m): from the hand to its centre, and from its centre to the fingertips.

    The lowest corner of the closed fingers stays just above the surface, and the higher fingertip limits the grip. None
    when the fingers cover too little of the object.
    """
    up_H, inner_z = R_BH.matrix()[2], gripper.fixed_z_m
    if gripper.kind is not GripperKind.HINGED:  # the fingers close on both sides alike
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


def _uneven_m(R_BH: RotationMatrix, width_m: float, gripper: GripperCapabilities) -> float:
    """Difference in height (m) between the tips of both fingers when they are closed on a width."""
    ahead_m = _closed_tip_x_m(gripper) - gripper.fixed_tip_x_m
    across_m = width_m if gripper.kind is GripperKind.HINGED else 0.0
    return abs(float(R_BH.matrix()[2] @ [ahead_m, 0.0, across_m]))


def _closed_tip_x_m(gripper: GripperCapabilities) -> float:
    """Position (m) along the hand of the moving finger's tip on a narrow object: it reaches farthest half open."""
    return max(gripper.fixed_tip_x_m, gripper.tip_x_m - _SHORTER_CLOSED_M)


def _above_surface(height_m: float, spare_m: float) -> float:
    """Distance between fingertips and surface (m): larger for a high object, smaller for a flat one."""
    usual = _ABOVE_SURFACE_M + 0.4 * max(0.0, height_m - 0.03)
    least = _THIN_ABOVE_M if height_m < THIN_M else _LEAST_ABOVE_SURFACE_M
    return float(np.clip(spare_m - 1e-6, least, usual))


def least_mass_kg(kind: ObjectKind) -> float:
    """Minimum mass of an object by its class; 0.0 for a class without an entry."""
    mass_kg = class_form(kind.name).mass_kg
    return 0.0 if mass_kg is None else mass_kg[0]


def why_too_heavy(kind: ObjectKind, max_payload_kg: float) -> str | None:
    """Returns why even the lightest object of a class is too heavy for the arm; None when only weighing can decide.

    Size does not determine the mass: a hose widens an extinguisher, which may be empty.
    """
    mass_kg = least_mass_kg(kind)
    if mass_kg <= max_payload_kg:
        return None
    return f"the {kind} weighs {mass_kg:.1f} kg at least, and the arm carries {max_payload_kg:.1f} kg at most"


def why_no_candidates(target: Target, p_BS: FloatArray, gripper: GripperCapabilities, name: str) -> str:
    """Returns why an object has no candidates: too wide, too flat, or no straight outline. p_BS is the shoulder."""
    width_m = min((each.width_m for each in placements(target, p_BS, _ahead_rad(target, p_BS))), default=None)
    if width_m is not None and width_m >= gripper.max_grasp_m:
        return (
            f"the {name} is too wide for the gripper: {1000 * width_m:.0f} mm where it is narrowest, "
            f"and the gripper takes less than {1000 * gripper.max_grasp_m:.0f} mm"
        )
    least_m = _least_height_m(target, p_BS, gripper)
    if least_m is not None:
        return (
            f"the {name} is too flat for the gripper: {1000 * target.height_m:.0f} mm high, "
            f"and the fingers need {1000 * least_m:.0f} mm"
        )
    return f"the fingers find no hold on the {name}: no straight part of its outline is as wide as they are"


@dataclass(frozen=True)
class TriedGrasp:
    """Grasp in the world's axes: directions of the fingers and of their closing, the hand from the object (m)."""

    pointing_W: tuple[Cosine, Cosine, Cosine]
    closing_W: tuple[Cosine, Cosine, Cosine]
    hand_from_object_W: tuple[Coordinate, Coordinate, Coordinate]


def tried_grasp(candidate: GraspCandidate, centre_B: tuple[float, float], X_WB: RigidTransform) -> TriedGrasp:
    """Returns a candidate as a tried grasp; `centre_B` is the object's centre (x, y), X_WB the body's pose then."""
    R_WH = X_WB.rotation().matrix() @ candidate.X_BH.rotation().matrix()
    p_B = candidate.X_BH.translation() - np.array([*centre_B, 0.0])
    return TriedGrasp(_vector(R_WH[:, 0]), _vector(R_WH[:, 2]), _vector(X_WB.rotation().matrix() @ p_B))


def others_first(
    candidates: Sequence[GraspCandidate],
    tried: Sequence[TriedGrasp],
    centre_B: tuple[float, float],
    X_WB: RigidTransform,
) -> list[GraspCandidate]:
    """Returns the candidates in their order, those like tried grasps last, without those like the last two tries."""

    def equal_tries(candidate: GraspCandidate) -> list[bool]:
        now = tried_grasp(candidate, centre_B, X_WB)
        return [same_grasp(now, before) for before in tried]

    equal = [(sum(tries), number, tries) for number, tries in enumerate(map(equal_tries, candidates))]
    return [candidates[number] for _, number, tries in sorted(equal) if len(tries) < 2 or not all(tries[-2:])]


def same_grasp(one: TriedGrasp, other: TriedGrasp) -> bool:
    """Returns whether two grasps are the same but for small differences; the gripper may be turned over."""
    least = math.cos(_SAME_TURN_RAD)
    pointing = float(np.dot(one.pointing_W, other.pointing_W))
    closing = abs(float(np.dot(one.closing_W, other.closing_W)))
    apart_xy_m = float(np.linalg.norm(np.subtract(one.hand_from_object_W, other.hand_from_object_W)[:2]))
    return pointing > least and closing > least and apart_xy_m < _SAME_PLACE_M


def _vector(values: FloatArray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return (x, y, z)
