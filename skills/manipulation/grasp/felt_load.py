"""Grip after an object was felt at its lift: how firmly it is held, and where it is taken again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform

from skills.manipulation.arm.forces import HeldLoad
from skills.manipulation.grasp.candidates import GraspCandidate
from skills.robot import FloatArray, GripperCapabilities

MOST_SET_DOWN = 2
"""Number of times that an object is set down again to be taken nearer to its heavy end."""
_FRICTION = 0.6
"""Friction coefficient between pads and object that a grip counts on."""
_SAFETY = 1.5
_PER_KG_N = 12.0
"""Additional force per kilogram of the object."""
_MOST_OF_FORCE = 0.95
"""Largest force of a grip, as a part of the gripper's limit."""
_SURE_NM = 0.6
"""Moment that the noise of the efforts never feigns."""
_PER_M = 12.0
"""Cost of a grasp for each metre from the felt centre of mass."""


def twist_grip_n(load: HeldLoad, gripper: GripperCapabilities) -> float:
    """Returns the force (N) with which the pads' friction resists the moment of a load about the closing axis.

    The mean radius of the patch is that of a line across the pads, as a round handle touches them.
    """
    return _SAFETY * abs(load.moment_nm) / (_FRICTION * gripper.half_breadth_m)


def grip_n(least_n: float, load: HeldLoad, gripper: GripperCapabilities, least_kg: float = 0.0) -> float:
    """Returns the force (N) that a load needs, as far as the gripper has it; at least `least_n`, for `least_kg`."""
    firmly_n = max(least_n, twist_grip_n(load, gripper)) + _PER_KG_N * max(load.mass_kg, least_kg)
    return min(firmly_n, _MOST_OF_FORCE * gripper.max_force_n)


def hangs_out(load: HeldLoad, gripper: GripperCapabilities) -> bool:
    """Returns whether an object would turn out of the gripper at its largest force."""
    most_n = _MOST_OF_FORCE * gripper.max_force_n
    return abs(load.moment_nm) > _SURE_NM and twist_grip_n(load, gripper) > most_n


def centre_of_mass(load: HeldLoad, X_BH: RigidTransform, gripper: GripperCapabilities) -> FloatArray:
    """Returns the felt centre of mass (3,) of an object that is gripped by the hand at X_BH."""
    return np.asarray(X_BH @ np.array([gripper.grip_x_m, load.beside_m, gripper.fixed_z_m]))


def nearest_first(
    candidates: Sequence[GraspCandidate], felt_B: Sequence[FloatArray], gripper: GripperCapabilities
) -> list[GraspCandidate]:
    """Returns candidates with those near the last felt centre of mass (3,) first; in their order when none was felt."""

    def cost(candidate: GraspCandidate) -> float:
        off_B = centre_of_mass(HeldLoad(0.0), candidate.X_BH, gripper) - felt_B[-1]
        return candidate.cost + _PER_M * float(np.linalg.norm(off_B[:2]))

    return sorted(candidates, key=cost) if felt_B else list(candidates)
