"""The package of a robot from a URDF: what is inferred, what is written, and URDFs that are refused."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rover_urdf import write_package

from errand_make.robots.package import render_robot
from plant.robots.urdf_robot.kind import urdf_kind
from skills.inputs.errors import InputError
from skills.inputs.yaml_source import read_yaml
from skills.robot import Mount
from tests.tables import table

ARM = ["shoulder_yaw", "shoulder_pitch", "elbow", "wrist_roll", "wrist_pitch", "hand_roll"]
ROVER = Path(__file__).parents[4] / "tests/plant/robots/urdf_robot/errand_robot_rover"


@pytest.fixture
def rover_urdf(tmp_path):
    return write_package(tmp_path)


@pytest.fixture(scope="module")
def rover_package(tmp_path_factory):
    """Folder with `robot.yaml` of the rover."""
    folder = tmp_path_factory.mktemp("rover")
    render_robot("rover", write_package(folder), folder / "made", packages={})
    return folder / "made/errand_robot_rover"


def texts(folder):
    """The texts of the files below a folder; the search for the stowed arm may end elsewhere."""
    files = (path for path in folder.rglob("*") if path.suffix in (".py", ".yaml", ".urdf", ".obj", ".mtl"))
    return {str(each.relative_to(folder)): re.sub(r" +stowed: .*", "", each.read_text()) for each in files}


def test_the_package_of_the_rover_is_the_one_that_the_plant_is_tested_with(rover_package):
    assert texts(rover_package) == texts(ROVER)


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


def test_joints_of_pan_and_tilt_are_a_head_that_carries_the_camera(tmp_path):
    render_robot("rover", write_package(tmp_path, with_head=True), tmp_path / "made", packages={})
    can = urdf_kind(tmp_path / "made/errand_robot_rover/robot.yaml").capabilities()
    assert can.head is not None and can.head.joint_names == ("head_pan", "head_tilt")
    assert np.allclose(can.head.p_BP_m, [-0.10, 0.0, 1.12]) and can.object_camera.mount is Mount.HEAD


# Height (m) and tilt (rad) of a camera on the mast, which begins 0.25 m above the floor -> whether tests look and grasp
@pytest.mark.parametrize(
    ("eye", "looks"), [((0.9, 0.6), True), ((0.9, 0.0), True), ((1.3, 0.0), False), ((0.1, 0.0), False)]
)
def test_a_camera_that_does_not_see_a_table_is_not_tested_on_one(tmp_path, eye, looks):
    notes = render_robot("made", write_package(tmp_path, eye=eye), tmp_path / "made", packages={})
    tests = {path.name.split(".")[0] for path in (tmp_path / "made/tests").glob("*.yaml")}
    assert {"look", "take", "grasp"} & tests == ({"look", "take", "grasp"} if looks else set())
    assert any("camera_0 does not move, and does not see the top of a table" in each for each in notes) is not looks


@pytest.mark.parametrize("options", [{"with_gripper": False}, {"with_arm": False}])
def test_a_robot_may_have_no_gripper_or_no_arm(tmp_path, options):
    render_robot("rover", write_package(tmp_path, **options), tmp_path / "made", packages={})
    can = urdf_kind(tmp_path / "made/errand_robot_rover/robot.yaml").capabilities()
    assert can.gripper is None and (can.arm is None) == ("with_arm" in options)
    assert not (tmp_path / "made/tests/grasp.skilltest.yaml").exists()


def test_a_driven_link_with_a_zero_inertia_is_named(rover_urdf, tmp_path):
    rover_urdf.write_text(re.sub(r'(ixx|iyy|izz)="[^"]*"', r'\1="0"', rover_urdf.read_text()))
    with pytest.raises(InputError, match=r"link shoulder_yaw_link moves.* of no body"):
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


# the arm as it is; with short links; with a low shoulder
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {'xyz="0.40 0 0"': 'xyz="0.32 0 0"', 'xyz="0.36 0 0"': 'xyz="0.28 0 0"', "0.38 0.07": "0.3 0.07"},
        {'xyz="0.12 0 0.42"': 'xyz="0.12 0 0.27"'},
    ],
)
def test_the_written_test_of_the_grasp_succeeds_whatever_the_arm(rover_urdf, tmp_path, changes):
    text = rover_urdf.read_text()
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    rover_urdf.write_text(text)
    render_robot("rover", rover_urdf, tmp_path / "made", packages={})
    only = "taken and not verb and not tick and not stale"
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:xdist", "tests/grasp.skilltest.yaml", "-k", only]
    found = {"PYTHONPATH": os.pathsep.join([str(tmp_path / "made"), *sys.path])}
    ran = subprocess.run(
        command, cwd=tmp_path / "made", env=os.environ | found, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0 and "1 passed" in ran.stdout, ran.stdout
