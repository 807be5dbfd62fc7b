"""Arm configurations: looking at a point with the hand camera, carrying an object near the body."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from skills.manipulation.arm.collision import ArmScene
from skills.manipulation.arm.kinematics import arm_model
from skills.robot import ArmCapabilities, Capabilities, FloatArray, GripperCapabilities, GripperKind, Mount
from skills.world_model import PlanningError

UP_B = np.array([0.0, 0.0, 1.0])
_HALF_OPEN_M = 0.05
"""Gap between the jaws of a hinged gripper at which its moving finger reaches farthest."""
_FOREARM_ROLL = 3
"""Joint whose turn costs twice as much as another's, in the choice among viewing configurations."""
_CARRY_PITCHES_RAD = ((-0.25,), (0.0,), (0.4, 0.8))
"""Pitches of a hand that cannot keep the object upright while it carries, in groups, best first."""
_CLEAR_M = (0.03, 0.0)
"""Clearances from boxes, the best first, once the torso has sunk with a held object, whose box is a little small."""
_HANGS_M = 0.03
"""Least distance of a hanging object's centre beyond the fingertips."""
_TURNS_HANGING_RAD = tuple(np.linspace(-np.pi, np.pi, 8, endpoint=False))
_CLOSE_BELOW_RAD = tuple(np.radians([42.0, 35.0, 50.0, 58.0, 28.0]))
"""Angles below level at which a close view looks down, the best first."""
_CLOSE_M = (0.42, 0.36, 0.48)
"""Distances of a close view, the best first."""
TALL_M = 0.4
"""Height from which on an object does not fit into a picture from the usual viewpoints."""
_BACK_M = 0.18
"""Additional distance of the viewpoints of a taller object."""
_NEAR_M = (0.33, 0.5)
"""Range of distances of a view that counts as close."""
_BELOW_RAD = (0.45, 1.05)
"""Range of angles below level of a view that counts as close."""
_OFF_AXIS_RAD = 0.12
"""Largest angle off the optical axis in a view that counts as close."""

_TRIES = 3000
"""Configurations that are tried to stow an arm."""
_LOW = 0.1
"""Cost of a metre of height of a stowed arm, in metres beyond the footprint."""
_WIDE = 0.75
"""Tangent of half the angle of a wide view."""
_THICK_M = 0.1
"""Half width of the arm about its joints, for views."""


def camera_pose(p_BC: FloatArray, p_BT: FloatArray) -> RigidTransform:
    """Returns X_BC of a camera at p_BC that looks at p_BT with an upright picture."""
    forward = (p_BT - p_BC) / np.linalg.norm(p_BT - p_BC)
    right = np.cross(forward, UP_B)
    right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-6 else np.array([0.0, -1.0, 0.0])
    return RigidTransform(RotationMatrix(np.stack([right, np.cross(forward, right), forward], axis=1)), p_BC)


def look_configuration(
    scene: ArmScene, X_HC: RigidTransform, viewpoints_B: Iterable[FloatArray], p_BT: FloatArray, q_near_rad: FloatArray
) -> FloatArray:
    """Returns arm angles (J,) that put the hand camera (X_HC) at the first feasible viewpoint, looking at p_BT.

    Raises PlanningError when no viewpoint is feasible.
    """
    for p_BC in viewpoints_B:
        solutions = scene.model.inverse(camera_pose(p_BC, p_BT) @ X_HC.inverse())
        free = [q for q in solutions if scene.free(q)]
        if free:
            weights = 1.0 + (np.arange(len(q_near_rad)) == _FOREARM_ROLL)
            return min(free, key=lambda q: float(np.abs(q - q_near_rad) @ weights))
    raise PlanningError(f"no arm pose looks at the point {np.round(p_BT, 2).tolist()} ahead of the body")


def overview_viewpoints(
    p_BS: FloatArray, p_BT: FloatArray, shift_rad: float = 0.0, height_m: float = 0.0
) -> list[FloatArray]:
    """Camera positions above the shoulder p_BS towards p_BT, high ones first, rotated about it by shift_rad.

    For an object too tall for the picture, viewpoints from farther back come first.
    """
    backs_m = (_BACK_M, 0.0) if height_m > TALL_M else (0.0,)
    direction = np.arctan2(p_BT[1] - p_BS[1], p_BT[0] - p_BS[0]) + shift_rad
    heading = np.array([np.cos(direction), np.sin(direction), 0.0])
    return [
        p_BS + (radius - back_m) * heading + height * UP_B
        for back_m, height, radius in itertools.product(backs_m, (0.5, 0.44, 0.36), (0.22, 0.32, 0.42))
    ]


