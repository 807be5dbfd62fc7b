"""Spot stands on its own legs, without the floating base."""

import numpy as np
import pytest

from plant.diagram import DiagramConfig, build_diagram
from plant.engine import Engine
from plant.robots.robot_kind import PlacedRobot
from plant.robots.spot.description import spot_facts
from plant.robots.spot.model import OwnLegs
from skills.robot import Pose2D
from tests.plant.boxes import fixed_box


@pytest.fixture
def free_spot(tmp_path):
    ground, alice = fixed_box(tmp_path, "ground", "4 4 0.2", "0 0 -0.1"), Pose2D(0, 0, 0)
    robots = [PlacedRobot("Alice", "spot", alice, locomotion=OwnLegs())]
    return Engine(build_diagram(DiagramConfig(models=[ground], robots=robots, visuals=False, render=False)))


def test_free_spot_stands_on_its_own_feet(free_spot):
    robot = free_spot.world.robots["Alice"]
    free_spot.advance(1.0)
    before = free_spot.world.plant.EvalBodyPoseInWorld(free_spot.context, robot.body)
    free_spot.advance(4.0)
    after = free_spot.world.plant.EvalBodyPoseInWorld(free_spot.context, robot.body)
    assert after.translation()[2] == pytest.approx(0.52, abs=0.05)
    assert np.linalg.norm(after.translation() - before.translation()) < 0.005
    assert after.rotation().matrix()[2, 2] > 0.995


def test_model_has_the_makers_masses_and_effort_limits(free_spot):
    plant, facts = free_spot.world.plant, spot_facts()
    robot = free_spot.world.robots["Alice"]
    legs = sum(facts["legs"][part]["mass"] for part in ("hip", "upper_leg", "lower_leg"))
    expected = facts["body"]["mass"] + 4 * legs + sum(part["mass"] for part in facts["arm"]) + facts["lidar"]["mass"]
    assert plant.CalcTotalMass(free_spot.context, [robot.instance]) == pytest.approx(expected)
    actuators = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices(robot.instance)]
    efforts = {each.name(): each.effort_limit() for each in actuators}
    assert len(efforts) == 19
    assert efforts.items() >= {"fl_kn": 115, "arm_sh1": 181.8, "arm_f1x": 15.32}.items()
