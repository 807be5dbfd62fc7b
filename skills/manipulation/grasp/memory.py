"""Grasps that were tried already, so that the next attempt takes another."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform

from skills.manipulation.grasp.candidates import GraspCandidate
from skills.manipulation.grasp.ports import TriedGrasp
from skills.robot import FloatArray

SAME_TURN_RAD = 0.35
SAME_PLACE_M = 0.03

Vector = tuple[float, float, float]


def tried_grasp(candidate: GraspCandidate, centre_B: tuple[float, float], X_WB: RigidTransform) -> TriedGrasp:
    """A candidate as it is remembered; `centre_B` is the object's centre (x, y), X_WB the body's pose then."""
    R_WH = X_WB.rotation().matrix() @ candidate.X_BH.rotation().matrix()
    p_B = candidate.X_BH.translation() - np.array([*centre_B, 0.0])
    return TriedGrasp(_vector(R_WH[:, 0]), _vector(R_WH[:, 2]), _vector(X_WB.rotation().matrix() @ p_B))


def others_first(
    candidates: Sequence[GraspCandidate],
    tried: Sequence[TriedGrasp],
    centre_B: tuple[float, float],
    X_WB: RigidTransform,
) -> list[GraspCandidate]:
    """The candidates in their order, those that are like one that was tried behind all others."""

    def known(candidate: GraspCandidate) -> bool:
        now = tried_grasp(candidate, centre_B, X_WB)
        return any(same_grasp(now, before) for before in tried)

    return sorted(candidates, key=known)


def same_grasp(one: TriedGrasp, other: TriedGrasp) -> bool:
    """Returns whether two grasps are the same but for small differences; the gripper may be turned over."""
    least = math.cos(SAME_TURN_RAD)
    pointing = float(np.dot(one.pointing_W, other.pointing_W))
    closing = abs(float(np.dot(one.closing_W, other.closing_W)))
    apart_xy_m = float(np.linalg.norm(np.subtract(one.hand_from_object_W, other.hand_from_object_W)[:2]))
    return pointing > least and closing > least and apart_xy_m < SAME_PLACE_M


def _vector(values: FloatArray) -> Vector:
    x, y, z = (float(value) for value in values)
    return (x, y, z)
