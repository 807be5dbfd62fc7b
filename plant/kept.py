"""Small values as JSON has them. Every part of the plant that changes has `state` and `restore` made of these."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from skills.robot import FloatArray

State = dict[str, Any]


def transform_state(X: RigidTransform | None) -> list[list[float]] | None:
    """A transform as the rows of its 3 x 4 matrix."""
    return None if X is None else X.GetAsMatrix34().tolist()


def transform_of(rows: list[list[float]] | None) -> RigidTransform | None:
    """The transform of such rows."""
    return None if rows is None else RigidTransform(np.array(rows))


def array_of(items: Any) -> FloatArray:
    """Numbers as an array."""
    return np.array(items, dtype=np.float64)
