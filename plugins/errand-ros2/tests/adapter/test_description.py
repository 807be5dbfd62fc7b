"""Descriptions of robots: the one of a served robot, those of the page, and what is refused with its line."""

import pytest
import yaml

from errand_ros2.adapter.description import RobotFile, load_description
from skills.inputs.errors import InputError
from tests.docs.documents import ROOT

RECIPES = ROOT / "plugins/errand-ros2/recipes"


def test_a_served_spot_has_all_its_parts():
    description = load_description(None, "spot")
    can = description.capabilities
    assert can.arm is not None and can.gripper is not None and len(can.cameras) == 6
    assert (can.max_speed_m_s, can.drive_expiry_s, can.localises) == (0.8, 0.6, False)
    assert description.file.sim_time


def test_a_served_fetch_has_its_head():
    assert load_description(None, "fetch").file.head.action == "head_controller/follow_joint_trajectory"


def test_a_recipe_has_the_form_of_a_description():
    for kind in ("turtlebot4", "stretch", "fetch"):
        assert RobotFile.model_validate(yaml.safe_load((RECIPES / f"{kind}.yaml").read_text())).kind == kind


def test_the_recipe_of_fetch_fits_the_installed_kind():
    description = load_description(RECIPES / "fetch.yaml", "spot")
    assert description.file.joint_names["elbow_flex"] == "elbow_flex_joint"
    joints = description.capabilities.description
    assert all(f'name="{name}"' in joints for name in description.file.joint_names)


def test_parts_that_a_file_leaves_out_are_not_used(tmp_path):
    (tmp_path / "robot.yaml").write_text("kind: spot\nlidar: {scan: scan}\n")
    can = load_description(tmp_path / "robot.yaml", "spot").capabilities
    assert (can.arm, can.gripper, can.head, can.cameras) == (None, None, None, ())


@pytest.mark.parametrize(
    ("text", "line", "what"),
    [
        ("kind: crane\nlidar: {scan: s}", None, "no kind of robot 'crane'"),
        ("kind: spot", 1, "lidar is missing"),
        ("kind: spot\nlidar: {}", 2, "names points or scan, one of the two"),
        ("lidar: {scan: a, points: b}", 1, "names points or scan, one of the two"),
        ("lidar: {scan: s}\nwheels: 3", 2, "wheels is unknown"),
        ("lidar: {scan: 's p'}", 1, "lidar.scan"),
        ("lidar: {scan: s}\nbase: {speed: .nan}", 2, "base.speed"),
        ("lidar: {scan: s}\nhead: {action: h}", 2, "a spot has no head"),
        ("lidar: {scan: s}\ncameras: {nose: {image: i, info: f}}", 2, "a spot has the cameras frontleft"),
        ("[", None, ""),
    ],
)
def test_a_file_that_is_none_is_refused_with_its_line(tmp_path, text, line, what):
    (file := tmp_path / "robot.yaml").write_text(text)
    with pytest.raises(InputError) as refused:
        load_description(file, "spot")
    assert what in str(refused.value)
    assert line is None or refused.value.line == line


def test_a_file_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        load_description(tmp_path / "robot.yaml", "spot")
