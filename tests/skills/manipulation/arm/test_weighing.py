"""Tests of weighing a held object by the arm's efforts."""

from dataclasses import replace

import numpy as np
import pytest
from table_robot import HEAD_CAPABILITIES, HEAD_MODEL, TableRobot, context_of, outcome

from plant.robots.spot.kind import spot_capabilities
from skills.api import ObjectKind, Succeeded
from skills.manipulation.arm.arm_skill import ArmSkill
from skills.manipulation.arm.collision import ArmScene
from skills.manipulation.arm.forces import held_mass_kg
from skills.manipulation.arm.kinematics import arm_model
from skills.manipulation.posture import Stow, StowInputs

CAPABILITIES = spot_capabilities()
MODEL = arm_model(CAPABILITIES)
AHEAD = np.array([0.0, -1.6, 1.6, 0.0, 0.4, 0.0])
GRIP = np.array([0.19, 0.0, 0.0])


def _efforts_of(mass_kg, q):
    """By virtual work, from another difference than the code's."""
    up = [(MODEL.X_BH(q + 2e-6 * e) @ GRIP - MODEL.X_BH(q) @ GRIP)[2] / 2e-6 for e in np.eye(len(q))]
    return mass_kg * 9.81 * np.array(up)


@pytest.mark.parametrize("q", [AHEAD, np.array([0.9, -2.2, 1.9, 0.4, 0.3, 0.2])])
@pytest.mark.parametrize("mass_kg", [0.0, 0.4, 2.4, 7.0])
def test_the_mass_follows_from_the_extra_efforts(mass_kg, q):
    assert held_mass_kg(MODEL, q, GRIP, _efforts_of(mass_kg, q)) == pytest.approx(mass_kg, abs=1e-3)


def test_a_moment_about_the_vertical_gives_no_mass():
    assert held_mass_kg(MODEL, AHEAD, GRIP, np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0])) == pytest.approx(0.0, abs=1e-6)


def test_an_arm_held_out_ahead_needs_efforts_against_its_own_weight():
    # the shoulder carries the whole arm: about 8 kg whose middle is a few decimetres ahead, up being negative pitch
    efforts = ArmScene(CAPABILITIES, MODEL, {}).gravity_efforts(AHEAD)
    assert efforts[0] == pytest.approx(0.0, abs=1e-6)
    assert -20.0 < efforts[1] < -5.0
    assert -20.0 < efforts[2] < -5.0


class Weighted(TableRobot):
    """Has something in its gripper, shut or not, of a mass that the arm's joints feel."""

    def __init__(self, mass_kg, **more):
        super().__init__(AHEAD, **more)
        self._efforts = ArmScene(CAPABILITIES, MODEL, {}).gravity_efforts(AHEAD) + _efforts_of(mass_kg, AHEAD)

    def joints(self):
        return replace(super().joints(), effort_nm=dict(zip(MODEL.names, self._efforts, strict=True)))


class Feels(ArmSkill):
    """Feels what the gripper holds."""

    name, default_timeout_s, causes = "feels", 10.0, {}

    def run(self, inputs):
        return Succeeded(str((yield from self.holds("feeling"))))


# mass (kg), whether something was grasped, opening (rad) -> what it feels, and what the robot is told
@pytest.mark.parametrize(
    ("mass_kg", "grasped", "opening_rad", "feels", "told"),
    [(0.06, True, 0.0, True, True), (0.0, True, 0.0, False, False), (0.06, False, 0.0, False, None)],
)
def test_shut_jaws_hold_what_the_arm_feels_after_a_grasp(mass_kg, grasped, opening_rad, feels, told):
    robot = Weighted(mass_kg, opening=opening_rad)
    robot.carries = None
    context = context_of(robot)
    context.payload.kind = ObjectKind("wrench") if grasped else None
    step = outcome(Feels(context), None)
    assert (step.message, robot.carries) == (str(feels), told)


def test_a_gripper_that_is_not_shut_holds_what_it_reports():
    context = context_of(robot := Weighted(0.06, opening=0.3, holding=False))
    context.payload.kind = ObjectKind("wrench")
    assert (outcome(Feels(context), None).message, "carry" in robot.calls) == ("False", False)


# mass (kg) of what shut jaws hold over a table -> what the arm feels before it is folded, where its levers are short
@pytest.mark.parametrize(("mass_kg", "said"), [(0.06, "the object is held near the body"), (0.0, "the arm is stowed")])
def test_shut_jaws_weigh_an_object_before_the_arm_is_folded(mass_kg, said):
    context = context_of(robot := Weighted(mass_kg, opening=0.0, height_m=0.62))
    context.payload.kind = ObjectKind("wrench")
    assert (outcome(Stow(context), StowInputs()).message, robot.carries) == (said, mass_kg > 0.0)


def test_flat_fingers_hold_what_they_report():
    context = context_of(robot := TableRobot(HEAD_MODEL.stowed_rad, capabilities=HEAD_CAPABILITIES))
    context.payload.kind = ObjectKind("wrench")
    assert (outcome(Feels(context), None).message, "carry" in robot.calls, robot.now()) == ("False", False, 0.0)
