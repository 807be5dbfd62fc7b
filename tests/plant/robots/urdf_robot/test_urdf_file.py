"""URDF files: what cannot be a robot is refused with its line."""

import numpy as np
import pytest

from plant.robots.urdf_robot.urdf_file import UrdfFile
from skills.inputs.errors import InputError
from tests.tables import table

JOINT = '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 2"/></joint>'


def written(tmp_path, text, name="robot.urdf"):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_an_axis_has_length_one(tmp_path):
    urdf = UrdfFile(written(tmp_path, f'<robot><link name="a"/><link name="b"/>{JOINT}</robot>'))
    assert urdf.joints["j"].axis.tolist() == [0.0, 0.0, 1.0]


@pytest.mark.parametrize(*table(__file__, "wrong_files"))
def test_a_file_that_is_no_urdf_is_refused_with_its_line(tmp_path, text, change, line, message):
    with pytest.raises(InputError, match=message) as refused:
        UrdfFile(written(tmp_path, text.replace("JOINT", JOINT.replace(*change) if any(change) else JOINT)))
    assert refused.value.line == line and refused.value.hint


@pytest.mark.parametrize(*table(__file__, "xacro"))
def test_a_xacro_file_is_named_so(tmp_path, name, text):
    with pytest.raises(InputError, match=r"it is a xacro file.*`xacro FILE > robot.urdf`"):
        UrdfFile(written(tmp_path, text, name))


def test_traces_of_xacro_and_the_axis_of_a_fixed_joint_do_no_harm(tmp_path):
    fixed = JOINT.replace("revolute", "fixed").replace("0 0 2", "0 0 0")
    xacro = 'xmlns:xacro="http://ros.org/wiki/xacro"'
    urdf = UrdfFile(written(tmp_path, f'<robot {xacro}><link name="a"/><link name="b"/>{fixed}</robot>'))
    assert urdf.poses({})["b"].IsExactlyIdentity()


def test_a_comment_that_speaks_of_xacro_is_no_xacro(tmp_path):
    text = '<robot><!-- made by <xacro:arm/> with ${name} and x="$(arg x)" --><link name="a"/></robot>'
    assert list(UrdfFile(written(tmp_path, text)).links) == ["a"]


def test_links_in_a_loop_are_refused(tmp_path):
    loop = JOINT.replace('"j"', '"k"').replace('link="a"', 'link="c"').replace('child link="b"', 'child link="d"')
    text = "".join(f'<link name="{name}"/>' for name in "abcd") + JOINT + loop
    looped = text + '<joint name="l" type="fixed"><parent link="d"/><child link="c"/></joint>'
    with pytest.raises(InputError, match="in a loop"):
        UrdfFile(written(tmp_path, f"<robot>{looped}</robot>"))


def test_a_driven_joint_without_limits_is_refused(tmp_path):
    urdf = UrdfFile(written(tmp_path, f'<robot><link name="a"/><link name="b"/>\n{JOINT}</robot>'))
    with pytest.raises(InputError, match="joint j has no limit of lower and upper, effort, velocity") as refused:
        urdf.need_limits(["j"])
    assert refused.value.line == 2


def test_poses_follow_the_joints(rover_package):
    urdf = UrdfFile(rover_package / "robot.urdf")
    straight, turned = (urdf.poses({"shoulder_yaw": angle})["palm"].translation() for angle in (0.0, np.pi / 2))
    assert np.allclose(straight, [0.12 + 0.76, 0.0, 0.55]) and np.allclose(turned, [0.12, 0.76, 0.55])
