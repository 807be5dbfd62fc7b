import numpy as np
import pytest
from table_robot import MODEL, TableRobot, context_of, failed

from plant.robots.spot.kind import spot_capabilities
from skills.api import Cause, ObjectKind, ObjectObservation
from skills.manipulation.grasp.candidates import grasp_candidates, least_mass_kg, why_no_candidates, why_too_heavy
from skills.manipulation.grasp.placements import Target
from skills.manipulation.grasp.skill import Grasp, GraspInputs

LARGE = (0.31, 0.21, 0.62)
GRIPPER = spot_capabilities().gripper


def _target(length, width, height, *, is_round=False):
    s, t = np.meshgrid(np.linspace(-0.5, 0.5, 60), np.linspace(-0.5, 0.5, 20))
    points = np.column_stack([s.ravel() * length + 0.85, t.ravel() * width, np.full(s.size, 0.2 + height)])
    return Target(points, (0.85, 0.0), 0.0, length, width, height, 0.2, is_round)


def seen(name, size_m):
    return ObjectObservation(0.0, ObjectKind(name), (0.9, 0.0, 0.26), size_m, 0.0, 1.0, "floor")


def test_a_class_whose_lightest_is_too_heavy_is_refused_before_the_arm_moves():
    robot = TableRobot()
    why = "the person weighs 9.0 kg at least, and the arm carries 5.0 kg at most"
    failed(Grasp(context_of(robot)), GraspInputs(seen("person", LARGE)), Cause.PRECONDITION, why)
    assert robot.arm_commands == []


def test_an_extinguisher_is_left_to_the_weighing_however_large_its_hose_makes_it():
    assert why_too_heavy(seen("extinguisher", LARGE).kind, 5.0) is None


@pytest.mark.parametrize("name", ["thing", "cube", "unheard of"])
def test_the_mass_of_an_unknown_class_is_unknown(name):
    assert least_mass_kg(ObjectKind(name)) == 0.0


@pytest.mark.parametrize(
    ("target", "why"),
    [
        (_target(0.25, 0.2, 0.05), "too wide for the gripper: 200 mm where it is narrowest"),
        (_target(0.2, 0.2, 0.12, is_round=True), "too wide for the gripper: 200 mm where it is narrowest"),
        (_target(0.25, 0.02, 0.002), "too flat for the gripper: 2 mm high, and the fingers need"),
    ],
)
def test_the_refusal_names_the_measure_that_prevents_a_grasp(target, why):
    assert grasp_candidates(target, MODEL.p_BS, GRIPPER) == []
    assert why in why_no_candidates(target, MODEL.p_BS, GRIPPER, "plank")
