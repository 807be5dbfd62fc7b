"""A robot from a URDF: what is inferred, its capabilities, and the errors of its file."""

import re
import shutil

import numpy as np
import pytest
from rover_urdf import write_package

from executive.cli.new_command import render_robot
from plant.robots.urdf_robot.description import Description
from skills.inputs.errors import InputError
from skills.inputs.yaml_source import read_yaml
from skills.manipulation.arm.kinematics import arm_model
from skills.robot import BaseKind, Mount
from tests.tables import table

ARM = ["shoulder_yaw", "shoulder_pitch", "elbow", "wrist_roll", "wrist_pitch", "hand_roll"]


def test_parts_are_read_off_the_urdf(rover_package):
    data = read_yaml(rover_package / "robot.yaml").data
    assert data["base"]["link"] == "base_link" and data["base"]["motion"] == "differential"
    assert data["lidar"]["link"] == "laser" and data["cameras"]["camera_0"]["link"] == "camera_optical_frame"
    assert data["arm"]["joints"] == ARM and data["arm"]["max_reach"] == pytest.approx(0.86)
    assert data["gripper"]["joints"] == {"left_finger_slide": 0.5, "right_finger_slide": 0.5}
    assert (data["gripper"]["widest"], data["gripper"]["tip_x"]) == pytest.approx((0.1, 0.2))


def test_the_file_marks_the_parts_that_a_urdf_does_not_decide(rover_package):
    text = (rover_package / "robot.yaml").read_text()
    assert re.search(r"# CHECK: 2 wheels were found; .*\nbase:", text)
    assert re.search(r"# CHECK: .*max_payload.*\narm:", text)


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


def test_joints_of_pan_and_tilt_are_a_head_that_carries_the_camera(tmp_path):
    render_robot("rover", write_package(tmp_path, with_head=True), tmp_path / "made", packages={})
    can = Description(tmp_path / "made/errand_robot_rover/robot.yaml").capabilities
    assert can.head is not None and can.head.joint_names == ("head_pan", "head_tilt")
    assert np.allclose(can.head.p_BP_m, [-0.10, 0.0, 1.12]) and can.object_camera.mount is Mount.HEAD


@pytest.mark.parametrize("options", [{"with_gripper": False}, {"with_arm": False}])
def test_a_robot_may_have_no_gripper_or_no_arm(tmp_path, options):
    render_robot("rover", write_package(tmp_path, **options), tmp_path / "made", packages={})
    can = Description(tmp_path / "made/errand_robot_rover/robot.yaml").capabilities
    assert can.gripper is None and (can.arm is None) == ("with_arm" in options)
    assert not (tmp_path / "made/tests/grasp.skilltest.yaml").exists()


@pytest.mark.parametrize(*table(__file__, "wrong_parts"))
def test_a_wrong_part_is_named_with_its_line(rover_package, tmp_path, old, new, message):
    shutil.copytree(rover_package, tmp_path / "changed")
    path = tmp_path / "changed/robot.yaml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(InputError, match=message) as refused:
        _ = Description(path).capabilities
    assert refused.value.line


def test_a_link_with_a_zero_inertia_is_named(rover_urdf, tmp_path):
    rover_urdf.write_text(re.sub(r'(ixx|iyy|izz)="[^"]*"', r'\1="0"', rover_urdf.read_text()))
    with pytest.raises(InputError, match=r"link base_link has a zero inertia"):
        render_robot("rover", rover_urdf, tmp_path / "made", packages={})


def test_a_package_in_another_folder_is_given(rover_urdf, tmp_path):
    other = tmp_path / "elsewhere"
    (rover_urdf.parent.parent / "meshes").rename(other)
    text = rover_urdf.read_text().replace("package://rover_description/meshes/", "package://far/")
    rover_urdf.write_text(text)
    render_robot("rover", rover_urdf, tmp_path / "made", packages={"far": other})
    assert (tmp_path / "made/errand_robot_rover/robot.yaml").is_file()


@pytest.mark.parametrize(*table(__file__, "wrong_urdfs"))
def test_a_urdf_that_the_plant_cannot_use_is_refused_with_its_line(rover_urdf, tmp_path, old, new, message):
    text = rover_urdf.read_text()
    assert old in text
    rover_urdf.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as refused:
        render_robot("rover", rover_urdf, tmp_path / "made", packages={})
    assert refused.value.file == rover_urdf and refused.value.line and refused.value.hint
