"""Tests of failures of the grasp skill."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.math import RigidTransform
from table_robot import MODEL, TableRobot, context_of, failed, outcome

from skills.api import Cause, Failed, ObjectKind, ObjectObservation, PlanningError, Running, Succeeded
from skills.manipulation.arm.motion import RrtConnect
from skills.manipulation.grasp.candidates import GraspCandidate
from skills.manipulation.grasp.placements import Target
from skills.manipulation.grasp.skill import Grasp, GraspInputs
from skills.routine import SkillFailure

SEEN = GraspInputs(
    ObjectObservation(0.0, ObjectKind("coke"), (0.9, 0.0, 0.76), (0.066, 0.066, 0.115), 0.0, 1.0, "table")
)
BEER = ObjectObservation(0.0, ObjectKind("beer"), (0.8, 0.0, 0.8), (0.066, 0.066, 0.2), 0.0, 1.0, "table")


def test_a_missing_object_is_a_failed_precondition_and_the_arm_is_stowed():
    robot = TableRobot()
    failed(Grasp(context_of(robot)), SEEN, Cause.PRECONDITION, "no longer where it was seen")
    assert np.allclose(robot.q_rad, MODEL.stowed_rad, atol=1e-6)
    assert robot.opening == 0.0


def test_a_refused_arm_is_a_failed_execution_with_the_robots_reason():
    robot = TableRobot(refuse_because={"move_arm": "the arm is out of order"})
    failed(Grasp(context_of(robot)), SEEN, Cause.EXECUTION, "the arm is out of order")


def test_a_full_gripper_is_a_failed_precondition():
    robot = TableRobot(holding=True, opening=0.3)
    failed(Grasp(context_of(robot)), SEEN, Cause.PRECONDITION, "holds something already")
    assert robot.arm_commands == []


def test_a_second_attempt_starts_again():
    robot = TableRobot(holding=True, opening=0.3)
    skill = Grasp(context_of(robot))
    failed(skill, SEEN, Cause.PRECONDITION, "holds something already")
    robot.in_gripper_rad, robot.opening = None, 0.0
    failed(skill, SEEN, Cause.PRECONDITION, "no longer where it was seen")


def test_after_a_failure_the_body_stands_at_its_usual_height():
    robot = TableRobot()
    high = GraspInputs(ObjectObservation(0.0, ObjectKind("coke"), (0.9, 0.0, 0.96), (0.066, 0.066, 0.115), 0.0, 1.0))
    failed(Grasp(context_of(robot)), high, Cause.PRECONDITION, "no longer where it was seen")
    assert robot.commanded("stand")[0][0] > 0.55
    assert robot.height_m == 0.52


class Heavy(Grasp):
    """Has lifted something of a mass."""

    def __init__(self, context, mass_kg):
        super().__init__(context)
        self._mass_kg = mass_kg

    def run(self, inputs):
        yield from self._refuse_heavy(self._mass_kg, np.array([0.0, 0.0, 0.1]), str(inputs.observation.kind))
        return Succeeded("lifted")


def test_an_object_that_is_too_heavy_is_set_down_and_refused_with_its_mass():
    robot = TableRobot(np.array([0.0, -1.6, 1.6, 0.0, 0.4, 0.0]), holding=True, opening=0.3)
    before = MODEL.X_BH(robot.q_rad).translation()
    why = "the coke weighs 5.6 kg, and the arm carries 5.0 kg at most"
    failed(Heavy(context_of(robot), 5.6), SEEN, Cause.PRECONDITION, why)
    assert (MODEL.X_BH(robot.q_rad).translation() - before)[2] < -0.09


def test_an_object_that_the_arm_can_carry_is_not_set_down():
    robot = TableRobot(holding=True, opening=0.3)
    skill = Heavy(context_of(robot), 4.9)
    skill.begin(SEEN)
    assert isinstance(skill.step(), Succeeded)
    assert robot.arm_commands == []


class Touching(Grasp):
    """Has touched something at some distance before its grasp."""

    def __init__(self, context, short_m):
        super().__init__(context)
        self._short_m = short_m

    def run(self, inputs):
        hand = MODEL.X_BH(self.q_rad())
        planned = RigidTransform(hand.rotation(), hand.translation() + self._short_m * hand.rotation().matrix()[:, 0])
        self._check_reached(planned, str(inputs.observation.kind))
        yield Running("closing")
        return Succeeded("closed")


def test_fingers_do_not_close_where_something_stopped_them_well_before_the_object():
    why = "the hand touched something 6 cm before it was about the coke"
    failed(Touching(context_of(TableRobot()), 0.06), SEEN, Cause.EXECUTION, why)


def test_fingers_close_where_they_touch_the_surface_a_little_early():
    assert isinstance(outcome(Touching(context_of(TableRobot()), 0.01), SEEN), Succeeded)


def resumed(skill, inputs):
    """Go on to the end of a skill that a restart broke off."""
    skill.resume(inputs)
    while isinstance(step := skill.step(), Running):
        skill.context.clock.advance(0.05)
    skill.end()
    return step


def test_an_object_held_after_a_restart_is_not_taken_again():
    robot = TableRobot(holding=True, opening=0.3)
    step = resumed(Grasp(context_of(robot)), SEEN)
    assert isinstance(step, Succeeded), step
    assert step.message == "the coke was in the gripper already; holding it"
    assert (robot.opening, robot.holding, robot.carries) == (0.3, True, True)


def test_after_a_restart_with_an_empty_gripper_the_robot_looks_before_it_takes():
    step = resumed(Grasp(context_of(TableRobot())), SEEN)
    assert isinstance(step, Failed)
    assert "no longer where it was seen" in step.message


@pytest.mark.parametrize(("holding", "why"), [(False, "the coke is not in the gripper"), (True, None)])
def test_a_lost_object_undoes_the_grasp(holding, why):
    assert Grasp(context_of(TableRobot(holding=holding))).undone(SEEN) == why


class Behind(Grasp):
    """Finds no grasp because of another object."""

    def _take_where_it_is(self, inputs):
        def plan():
            raise PlanningError("the coke is behind the beer", {"in_the_way": (BEER,)})

        return (yield from self.compute(plan, latency_s=0.1, name="plan grasp", message="planning"))


def test_a_failure_to_plan_returns_the_objects_in_the_way():
    step = outcome(Behind(context_of(TableRobot())), SEEN)
    assert (step.cause, step.message) == (Cause.PLANNING, "the coke is behind the beer")
    assert step.outputs == {"tried": (), "in_the_way": (BEER,)}


def test_another_failure_returns_that_no_object_is_in_the_way():
    assert outcome(Grasp(context_of(TableRobot())), SEEN).outputs == {"tried": (), "in_the_way": ()}


class AtItsReach(RrtConnect):
    """Finds no straight line of the hand."""

    def line(self, model, q_start_rad, X_BH_to, scene=None):
        raise PlanningError("the hand cannot follow the straight line within the arm's reach")


class Feeling(Grasp):
    """Feels for the surface below its fingers."""

    def run(self, inputs):
        yield from self._to_the_ground(np.array([0.0, 0.0, -1.0]), False, 0.002, "feeling")
        return Succeeded("felt")


def test_a_surface_below_the_arms_reach_is_not_felt_for():
    context = context_of(robot := TableRobot())
    context = replace(context, stack=replace(context.stack, arm_planner=AtItsReach()))
    assert isinstance(outcome(Feeling(context), SEEN), Succeeded)
    assert robot.arm_commands == []


class Closing(Grasp):
    """Closes about a tall object."""

    def run(self, inputs):
        yield from self._close(0.05, 0.5, "closing")
        return Succeeded("closed")


def test_hinged_fingers_close_gently_until_they_touch():
    robot = TableRobot(opening=0.6)
    assert isinstance(outcome(Closing(context_of(robot)), SEEN), Succeeded)
    assert [force_n for _, force_n in robot.commanded("set_gripper")] == [8.0, 106.0]


class Lowering(Grasp):
    """Brings its fingers about a part of a screwdriver whose handle is 37 mm thick; notes how far they rise again."""

    def __init__(self, context, width_m):
        super().__init__(context)
        hand = RigidTransform(MODEL.X_BH(self.q_rad()).rotation(), [0.8, 0.0, 0.1])
        self._plan = SimpleNamespace(candidate=GraspCandidate(hand, width_m, 0.0, 1.57))
        self.relax_m = []

    def run(self, inputs):
        target = Target(np.zeros((1, 3)), (0.8, 0.0), 0.0, 0.2, 0.037, 0.037, 0.2, False)
        yield from self._lower_on(SimpleNamespace(target=target), self._plan, False, "screwdriver")
        return Succeeded("lowered")

    def _to_the_ground(self, ahead_B, touched, relax_m, message):
        self.relax_m.append(relax_m)
        yield Running(message)


def test_fingers_take_a_raised_slim_shaft_with_their_tips():
    relax_m = []
    for width_m in (0.01, 0.035):
        skill = Lowering(context_of(TableRobot(opening=1.4)), width_m)
        assert isinstance(outcome(skill, SEEN), Succeeded)
        relax_m += skill.relax_m
    assert relax_m[0] == pytest.approx(0.0145)
    assert relax_m[1] < relax_m[0]


class SeemsLost(Grasp):
    """Weighs nothing until its hand has been raised, as when the object lies on the arm."""

    def run(self, inputs):
        self.hand_m = [float(MODEL.X_BH(self.q_rad()).translation()[2])]
        lost = SkillFailure(Cause.POSTCONDITION, "the object was lost")
        return Succeeded(str((yield from self._still_held(lost, inputs.observation))))

    def holds(self, message):
        self.hand_m.append(float(MODEL.X_BH(self.q_rad()).translation()[2]))
        yield Running(message)
        return self.context.payload.kind is not None and self.hand_m[1] > self.hand_m[0] + 0.05


def test_a_hand_that_felt_nothing_is_raised_and_feels_again():
    robot = TableRobot(np.array([0.0, -1.6, 1.6, 0.0, 0.4, 0.0]))
    assert outcome(SeemsLost(context_of(robot)), SEEN).message == "True"
