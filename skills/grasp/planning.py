"""From candidates to motions: the first grasp that the arm can reach, approach and lift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from skills.arm.collision import ArmScene, Box
from skills.arm.motion import plan_joint_path, plan_line, time_path
from skills.arm.routine import PlanningError
from skills.grasp.candidates import GraspCandidate
from skills.robot import ArmTrajectory, FloatArray

PREGRASP_M = 0.12
LIFT_M = 0.12
APPROACH_SPEED_RAD_S = 0.4
_FINAL_PADDING_M = 0.003


@dataclass(frozen=True)
class GraspPlan:
    """A grasp with the motions to its pre-grasp and from there to the grasp."""

    candidate: GraspCandidate
    to_pregrasp: ArmTrajectory
    to_grasp: ArmTrajectory


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
            q_pregrasp, approach = reach_candidate(scene, q_start_rad, candidate, around)
            scene.set_boxes([*around.boxes, around.target])
            scene.set_padding(0.01)
            path = plan_joint_path(scene, q_start_rad, q_pregrasp, rng)
        except PlanningError as error:
            reasons.append(str(error))
            continue
        return GraspPlan(candidate, time_path(path, scene=scene), time_path(approach, speed_rad_s=APPROACH_SPEED_RAD_S))
    last = f": {max(set(reasons), key=reasons.count)}" if reasons else ""
    raise PlanningError(f"none of {len(candidates)} grasps is within reach and free{last}")


def reach_candidate(
    scene: ArmScene, q_near_rad: FloatArray, candidate: GraspCandidate, around: Surroundings
) -> tuple[FloatArray, FloatArray]:
    """Pre-grasp angles and the straight approach path. Raises PlanningError."""
    scene.set_boxes(around.boxes)
    scene.set_padding(_FINAL_PADDING_M)
    solutions = scene.model.inverse(candidate.retreated(PREGRASP_M), margin_rad=0.06)
    reason = "out of reach"
    for q in sorted(solutions, key=lambda q: float(np.max(np.abs(q - q_near_rad)))):
        if not scene.free(q):
            reason = "the hand would touch something before the grasp"
            continue
        try:
            approach = plan_line(scene.model, q, candidate.X_BH, scene)
            lifted = RigidTransform(candidate.X_BH.rotation(), candidate.X_BH.translation() + LIFT_M * around.up_B)
            plan_line(scene.model, approach[-1], lifted)
        except PlanningError as error:
            reason = str(error)
            continue
        return q, approach
    raise PlanningError(reason)
