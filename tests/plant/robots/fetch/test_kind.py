"""Fetch's file and URDF: its masses, lift, LiDAR and capabilities."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from plant.robots.fetch.kind import FETCH
from plant.robots.urdf_robot.description import Description
from plant.robots.urdf_robot.robot import lidar_spec
from skills.robot import BaseKind, Mount

DESCRIPTION = Description(FETCH.facts)
ROOTS = ("base_link", "body")


def plant_of(root):
    """Plant with the URDF of that root: the one of the plant, or the planner's."""
    assembly, plant = DESCRIPTION.assembly, MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString({"base_link": assembly.text, "body": assembly.planned_text}[root](), "urdf")
    plant.Finalize()
    assert plant.GetBodyByName(root).is_floating_base_body()
    return plant


@pytest.mark.parametrize("root", ROOTS)
def test_the_masses_add_up(root):
    """70.13 base + 13.28 column + 10.78 torso + 2 x 4.35 wheels + 3.16 head + 13.20 arm + 1.65 hand + 0.16 fingers."""
    plant = plant_of(root)
    assert plant.CalcTotalMass(plant.CreateDefaultContext()) == pytest.approx(120.93, abs=0.05)


@pytest.mark.parametrize("root", ROOTS)
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


def test_the_lidar_sees_220_degrees_in_662_points():
    spec = lidar_spec(DESCRIPTION)
    azimuths = np.degrees(spec.azimuths_rad()[spec.visible_columns()])
    assert (len(azimuths), azimuths[-1] - azimuths[0]) == (662, pytest.approx(220.0, abs=0.1))
    assert azimuths[0] + azimuths[-1] == pytest.approx(0.0, abs=0.5)


def test_capabilities_describe_a_wheeled_robot():
    known = FETCH.capabilities()
    assert (known.base_kind, known.pitch_range_rad) == (BaseKind.DIFFERENTIAL, (0.0, 0.0))
    assert [camera.mount for camera in known.cameras] == [Mount.HEAD]
    assert (known.lidar_height_m, len(known.arm.joint_names)) == (pytest.approx(0.288, abs=0.001), 7)


def test_wheels_and_casters_are_no_trunk():
    assert FETCH.leg_links == ("left_wheel", "right_wheel", "casters")
    assert FETCH.trunk_links == ("base_link", "body", "head_pan", "head_tilt")


def test_only_the_plant_has_rubber_on_the_fingers():
    assembly = DESCRIPTION.assembly
    assert (assembly.text().count("finger_pad_"), assembly.planned_text().count("finger_pad_")) == (54, 0)


def test_the_how_to_shows_the_keys_of_the_file():
    page = (Path(__file__).parents[4] / "docs/how-to/own-robot.md").read_text()
    shown = yaml.safe_load(page.partition("```yaml\n")[2].partition("```")[0])
    real = yaml.safe_load(FETCH.facts.read_text())
    assert {key: {name: real[key][name] for name in part} for key, part in shown.items()} == shown