def close_viewpoints(
    p_BS: FloatArray,
    p_BT: FloatArray,
    aside_rad: float = 0.0,
    below_rad: Sequence[float] = _CLOSE_BELOW_RAD,
    distances_m: Sequence[float] = _CLOSE_M,
) -> list[FloatArray]:
    """Camera positions near p_BT that look down at it from the shoulder's side, rotated about p_BT by aside_rad."""
    direction = np.arctan2(p_BT[1] - p_BS[1], p_BT[0] - p_BS[0]) + aside_rad
    return [
        p_BT + distance * np.array([-np.cos(tilt) * np.cos(direction), -np.cos(tilt) * np.sin(direction), np.sin(tilt)])
        for tilt, distance in itertools.product(below_rad, distances_m)
    ]


def sees_closely(X_BC: RigidTransform, p_BT: FloatArray) -> bool:
    """Returns whether a camera at X_BC views p_BT about as closely as from `close_viewpoints`."""
    offset = p_BT - X_BC.translation()
    distance_m = float(np.linalg.norm(offset))
    off_axis_rad = np.arccos(np.clip(X_BC.rotation().matrix()[:, 2] @ offset / distance_m, -1.0, 1.0))
    below_rad = np.arcsin(-offset[2] / distance_m)
    near = _NEAR_M[0] < distance_m < _NEAR_M[1] and _BELOW_RAD[0] < below_rad < _BELOW_RAD[1]
    return bool(near and off_axis_rad < _OFF_AXIS_RAD)


def viewpoints_beside(p_BS: FloatArray, p_BC: FloatArray, p_BT: FloatArray, aside_m: float = 0.06) -> list[FloatArray]:
    """Camera positions beside and above p_BC, for when p_BT is occluded from p_BC.

    The first ones lie on the side of p_BC, as seen from the shoulder at p_BS, away from the occluder.
    """
    left, left_of_shoulder = _left_of(p_BC, p_BT), _left_of(p_BS, p_BT)
    outwards = left if (p_BC - p_BS) @ left_of_shoulder >= 0.0 else -left
    return [p_BC + aside_m * step for step in (outwards, outwards - UP_B, UP_B, -outwards, -outwards - UP_B)]


def _left_of(p_B: FloatArray, p_BT: FloatArray) -> FloatArray:
    """Horizontal unit vector to the left of the line of sight from one point to another."""
    ahead = (p_BT - p_B)[:2] / max(float(np.linalg.norm((p_BT - p_B)[:2])), 1e-6)
    return np.array([-ahead[1], ahead[0], 0.0])


def towards_shoulder(p_BS: FloatArray, p_B: FloatArray) -> FloatArray:
    """Horizontal unit vector from a point towards the shoulder at p_BS; zero straight above or below the shoulder."""
    home_B = (p_BS - p_B) * [1.0, 1.0, 0.0]
    return np.asarray(home_B / max(float(np.linalg.norm(home_B)), 1e-6))


def carry_configuration(
    scene: ArmScene, arm: ArmCapabilities, R_BH: RotationMatrix, q_near_rad: FloatArray, hangs: bool = False
) -> FloatArray:
    """Returns arm angles (J,) with the hand near the body and the object as upright as in R_BH.

    If the object cannot stay upright, the hand points forward and slightly up, so that the object rests on a finger and
    the palm; else the hand points level, or down. An object that `hangs` far below downward fingers stays there, ahead
    of the body, because its weight would turn it out of a level hand. Raises PlanningError when no pose is free.
    """
    points_down = R_BH.matrix()[2, 0] < -0.8
    turns = _TURNS_HANGING_RAD if points_down else (0.0, 0.4, -0.4)
    upright = _turned(R_BH, turns) if hangs or not points_down else []
    for rotations in (upright, *map(_forward, _CARRY_PITCHES_RAD)):
        q = _best_free(scene, rotations, arm.carry_x_m, arm.carry_z_m, arm.carry_best_x_m, q_near_rad)
        if q is not None:
            return q
    raise PlanningError("no pose to carry the object near the body is free of contact")


def hangs_below(corners_H: FloatArray | None, gripper: GripperCapabilities) -> bool:
    """Returns whether the centre of a held object, given by its corners (N, 3), is well beyond the fingertips."""
    return corners_H is not None and float(np.mean(corners_H[:, 0])) > gripper.tip_x_m + _HANGS_M


def tucked_configuration(
    scene: ArmScene, arm: ArmCapabilities, R_BH: RotationMatrix, q_near_rad: FloatArray
) -> FloatArray:
    """Returns arm angles (J,) with the hand close to the body and turned aside, the object as upright as in R_BH.

    Raises PlanningError when no pose is free.
    """
    beside = _turned(R_BH, (0.5 * np.pi, -0.5 * np.pi))
    q = _best_free(scene, beside, arm.tuck_x_m, arm.carry_z_m, arm.tuck_x_m[0], q_near_rad)
    if q is None:
        raise PlanningError("the object cannot be drawn in to the body")
    return q


