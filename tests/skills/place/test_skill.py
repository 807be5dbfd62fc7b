"""What the place skill does when it cannot put the thing down."""

import numpy as np
from scripted_robot import ScriptedRobot, context_of, failed

from skills.api import Cause, Surface
from skills.place.skill import Place, PlaceInputs

TABLE = Surface("kitchen table", ((0.75, -0.5), (1.3, -0.5), (1.3, 0.5), (0.75, 0.5)), 0.7)
CARRYING = np.array([0.0, -3.0, 2.85, 0.0, 0.1, 1.57])


def test_an_empty_jaw_is_a_failed_precondition():
    failed(Place(context_of(ScriptedRobot())), PlaceInputs(TABLE), Cause.PRECONDITION, "nothing in the jaw")


def test_a_surface_that_is_not_seen_is_a_failed_planning_and_the_thing_is_kept():
    robot = ScriptedRobot(q=CARRYING.copy(), holding=True, opening_rad=0.3)
    failed(Place(context_of(robot)), PlaceInputs(TABLE), Cause.PLANNING, "the kitchen table is not seen from here")
    assert robot.holding
    assert robot.opening_rad == 0.3
