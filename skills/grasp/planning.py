"""From candidates to motions: the first grasp that the arm can reach, approach and lift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from skills.arm.collision import ArmScene, Box
from skills.arm.kinematics import ArmModel
from skills.arm.motion import plan_joint_path, plan_line, time_path
from skills.arm.routine import PlanningError
from skills.grasp.candidates import GraspCandidate
from skills.robot import ArmTrajectory, FloatArray

PREGRASPS_M = (0.12, 0.07)
LIFTS_M = ((0.12, 0.0), (0.1, 0.08), (0.07, 0.0), (0.06, 0.08), (0.05, 0.12), (0.045, 0.0))
"""Ways to lift, up and back towards the shoulder, the best first."""
APPROACH_SPEED_RAD_S = 0.4
_FINAL_PADDING_M = 0.003


@dataclass(frozen=True)
class GraspPlan:
    """A grasp with the motions to its pre-grasp and from there to the grasp, and how to lift (frame B)."""

    candidate: GraspCandidate
    to_pregrasp: ArmTrajectory
    to_grasp: ArmTrajectory
    lift_B: FloatArray


@dataclass(frozen=True)
class Surroundings:
    """What stands around the thing, and the thing itself, as boxes in B; `up_B` points up in the body frame."""

    boxes: Sequence[Box]
    target: Box
    up_B: FloatArray


def plan_grasp(
    scene: ArmScene,
    q_start_rad: FloatArray,
    candidates: Sequence[GraspCandidate],
    around: Surroundings,
    rng: np.random.Generator,
) -> GraspPlan:
    """The best candidate that can be carried out. Raises PlanningError when there is none."""
    reasons = []
    for candidate in candidates:
        try:
            approach, lift_B = reach_candidate(scene, q_start_rad, candidate, around)
            scene.set_boxes([*around.boxes, around.target])
            scene.set_padding(0.01)
            path = plan_joint_path(scene, q_start_rad, approach[0], rng)
        except PlanningError as error:
            reasons.append(str(error))
            continue
        to_pregrasp, to_grasp = time_path(path, scene=scene), time_path(approach, speed_rad_s=APPROACH_SPEED_RAD_S)
        return GraspPlan(candidate, to_pregrasp, to_grasp, lift_B)
    last = f": {max(set(reasons), key=reasons.count)}" if reasons else ""
    raise PlanningError(f"none of {len(candidates)} grasps is within reach and free{last}")


def reach_candidate(
    scene: ArmScene, q_near_rad: FloatArray, candidate: GraspCandidate, around: Surroundings
) -> tuple[FloatArray, FloatArray]:
    """The straight approach path from the pre-grasp, and the lift (frame B). Raises PlanningError."""
    scene.set_boxes(around.boxes)
    scene.set_padding(_FINAL_PADDING_M)
    reason = "out of reach"
    for distance in PREGRASPS_M:
        solutions = scene.model.inverse(candidate.retreated(distance), margin_rad=0.06)
        for q in sorted(solutions, key=lambda q: float(np.max(np.abs(q - q_near_rad)))):
            if not scene.free(q):
                reason = "the hand would touch something before the grasp"
                continue
            try:
                approach = plan_line(scene.model, q, candidate.X_BH, scene)
                return approach, _lift(scene, approach[-1], around.up_B)
            except PlanningError as error:
                reason = str(error)
    raise PlanningError(reason)


def within_reach(model: ArmModel, candidate: GraspCandidate, up_B: FloatArray, margin_rad: float = 0.08) -> bool:
    """Whether the arm reaches a grasp, its pre-grasp and the end of its lift; contact is not looked at."""
    X_BH, distance = candidate.X_BH, PREGRASPS_M[-1]
    if not (model.inverse(X_BH, margin_rad) and model.inverse(candidate.retreated(distance), margin_rad)):
        return False
    lifted = (X_BH.translation() + offset for offset in lifts(model, X_BH, up_B))
    return any(model.inverse(RigidTransform(X_BH.rotation(), p), margin_rad) for p in lifted)


def lifts(model: ArmModel, X_BH: RigidTransform, up_B: FloatArray) -> list[FloatArray]:
    """Ways to lift from a grasp, the best first."""
    back = (model.p_BS - X_BH.translation()) * [1.0, 1.0, 0.0]
    back = back / max(float(np.linalg.norm(back)), 1e-6)
    return [up_m * up_B + back_m * back for up_m, back_m in LIFTS_M]


def _lift(scene: ArmScene, q_rad: FloatArray, up_B: FloatArray) -> FloatArray:
    """The first way to lift that the arm can follow. Raises PlanningError."""
    X_BH = scene.model.X_BH(q_rad)
    for lift_B in lifts(scene.model, X_BH, up_B):
        try:
            plan_line(scene.model, q_rad, RigidTransform(X_BH.rotation(), X_BH.translation() + lift_B))
        except PlanningError:
            continue
        return lift_B
    raise PlanningError("the arm cannot lift the thing from there")
