"""A camera that stays in its place shows an object from one viewpoint, and on the body a part of a near surface."""

from dataclasses import replace

import pytest
from pydrake.math import RigidTransform, RotationMatrix
from table_robot import HEAD_CAPABILITIES, TableRobot, context_of, failed, outcome
from table_scene import COKE, TABLE

from skills.api import Cause, Succeeded, Surface
from skills.detect.skill import Detect, DetectInputs
from skills.robot import CameraCapabilities, Mount

AHEAD = RotationMatrix.MakeYRotation(0.35) @ RotationMatrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
CAMERA = CameraCapabilities("front", RigidTransform(AHEAD, [0.1, 0.0, 1.15]), Mount.BODY)
FIXED = replace(HEAD_CAPABILITIES, head=None, cameras=(CAMERA,))
LONG = Surface("counter", ((0.8, -3.0), (1.4, -3.0), (1.4, 3.0), (0.8, 3.0)), TABLE.height_m)


STIFF = replace(HEAD_CAPABILITIES, height_range_m=(HEAD_CAPABILITIES.standing_height_m,) * 2)


@pytest.mark.parametrize(
    "capabilities", [FIXED, STIFF], ids=["on the body", "on the head of a body that does not rise"]
)
def test_object_in_view_needs_no_second_viewpoint(capabilities):
    assert isinstance(
        outcome(
            Detect(context_of(TableRobot(capabilities=capabilities, things=(COKE,)))), DetectInputs(("coke",), (TABLE,))
        ),
        Succeeded,
    )


@pytest.mark.parametrize(
    ("surface", "cause", "why"),
    [
        (TABLE, Cause.POSTCONDITION, "no coke seen on the table"),
        (LONG, Cause.EXECUTION, "the counter could not be looked at from here: most of it is out of the camera's view"),
    ],
)
def test_object_is_missing_only_where_most_of_the_surface_was_in_view(surface, cause, why):
    robot = TableRobot(capabilities=FIXED, things=())
    failed(Detect(context_of(robot)), DetectInputs(("coke",), (surface,)), cause, why)
