"""Named arm poses: looking at a point with the hand camera, carrying a thing near the body."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from skills.manipulation.arm.collision import ArmScene
from skills.manipulation.arm.kinematics import ArmModel
from skills.robot import ArmCapabilities, FloatArray
from skills.world_model import PlanningError

UP_B = np.array([0.0, 0.0, 1.0])
_CARRY_PITCHES_RAD = ((-0.25,), (0.0,), (0.4, 0.8))


def camera_pose(p_BC: FloatArray, p_BT: FloatArray) -> RigidTransform:
    """X_BC of a camera at p_BC that looks at p_BT with the picture upright."""
    forward = (p_BT - p_BC) / np.linalg.norm(p_BT - p_BC)
    right = np.cross(forward, UP_B)
    right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-6 else np.array([0.0, -1.0, 0.0])
    return RigidTransform(RotationMatrix(np.stack([right, np.cross(forward, right), forward], axis=1)), p_BC)


def look_configuration(
    scene: ArmScene, X_HC: RigidTransform, viewpoints_B: Iterable[FloatArray], p_BT: FloatArray, q_near_rad: FloatArray
) -> FloatArray:
    """Arm angles with the hand camera (X_HC) at the first possible viewpoint, looking at p_BT.

    Raises PlanningError when no viewpoint can be taken.
    """
    for p_BC in viewpoints_B:
        solutions = scene.model.inverse(camera_pose(p_BC, p_BT) @ X_HC.inverse())
        free = [q for q in solutions if scene.free(q)]
        if free:
            return min(free, key=lambda q: float(np.abs(q - q_near_rad) @ _COMFORT))
    raise PlanningError(f"no arm pose looks at the point {np.round(p_BT, 2).tolist()} ahead of the body")


_COMFORT = np.array([1.0, 1.0, 1.0, 2.0, 1.0, 1.0])


def overview_viewpoints(model: ArmModel, p_BT: FloatArray, shift_rad: float = 0.0) -> list[FloatArray]:
    """Camera places above the shoulder on p_BT's side, high ones first; shift_rad turns them about the shoulder."""
    direction = np.arctan2(p_BT[1] - model.p_BS[1], p_BT[0] - model.p_BS[0]) + shift_rad
    heading = np.array([np.cos(direction), np.sin(direction), 0.0])
    return [
        model.p_BS + radius * heading + height * UP_B
        for height, radius in itertools.product((0.5, 0.44, 0.36), (0.22, 0.32, 0.42))
    ]


def close_viewpoints(p_BS: FloatArray, p_BT: FloatArray, shift_rad: float = 0.0) -> list[FloatArray]:
    """Camera places 0.35 to 0.5 m from p_BT, on the shoulder's side of it and looking down at it."""
    direction = np.arctan2(p_BT[1] - p_BS[1], p_BT[0] - p_BS[0]) + shift_rad
    return [
        p_BT + distance * np.array([-np.cos(tilt) * np.cos(direction), -np.cos(tilt) * np.sin(direction), np.sin(tilt)])
        for tilt, distance in itertools.product(np.radians([42.0, 35.0, 50.0, 58.0, 28.0]), (0.42, 0.36, 0.48))
    ]


def sees_closely(X_BC: RigidTransform, p_BT: FloatArray) -> bool:
    """Whether a camera at X_BC looks at p_BT about as from one of the `close_viewpoints` that are not turned aside."""
    offset = p_BT - X_BC.translation()
    distance_m = float(np.linalg.norm(offset))
    off_axis_rad = np.arccos(np.clip(X_BC.rotation().matrix()[:, 2] @ offset / distance_m, -1.0, 1.0))
    below_rad = np.arcsin(-offset[2] / distance_m)
    near = _CLOSE_M[0] < distance_m < _CLOSE_M[1] and _CLOSE_BELOW_RAD[0] < below_rad < _CLOSE_BELOW_RAD[1]
    return bool(near and off_axis_rad < _CLOSE_OFF_AXIS_RAD)


_CLOSE_M, _CLOSE_BELOW_RAD, _CLOSE_OFF_AXIS_RAD = (0.33, 0.5), (0.45, 1.05), 0.12


def viewpoints_beside(p_BS: FloatArray, p_BC: FloatArray, p_BT: FloatArray, aside_m: float = 0.06) -> list[FloatArray]:
    """Camera places beside and above p_BC, as seen when looking from there at p_BT.

    First those on the side on which p_BC is already, seen from the shoulder at p_BS towards p_BT: away from what hides
    p_BT from there.
    """
    left, left_of_shoulder = _left_of(p_BC, p_BT), _left_of(p_BS, p_BT)
    outwards = left if (p_BC - p_BS) @ left_of_shoulder >= 0.0 else -left
    return [p_BC + aside_m * step for step in (outwards, outwards - UP_B, UP_B, -outwards, -outwards - UP_B)]


