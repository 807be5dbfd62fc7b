"""How what was grasped lies in the hand."""

from __future__ import annotations

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from skills.manipulation.arm.collision import Box, box_corners
from skills.robot import FloatArray

_TURNS_BELOW_RAD = 0.36


def turned_in_hand(X_BH: RigidTransform, p_HT: FloatArray) -> RigidTransform:
    """The hand's pose at which something upright, held at p_HT of the hand, would have been taken square to it.

    The fingers are a groove: what stands and is taken by a hand tilted a little turns in it on the way, until it is
    square to the fingers (measured in the plant: from 10 to 0 degrees within half a minute). Then the level hand, with
    which it stands upright again, is what counts. A hand tilted more is left as it is.
    """
    fingers = X_BH.rotation().matrix()[:, 0]
    if abs(fingers[2]) > np.sin(_TURNS_BELOW_RAD):
        return X_BH
    level = RotationMatrix(AngleAxis(-float(np.arcsin(-fingers[2])), _level_axis(fingers))) @ X_BH.rotation()
    return RigidTransform(level, X_BH @ p_HT - level @ p_HT)


def _level_axis(fingers_B: FloatArray) -> FloatArray:
    """The level axis about which fingers that point down by an angle are turned, by which they come to point down."""
    return np.asarray(np.array([-fingers_B[1], fingers_B[0], 0.0]) / np.hypot(fingers_B[0], fingers_B[1]))


def held_box(X_HB: RigidTransform, box: Box) -> Box:
    """A box in B as the upright box about it in H, for the object once it is held."""
    corners = box_corners(Box(X_HB @ box.X_FG, box.size_m))
    low, high = corners.min(axis=0), corners.max(axis=0)
    return Box(RigidTransform(0.5 * (low + high)), tuple(float(v) for v in np.maximum(high - low - 0.02, 0.01)))  # type: ignore[arg-type]
