"""Fetch's URDF says the same as its facts."""

import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from plant.robots.fetch.description import fetch_urdf


def plant_of(root):
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(fetch_urdf(root=root), "urdf")
    plant.Finalize()
    return plant


@pytest.mark.parametrize("root", ["base_link", "body"])
def test_the_masses_are_those_of_the_facts(root):
    """70.13 base + 13.28 column + 10.78 torso + 2 x 4.35 wheels + 3.16 head + 13.20 arm + 1.65 hand + 0.16 fingers."""
    plant = plant_of(root)
    assert plant.CalcTotalMass(plant.CreateDefaultContext()) == pytest.approx(120.93, abs=0.05)


@pytest.mark.parametrize("root", ["base_link", "body"])
def test_the_lift_raises_the_body_over_the_base_whichever_is_the_root(root):
    """0.37743 m with the torso down, and as much more as the joint reads."""
    plant = plant_of(root)
    context = plant.CreateDefaultContext()
    q = plant.GetPositions(context)
    q[plant.GetJointByName("torso_lift").position_start()] = 0.3
    plant.SetPositions(context, q)
    base, body = plant.GetFrameByName("base_link"), plant.GetFrameByName("body")
    X = plant.CalcRelativeTransform(context, base, body)
    assert X.translation() == pytest.approx([0.0, 0.0, 0.67743], abs=1e-5)
