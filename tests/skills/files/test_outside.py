"""Files from outside: only plain ones, below a size, in the folder of the file that names them."""

import os

import pytest

from skills.files.errors import InputError
from skills.files.outside import file_beside, is_file, is_folder, is_there, plain_file, read_bytes, read_text
from tests.hostile_values import TEXTS


def read_path(file):
    plain_file(file, most_bytes=100)


def read_all(file):
    read_bytes(file, most_bytes=100)


@pytest.mark.parametrize("read", [read_all, read_path])
def test_only_a_plain_file_below_the_limit_is_read(tmp_path, read):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "large").write_bytes(b"x" * 101)
    (tmp_path / "pointer").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n")
    (tmp_path / "good").write_bytes(b"x" * 100)
    said = {"pipe": "pipe", "large": "at most 100", "pointer": "git lfs pull", "missing": "no such file", ".": "folder"}
    for name, words in said.items():
        with pytest.raises(InputError, match=words) as error:
            read(tmp_path / name)
        assert error.value.file == tmp_path / name
    read(tmp_path / "good")


@pytest.mark.parametrize("name", TEXTS, ids=lambda name: repr(name[:12]))
def test_any_name_of_a_file_is_refused_or_lies_in_the_folder(tmp_path, name):
    (tmp_path / "home").mkdir()
    try:
        found = file_beside(tmp_path / "home/map.yaml", name)
    except InputError as error:
        assert error.file == tmp_path / "home/map.yaml"
        return
    assert found.resolve().is_relative_to(tmp_path / "home")


@pytest.mark.parametrize("name", ["http://x/a.png", "file:///etc/passwd", "/etc/passwd", "../a.png", "link/passwd", ""])
def test_a_name_that_leads_elsewhere_is_refused(tmp_path, name):
    (tmp_path / "link").symlink_to("/etc")
    with pytest.raises(InputError):
        file_beside(tmp_path / "map.yaml", name)


def test_a_file_in_a_folder_above_is_read_where_the_home_is_above(tmp_path):
    (tmp_path / "map").mkdir()
    assert file_beside(tmp_path / "map/m.yaml", "../a.png", home=tmp_path).resolve() == tmp_path / "a.png"


def test_utf_16_text_is_told(tmp_path):
    (tmp_path / "a").write_text("a: 1", encoding="utf-16")
    with pytest.raises(InputError, match="UTF-16"):
        read_text(tmp_path / "a")


@pytest.mark.parametrize("name", ["", "a\0b", "x" * 300, "x" * 5_000, "none"])
def test_what_the_system_cannot_look_for_is_not_there(tmp_path, name):
    assert not is_file(tmp_path / name)
    assert is_there(tmp_path / name) == is_folder(tmp_path / name) == (name == "")
