"""Tests of the reasons why no grasp of an object is feasible."""

import numpy as np
import pytest
from pydrake.math import RigidTransform

from plant.robots.spot.kind import spot_capabilities
from skills.api import ObjectKind, ObjectObservation, PlanningError
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.kinematics import arm_model
from skills.manipulation.arm.motion import RrtConnect
from skills.manipulation.grasp.placements import Target
from skills.manipulation.grasp.planning import GeometricGraspPlanner, Obstacle, Surroundings

CAPABILITIES = spot_capabilities()
MODEL = arm_model(CAPABILITIES)
UP = np.array([0.0, 0.0, 1.0])
PLANNER = GeometricGraspPlanner()


def _obstacle(name, x, y, *, width=0.1, height=0.5):
    seen = ObjectObservation(0.0, ObjectKind(name), (x, y, 0.2), (0.06, width, height), 0.0, 1.0, "table")
    return Obstacle(seen, (Box(RigidTransform([x, y, 0.2]), (0.06, width, height)),))


def _refused(others=(), x=0.85, boxes=()):
    points = np.column_stack([np.full(40, x), np.zeros(40), np.full(40, 0.3)])
    target = Target(points, (x, 0.0), 0.0, 0.066, 0.066, 0.115, 0.2, True)
    box = Box(RigidTransform([x, 0.0, 0.26]), (0.07, 0.07, 0.12))
    all_boxes = (*boxes, *(box for other in others for box in other.boxes))
    around = Surroundings(all_boxes, box, UP, others, "beer", 0.98)
    candidates = PLANNER.candidates(target, MODEL.p_BS, CAPABILITIES.gripper)[:12]
    scene = ArmScene(CAPABILITIES, MODEL, {})
    with pytest.raises(PlanningError) as error:
        PLANNER.plan(scene, MODEL.stowed_rad, candidates, around, RrtConnect(), np.random.default_rng(0))
    return error.value


def _why(*args, **kwargs):
    return str(_refused(*args, **kwargs))


def test_out_of_reach_says_how_far():
    assert _why(x=1.9) == "the beer is out of reach: 1.61 m from the shoulder, and the arm reaches 0.98 m"


def test_of_two_others_the_one_that_stands_before_it_is_named():
    assert (
        _why((_obstacle("coke", 0.74, 0.0, width=0.5), _obstacle("cube", 0.85, 0.6))) == "the beer is behind the coke"
    )


def test_a_close_object_behind_is_too_near():
    wall = _obstacle("box", 0.87, 0.0, width=0.5)
    assert _why((wall,)) == "the beer is too near the box"


def test_an_obstacle_that_is_no_object_is_not_named():
    wall = _obstacle("wall", 0.74, 0.0, width=0.5)
    assert "would touch something" in _why((_obstacle("cube", 0.85, 0.6),), boxes=wall.boxes)


def test_the_refusal_returns_the_objects_in_the_way_as_they_were_seen():
    coke, cube = _obstacle("coke", 0.74, 0.0, width=0.5), _obstacle("cube", 0.85, 0.6)
    assert _refused((cube, coke)).outputs == {"in_the_way": (coke.seen,)}


def test_of_two_objects_in_the_way_the_nearest_comes_first():
    near, far = _obstacle("coke", 0.74, 0.0, width=0.5), _obstacle("cube", 0.66, 0.0, width=0.5)
    assert _refused((far, near)).outputs == {"in_the_way": (near.seen, far.seen)}


def test_without_an_object_in_the_way_none_is_returned():
    assert _refused(x=1.9).outputs == {}


def test_the_cause_of_no_grasp_is_sought_among_a_bounded_number_of_candidates():
    asked = []

    class Counted(GeometricGraspPlanner):
        def _reached(self, *args):
            asked.append(args)
            raise PlanningError("the hand would touch something before the grasp")

    target = Target(np.full((40, 3), 0.3), (0.85, 0.0), 0.0, 0.066, 0.066, 0.115, 0.2, True)
    candidates = PLANNER.candidates(target, MODEL.p_BS, CAPABILITIES.gripper)[:1] * 100
    box = Box(RigidTransform([0.85, 0.0, 0.26]), (0.07, 0.07, 0.12))
    around = Surroundings((), box, UP, (_obstacle("coke", 0.74, 0.0),))
    scene = ArmScene(CAPABILITIES, MODEL, {})
    with pytest.raises(PlanningError):
        Counted().plan(scene, MODEL.stowed_rad, candidates, around, RrtConnect(), np.random.default_rng(0))
    assert 100 < len(asked) < 200


# what else is there (m, frame B) about a can on a table, and whether it rises by 0.12 m
@pytest.mark.parametrize(
    ("place", "size_m", "rises"),
    [
        ((0.85, 0.0, 0.1), (1.0, 1.0, 0.2), True),  # the table
        ((0.85, 0.0, 0.4), (0.3, 0.3, 0.02), False),  # the next board of a shelf
        ((0.95, 0.0, 0.3), (0.06, 0.06, 0.3), True),  # what stands beside it
        ((0.87, 0.0, 0.27), (0.05, 0.2, 0.03), True),  # a part of it that was seen as an object of its own
    ],
)
def test_an_object_can_be_lifted_where_nothing_is_above_it(place, size_m, rises):
    can = Box(RigidTransform([0.85, 0.0, 0.26]), (0.07, 0.07, 0.12))
    around = Surroundings([Box(RigidTransform(place), size_m)], can, UP)
    assert around.lets_rise(np.array([0.0, 0.0, 0.12])) == rises
