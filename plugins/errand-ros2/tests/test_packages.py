"""Packages of interfaces: their definitions, what they depend on, and names that are none."""

import re
from xml.etree import ElementTree

import pytest

from errand_ros2.packages import PACKAGES, write_packages
from skills.inputs.errors import InputError
from tests.executive.cli.calls import done, refusal


def test_packages_have_their_definitions_and_name_what_these_need(tmp_path):
    write_packages(tmp_path, PACKAGES)
    assert "map" not in (written := {folder.name for folder in tmp_path.iterdir()}) and written == {*PACKAGES}
    assert (
        tmp_path / "tf2_msgs/msg/TFMessage.msg"
    ).read_text().strip() == "geometry_msgs/TransformStamped[] transforms"
    for name in PACKAGES:
        cmake, xml = ((tmp_path / name / file).read_text() for file in ("CMakeLists.txt", "package.xml"))
        needs = {each.text for each in ElementTree.fromstring(xml).iter("depend")}
        assert needs == {*re.findall(r" DEPENDENCIES ([\w ]+)", cmake)[0].split()}
        files = list((tmp_path / name).glob("*/*"))
        assert files and all(f" {each.parent.name}/{each.name} " in cmake for each in files)
    xml = (tmp_path / "nav2_msgs/package.xml").read_text()
    assert {"action_msgs", "nav_msgs"} <= {each.text for each in ElementTree.fromstring(xml).iter("depend")}


def test_a_package_that_is_none_is_refused(tmp_path):
    with pytest.raises(InputError, match="there is no package 'std_msgs' to write"):
        write_packages(tmp_path, ["std_msgs"])


def test_the_command_writes_one_package_or_names_the_one_that_was_meant(tmp_path):
    said = done("ros2", "interfaces", tmp_path / "src", "--package", "errand_msgs").stderr
    assert said == f"errand_msgs in {tmp_path / 'src'}; build them by colcon build\n"
    assert [each.name for each in (tmp_path / "src").iterdir()] == ["errand_msgs"]
    assert "did you mean 'tf2_msgs'?" in refusal("ros2", "interfaces", tmp_path, "--package", "tf_msgs")