def _best_free(
    scene: ArmScene,
    rotations: Sequence[RotationMatrix],
    x_m: Sequence[float],
    z_m: Sequence[float],
    best_x_m: float,
    q_near_rad: FloatArray,
) -> FloatArray | None:
    """Returns the cheapest free arm angles with the hand at one of the rotations and positions ahead of the body.

    The cost favours a small overhang of the arm, so that the robot can drive along walls and up to furniture.
    """
    candidates = [
        (_carry_cost(x - best_x_m, z, q, q_near_rad) + sum(scene.beyond_body_m(q)), q)
        for rotation, x, z in itertools.product(rotations, x_m, z_m)
        for solution in scene.model.inverse(RigidTransform(rotation, [x, 0.0, z]), margin_rad=0.05)
        for q in [scene.model.turned_near(solution, q_near_rad)]
    ]
    cheapest = itertools.product(_CLEAR_M, sorted(candidates, key=lambda candidate: candidate[0]))
    return next((q for clear_m, (_, q) in cheapest if scene.free(q) and scene.free_as_usual(q, clear_m)), None)


def _carry_cost(off_x_m: float, z_m: float, q_rad: FloatArray, q_near_rad: FloatArray) -> float:
    return 3.0 * abs(off_x_m) + z_m + 0.04 * float(np.max(np.abs(q_rad - q_near_rad))) + 0.05 * abs(float(q_rad[0]))


def _turned(R_BH: RotationMatrix, turns_rad: Sequence[float]) -> list[RotationMatrix]:
    """Returns rotations: R_BH turned about the vertical until the hand points ahead, plus each of the angles."""
    x_axis = R_BH.matrix()[:, 0]
    ahead = -float(np.arctan2(x_axis[1], x_axis[0]))
    return [RotationMatrix.MakeZRotation(ahead + turn) @ R_BH for turn in turns_rad]


def _forward(pitches_rad: tuple[float, ...]) -> list[RotationMatrix]:
    """Rotations of hands that point ahead and down by each pitch."""
    return [
        RollPitchYaw(roll, pitch, 0.0).ToRotationMatrix()
        for roll, pitch in itertools.product((0.0, np.pi), pitches_rad)
    ]


def hand_rotation(tilt_rad: float, azimuth_rad: float, side: float) -> RotationMatrix:
    """Returns R_BH of a hand with fingers tilt_rad below level towards azimuth_rad; side (1 or -1) flips the hand."""
    c, s, ahead, down = np.cos(azimuth_rad), np.sin(azimuth_rad), np.cos(tilt_rad), np.sin(tilt_rad)
    x_axis, z_axis = [ahead * c, ahead * s, -down], [-side * s, side * c, 0.0]
    y_axis = [-side * down * c, -side * down * s, -side * ahead]
    return RotationMatrix(np.array([x_axis, y_axis, z_axis]).T)


def compact_configuration(can: Capabilities) -> FloatArray:
    """Arm angles (J,), free of contact, that least overhang the footprint and occlude the cameras; by sampling."""
    model = arm_model(can)
    scene = ArmScene(can, model, {})
    low, high = np.maximum(model.lower_rad, -np.pi), np.minimum(model.upper_rad, np.pi)
    tries = low + np.random.default_rng(0).random((_TRIES, len(low))) * (high - low)
    tip_H = np.array([0.0 if can.gripper is None else can.gripper.tip_x_m, 0.0, 0.0])
    outline = np.array(can.footprint_m)
    X_BF = RigidTransform() if can.head is None else can.head.X_BF(0.0, 0.0)
    cameras = [X_BF @ each.X_FC if each.mount is Mount.HEAD else each.X_FC for each in can.body_cameras]

    def cost(q_rad: FloatArray) -> float:
        points = np.vstack([model.points_B(q_rad), model.X_BH(q_rad) @ tip_H])
        beyond = np.maximum(points[:, :2] - outline.max(axis=0), outline.min(axis=0) - points[:, :2])
        along = np.vstack([points, (points[1:] + points[:-1]) / 2.0])
        seen = sum(float(np.mean(_in_view(X_BC.inverse() @ along.T))) for X_BC in cameras)
        return float(beyond.max()) + _LOW * float(np.abs(points[:, 2]).max()) + seen

    return next((q_rad for q_rad in sorted(tries, key=cost) if scene.free(q_rad)), tries[0])


def _in_view(points_C: FloatArray) -> NDArray[np.bool_]:
    """Mask (N,) of the points (3, N) in the camera frame that are in a wide field of view."""
    x, y, z = points_C
    return np.asarray(np.hypot(x, y) < _WIDE * z + _THICK_M)


def finger_sweep_m(X_BH: RigidTransform, X_WB: RigidTransform, gripper: GripperCapabilities) -> float:
    """Depth (m) by which a hinged finger passes below the fixed one's tip while it opens or closes; else 0."""
    if gripper.kind is not GripperKind.HINGED:
        return 0.0
    up_H = (X_WB @ X_BH).rotation().matrix()[2]
    return max(0.0, -float(up_H @ [gripper.tip_x_m - gripper.fixed_tip_x_m, 0.0, _HALF_OPEN_M]))
