"""Grasps tried in earlier attempts, so that the next attempt tries another."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from skills.manipulation.grasp.candidates import GraspCandidate
from skills.quantities import Coordinate, Cosine
from skills.robot import FloatArray

_SAME_TURN_RAD = 0.35
"""Grasps whose directions differ by less are the same."""
_SAME_PLACE_M = 0.03
"""Grasps whose hands are nearer than this are the same."""


@dataclass(frozen=True)
class TriedGrasp:
    """Grasp in world coordinates: directions of the fingers and of their closing, and the object-to-hand vector (m)."""

    pointing_W: tuple[Cosine, Cosine, Cosine]
    closing_W: tuple[Cosine, Cosine, Cosine]
    hand_from_object_W: tuple[Coordinate, Coordinate, Coordinate]


def tried_grasp(candidate: GraspCandidate, centre_B: tuple[float, float], X_WB: RigidTransform) -> TriedGrasp:
    """Converts a candidate to a tried grasp; `centre_B` is the object's centre (x, y), X_WB the body's pose then."""
    R_WH = X_WB.rotation().matrix() @ candidate.X_BH.rotation().matrix()
    p_B = candidate.X_BH.translation() - np.array([*centre_B, 0.0])
    return TriedGrasp(_vector(R_WH[:, 0]), _vector(R_WH[:, 2]), _vector(X_WB.rotation().matrix() @ p_B))


def others_first(
    candidates: Sequence[GraspCandidate],
    tried: Sequence[TriedGrasp],
    centre_B: tuple[float, float],
    X_WB: RigidTransform,
) -> list[GraspCandidate]:
    """Returns the candidates in their order, but those similar to a tried grasp last."""

    def was_tried(candidate: GraspCandidate) -> bool:
        now = tried_grasp(candidate, centre_B, X_WB)
        return any(same_grasp(now, before) for before in tried)

    return sorted(candidates, key=was_tried)


def same_grasp(one: TriedGrasp, other: TriedGrasp) -> bool:
    """Returns whether two grasps are equal within tolerances; the gripper may be flipped."""
    least = math.cos(_SAME_TURN_RAD)
    pointing = float(np.dot(one.pointing_W, other.pointing_W))
    closing = abs(float(np.dot(one.closing_W, other.closing_W)))
    apart_xy_m = float(np.linalg.norm(np.subtract(one.hand_from_object_W, other.hand_from_object_W)[:2]))
    return pointing > least and closing > least and apart_xy_m < _SAME_PLACE_M


def _vector(values: FloatArray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return (x, y, z)
