"""Files of makers: xacro is expanded where it can be, and the text of a URDF is edited where it stands."""

import sys

import cart_urdf as cart
import pytest

from errand_make.robots.source import edited_text, read_source
from plant.robots.urdf_robot.urdf_file import UrdfFile
from skills.inputs.errors import InputError

XACRO = '<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><link name="${1 + 1}"/></robot>'


@pytest.fixture
def file(tmp_path):
    """Writes a text as a file."""

    def written(text):
        path = tmp_path / "robot.urdf.xacro"
        path.write_text(text)
        return path

    return written


def test_without_xacro_the_command_is_shown(file, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    with pytest.raises(InputError, match="the package xacro is not installed") as refused:
        read_source(file(XACRO), {})
    assert "`xacro robot.urdf.xacro > robot.urdf`" in refused.value.hint


def test_a_substitution_that_is_left_over_is_named_with_its_line(file, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    text = '<robot>\n<!-- $(arg a)\n -->\n<link name="a"/>\n<mesh filename="$(find far)/part.stl"/>\n</robot>'
    with pytest.raises(InputError, match=r"xacro file \(\$\(find far\)\)") as refused:
        read_source(file(text), {})
    assert refused.value.line == 5


def test_a_xacro_file_is_expanded(file):
    pytest.importorskip("xacro")
    assert list(read_source(file(XACRO), {}).links) == ["2"]


def test_a_package_that_a_xacro_file_includes_is_found_by_its_option(file, tmp_path):
    pytest.importorskip("xacro")
    (tmp_path / "other").mkdir()
    (tmp_path / "other/part.xacro").write_text('<robot><link name="part"/></robot>')
    text = XACRO.replace('<link name="${1 + 1}"/>', '<xacro:include filename="$(find far)/part.xacro"/>')
    assert list(read_source(file(text), {"far": tmp_path / "other"}).links) == ["part"]
    with pytest.raises(InputError, match="there is no folder of package 'far'") as refused:
        read_source(file(text), {})
    assert "--package far=DIR" in refused.value.hint


def test_the_expansion_of_a_broken_xacro_file_is_refused(file):
    pytest.importorskip("xacro")
    with pytest.raises(InputError, match="xacro does not expand it"):
        read_source(file(XACRO.replace("1 + 1", "missing")), {})


def test_edited_attributes_keep_lines_comments_and_all_else(file):
    urdf = UrdfFile(file(cart.robot(cart.base(), "<!-- \u00fc <link> & more -->", cart.wheels())))
    assert edited_text(urdf) == urdf.text
    next(urdf.robot.iter("mass")).set("value", "21 & more")
    edited = edited_text(urdf, "<link name='new'/>")
    assert "<link name='new'/></robot>" in edited
    assert edited.replace("<link name='new'/>", "") == urdf.text.replace('value="20"', 'value="21 &amp; more"', 1)


def test_a_tag_of_several_lines_keeps_their_number(file):
    urdf = UrdfFile(file('<robot>\n<link\n  name="a"\n/>\n</robot>'))
    urdf.links["a"].set("name", "b")
    assert edited_text(urdf) == '<robot>\n<link name="b"\n\n/>\n</robot>'
