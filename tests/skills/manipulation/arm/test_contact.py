"""Contact of a slow hand is felt by its lag: gently where an empty hand feels for a surface below."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from table_robot import MODEL, TableRobot, context_of

from skills.api import ObjectKind
from skills.manipulation.grasp.skill import Grasp

OUT = np.array([0.0, -1.6, 1.6, 0.0, 0.4, 0.0])
DOWN, AHEAD = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])


# direction of the motion, whether something is gripped, lag (mm) -> contact
@pytest.mark.parametrize(
    ("direction_B", "gripped", "lag_mm", "stops"),
    [
        (DOWN, False, 1.0, False),
        (DOWN, False, 2.5, True),
        (DOWN, True, 2.5, False),
        (DOWN, True, 4.0, True),
        (AHEAD, False, 2.5, False),
        (AHEAD, False, 4.0, True),
    ],
)
def test_an_empty_hand_stops_at_a_smaller_lag_on_its_way_down(direction_B, gripped, lag_mm, stops):
    skill = Grasp(context_of(TableRobot(OUT.copy())))
    skill.context.payload.kind = ObjectKind("beer") if gripped else None
    X_BH = MODEL.X_BH(OUT)
    wanted = RigidTransform(X_BH.rotation(), X_BH.translation() + 0.001 * lag_mm * direction_B)
    assert skill.contact_guard(direction_B)(MODEL.nearest_inverse(wanted, OUT)) is stops
