"""Tests of choosing another grasp after a failed one."""

import dataclasses

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from table_robot import GRIPPER, MODEL, TableRobot, context_of, outcome

from skills.api import Cause, Failed, ObjectKind, ObjectObservation
from skills.manipulation.grasp.candidates import grasp_candidates, others_first, same_grasp, tried_grasp
from skills.manipulation.grasp.placements import Target
from skills.manipulation.grasp.skill import Grasp, GraspInputs
from skills.routine import SkillFailure

CENTRE = (0.85, 0.0)


def candidates():
    s, t = np.meshgrid(np.linspace(-0.5, 0.5, 60), np.linspace(-0.5, 0.5, 20))
    points = np.column_stack([s.ravel() * 0.2 + CENTRE[0], t.ravel() * 0.03, np.full(s.size, 0.23)])
    return grasp_candidates(Target(points, CENTRE, 0.0, 0.2, 0.03, 0.03, 0.2, False), MODEL.p_BS, GRIPPER)


def _unlike(first, found, X_WB):
    """The first grasps that are unlike a first one and each other, as tried grasps."""
    unlike = [tried_grasp(first, CENTRE, X_WB)]
    for each in (tried_grasp(candidate, CENTRE, X_WB) for candidate in found):
        if len(unlike) < 3 and not any(same_grasp(each, one) for one in unlike):
            unlike.append(each)
    return unlike[1:]


def test_the_best_grasp_falls_behind_all_that_are_unlike_it():
    found, X_WB = candidates(), RigidTransform()
    tried = (tried_grasp(found[0], CENTRE, X_WB),)
    ordered = others_first(found, tried, CENTRE, X_WB)
    assert sorted(map(id, ordered)) == sorted(map(id, found))
    assert not same_grasp(tried_grasp(ordered[0], CENTRE, X_WB), tried[0])
    assert ordered.index(found[0]) > len(found) // 2 or len(found) < 4


def test_without_tried_grasps_the_order_stays():
    found = candidates()
    assert others_first(found, (), CENTRE, RigidTransform()) == found


def test_grasps_tried_twice_fall_behind_those_tried_once():
    found, X_WB = candidates(), RigidTransform()
    once, other, twice = (tried_grasp(found[0], CENTRE, X_WB), *_unlike(found[0], found, X_WB))
    ordered = others_first(found, (once, twice, other, twice), CENTRE, X_WB)
    same = [[same_grasp(tried_grasp(each, CENTRE, X_WB), one) for one in (once, twice)] for each in ordered]
    assert same.index([True, False]) < same.index([False, True])


def test_three_equal_grasps_never_follow_each_other():
    found, X_WB = candidates(), RigidTransform()
    tried = (tried_grasp(found[0], CENTRE, X_WB),) * 2
    left = others_first(found, tried, CENTRE, X_WB)
    assert left and not any(same_grasp(tried_grasp(each, CENTRE, X_WB), tried[0]) for each in left)
    assert others_first(found[:1], tried, CENTRE, X_WB) == []


def test_a_grasp_is_known_again_from_where_the_body_stands_later():
    first = candidates()[0]
    X_WB = RigidTransform()
    X_WC = RigidTransform(RollPitchYaw(0.0, 0.0, 0.7), [0.3, -0.2, 0.0])
    X_CB = X_WC.inverse() @ X_WB
    centre = X_CB @ np.array([*CENTRE, 0.0])
    moved = dataclasses.replace(first, X_BH=X_CB @ first.X_BH)
    assert same_grasp(tried_grasp(first, CENTRE, X_WB), tried_grasp(moved, (float(centre[0]), float(centre[1])), X_WC))


def test_a_gripper_turned_over_makes_the_same_grasp():
    found = candidates()[0]
    over = dataclasses.replace(found, X_BH=found.X_BH @ RigidTransform(RollPitchYaw(np.pi, 0.0, 0.0), np.zeros(3)))
    assert same_grasp(tried_grasp(found, CENTRE, RigidTransform()), tried_grasp(over, CENTRE, RigidTransform()))


class Slippery(Grasp):
    """Sees and plans as scripted; what it takes slips."""

    def look_closely(self, seen, same_object_m):
        yield from self.pause(0.1, "looking")
        s, t = np.meshgrid(np.linspace(-0.5, 0.5, 30), np.linspace(-0.5, 0.5, 10))
        points = np.column_stack([s.ravel() * 0.2 + CENTRE[0], t.ravel() * 0.03, np.full(s.size, 0.23)])
        target = Target(points, CENTRE, 0.0, 0.2, 0.03, 0.03, 0.2, False)
        return type("View", (), {"target": target, "X_WB": RigidTransform(), "boxes": ()})()

    def _plan(self, view, thing, avoid):
        yield from self.pause(0.1, "planning")
        chosen = others_first(grasp_candidates(view.target, MODEL.p_BS, GRIPPER), avoid, CENTRE, view.X_WB)[0]
        return type("Plan", (), {"candidate": chosen})()

    def _reach(self, view, plan, thing):
        yield from self.pause(0.1, "reaching")
        return view, plan

    def _take(self, view, plan, seen):
        yield from self.pause(0.1, "taking")
        raise SkillFailure(Cause.POSTCONDITION, "it slipped")


def test_a_failed_grasp_returns_its_try_and_the_next_attempt_takes_another():
    seen = ObjectObservation(0.0, ObjectKind("hammer"), (0.85, 0.0, 0.215), (0.2, 0.03, 0.03), 0.0, 1.0, "table")
    avoid = ()
    for count in (1, 2):
        step = outcome(Slippery(context_of(TableRobot())), GraspInputs(seen, avoid))
        assert isinstance(step, Failed)
        assert (step.cause, len(step.outputs["tried"])) == (Cause.POSTCONDITION, count)
        avoid = step.outputs["tried"]
    assert not same_grasp(*avoid)
