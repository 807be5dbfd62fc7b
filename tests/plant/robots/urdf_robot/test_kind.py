"""A robot from a URDF: its capabilities, and the errors of its file."""

import shutil

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from plant.robots.fetch.kind import FETCH
from plant.robots.urdf_robot.description import Description
from skills.inputs.errors import InputError
from skills.manipulation.arm.kinematics import arm_model
from skills.robot import BaseKind, Mount
from tests.tables import table


def test_capabilities_have_the_protocols_frames(rover_kind):
    can = rover_kind.capabilities()
    assert can.base_kind is BaseKind.DIFFERENTIAL and can.lidar_height_m == pytest.approx(0.33)
    assert [camera.mount for camera in can.cameras] == [Mount.BODY] and can.object_camera is can.cameras[0]
    X_BH = arm_model(can).X_BH(np.zeros(6))
    assert np.allclose(X_BH.translation(), [0.88, 0.0, 0.52])
    assert np.allclose(X_BH.rotation().matrix(), np.eye(3), atol=1e-6)  # x along the fingers, z along their closing


def test_the_arm_is_stowed_over_the_footprint_out_of_the_cameras_view(rover_kind):
    can = rover_kind.capabilities()
    points_B = arm_model(can).points_B(np.array(can.arm.stowed_rad))
    assert np.all(np.abs(points_B[:, :2]) < np.abs(can.footprint_m).max(axis=0))
    x, y, z = can.cameras[0].X_FC.inverse() @ points_B[2:].T
    assert np.all(np.hypot(x, y) > 0.5 * z)


def changed(package, folder, old, new):
    """Path of the file of a robot's package in which one text stands for another."""
    path = shutil.copytree(package, folder / "changed") / "robot.yaml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    return path


def check_refused(path, message):
    with pytest.raises(InputError, match=message) as refused:
        description = Description(path)
        _ = description.capabilities
        _ = description.assembly.axle()
    assert refused.value.line


@pytest.mark.parametrize(*table(__file__, "wrong_parts"))
def test_a_wrong_part_is_named_with_its_line(rover_package, tmp_path, old, new, message):
    check_refused(changed(rover_package, tmp_path, old, new), message)


@pytest.mark.parametrize(*table(__file__, "wrong_wheels_and_lifts"))
def test_a_wrong_wheel_or_lift_is_named_with_its_line(tmp_path, old, new, message):
    check_refused(changed(FETCH.facts.parent, tmp_path, old, new), message)


def test_a_round_base_circumscribes_its_radius(rover_package, tmp_path):
    """A polygon about a circle of 0.3 m: no edge is nearer, no corner is far."""
    path = rover_package / "robot.yaml"
    outline = path.read_text().partition("footprint:")[2].partition("  max_speed")[0]
    corners = Description(changed(rover_package, tmp_path, outline, " 0.3\n")).capabilities.footprint_m
    middles = np.add(corners, np.roll(corners, 1, axis=0)) / 2.0
    assert np.hypot(*np.transpose(middles)) == pytest.approx(0.3)
    assert np.hypot(*np.transpose(corners)).max() < 0.312


def centre_of_mass(description):
    """Centre of mass (3,) in B, with all joints at 0."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(description.assembly.planned_text(), "urdf")
    plant.Finalize()
    return plant.CalcCenterOfMassPositionInWorld(plant.CreateDefaultContext())


def test_the_body_frame_on_a_lift_may_be_off_its_joint(tmp_path):
    """B moves by (0.1, 0, 0.2) with its link, so all else moves back in B; the base stays on the floor."""
    path = changed(FETCH.facts.parent, tmp_path, "link: body ", "link: chest ")
    path.write_text(path.read_text().replace("height: 0.37743", "height: 0.57743"))
    chest = '<link name="chest"/><joint name="chest" type="fixed"><origin xyz="0.1 0 0.2"/><parent link="body"/>'
    urdf = path.with_name("robot.urdf")
    urdf.write_text(urdf.read_text().replace("</robot>", f'{chest}<child link="chest"/></joint></robot>'))
    usual, moved = Description(FETCH.facts), Description(path)
    assert centre_of_mass(usual) - centre_of_mass(moved) == pytest.approx([0.1, 0.0, 0.2])
    heads = [each.capabilities.head.p_BP_m for each in (usual, moved)]
    assert np.subtract(*heads) == pytest.approx([0.1, 0.0, 0.2])
    assert moved.capabilities.lidar_height_m == usual.capabilities.lidar_height_m
    with pytest.raises(InputError, match="the middle of the axle is not below the origin of chest"):
        moved.assembly.axle()


def test_a_lift_that_slides_down_is_refused(tmp_path):
    path = shutil.copytree(FETCH.facts.parent, tmp_path / "changed") / "robot.urdf"
    up = '<child link="body"/><axis xyz="0 0 1"/>'
    assert up in path.read_text()
    path.write_text(path.read_text().replace(up, up.replace("0 0 1", "0 0 -1")))
    check_refused(path.with_name("robot.yaml"), "joint torso_lift does not slide upwards")


def test_contact_properties_of_the_urdf_reach_the_plant(rover_package, tmp_path):
    path = shutil.copytree(rover_package, tmp_path / "changed") / "robot.urdf"
    contact = '<drake:proximity_properties><drake:mu_static value="0.37"/></drake:proximity_properties></collision>'
    assert "</collision>" in path.read_text()
    path.write_text(path.read_text().replace("</collision>", contact, 1))
    assert '<drake:mu_static value="0.37"' in Description(path.with_name("robot.yaml")).assembly.text()