def _left_of(p_B: FloatArray, p_BT: FloatArray) -> FloatArray:
    """The level unit vector to the left when looking from one point to another."""
    ahead = (p_BT - p_B)[:2] / max(float(np.linalg.norm((p_BT - p_B)[:2])), 1e-6)
    return np.array([-ahead[1], ahead[0], 0.0])


def towards_shoulder(p_BS: FloatArray, p_B: FloatArray) -> FloatArray:
    """The level unit vector from a point towards the shoulder at p_BS; zero straight above or below it."""
    home_B = (p_BS - p_B) * [1.0, 1.0, 0.0]
    return np.asarray(home_B / max(float(np.linalg.norm(home_B)), 1e-6))


def carry_configuration(
    scene: ArmScene, arm: ArmCapabilities, R_BH: RotationMatrix, q_near_rad: FloatArray
) -> FloatArray:
    """Arm angles that hold the hand low near the body, the thing as upright as in R_BH, turned to the front.

    Where that tilt cannot be kept, the hand points forward and a little up, so that the object lies on a finger and
    leans to the palm; else level, or down. Raises PlanningError when no pose is free.
    """
    points_down = R_BH.matrix()[2, 0] < -0.8
    upright = [] if points_down else _turned(R_BH, (0.0, 0.4, -0.4))
    for rotations in (upright, *map(_forward, _CARRY_PITCHES_RAD)):
        q = _best_free(scene, rotations, arm.carry_x_m, arm.carry_z_m, arm.carry_best_x_m, q_near_rad)
        if q is not None:
            return q
    raise PlanningError("no pose to carry the thing near the body is free of contact")


def tucked_configuration(
    scene: ArmScene, arm: ArmCapabilities, R_BH: RotationMatrix, q_near_rad: FloatArray
) -> FloatArray:
    """Arm angles with the hand close to the body and turned to either side, the thing as upright as in R_BH.

    Raises PlanningError when no such pose is free.
    """
    beside = _turned(R_BH, (0.5 * np.pi, -0.5 * np.pi))
    q = _best_free(scene, beside, arm.tuck_x_m, arm.carry_z_m, arm.tuck_x_m[0], q_near_rad)
    if q is None:
        raise PlanningError("the thing cannot be drawn in to the body")
    return q


def _best_free(
    scene: ArmScene,
    rotations: Sequence[RotationMatrix],
    x_m: Sequence[float],
    z_m: Sequence[float],
    best_x_m: float,
    q_near_rad: FloatArray,
) -> FloatArray | None:
    """The cheapest arm angles, free of contact, with the hand turned so at one of the places before B; None: none.

    One drives along walls and up to furniture with them, so the arm is to stick out of the body as little as may be.
    """
    candidates = [
        (_carry_cost(x - best_x_m, z, q, q_near_rad) + sum(scene.beyond_body_m(q)), q)
        for rotation, x, z in itertools.product(rotations, x_m, z_m)
        for solution in scene.model.inverse(RigidTransform(rotation, [x, 0.0, z]), margin_rad=0.05)
        for q in [scene.model.turned_near(solution, q_near_rad)]
    ]
    cheapest = sorted(candidates, key=lambda candidate: candidate[0])
    return next((q for _, q in cheapest if scene.free(q) and scene.free_as_usual(q)), None)


def _carry_cost(off_x_m: float, z_m: float, q_rad: FloatArray, q_near_rad: FloatArray) -> float:
    return 3.0 * abs(off_x_m) + z_m + 0.04 * float(np.max(np.abs(q_rad - q_near_rad))) + 0.05 * abs(float(q_rad[0]))


def _turned(R_BH: RotationMatrix, turns_rad: Sequence[float]) -> list[RotationMatrix]:
    """R_BH turned about the vertical so that the hand points ahead, and further by each of the angles."""
    x_axis = R_BH.matrix()[:, 0]
    ahead = -float(np.arctan2(x_axis[1], x_axis[0]))
    return [RotationMatrix.MakeZRotation(ahead + turn) @ R_BH for turn in turns_rad]


def _forward(pitches_rad: tuple[float, ...]) -> list[RotationMatrix]:
    """Hands that point ahead, down by an angle."""
    return [
        RollPitchYaw(roll, pitch, 0.0).ToRotationMatrix()
        for roll, pitch in itertools.product((0.0, np.pi), pitches_rad)
    ]
