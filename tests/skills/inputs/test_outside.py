"""Guarded reading of files, texts and JSON."""

import bz2
import gzip
import json
import lzma
import os

import pytest

from skills.inputs.errors import InputError
from skills.inputs.outside import (
    LONGEST_TEXT,
    file_beside,
    is_file,
    is_folder,
    is_there,
    json_object,
    plain_file,
    plain_text,
    read_bytes,
    read_text,
)
from tests.hostile_values import DATA, TEXTS


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


@pytest.mark.parametrize(("module", "command"), [(gzip, "gunzip"), (bz2, "bunzip2"), (lzma, "unxz")])
def test_a_compressed_file_is_refused_with_the_command_that_unpacks_it(tmp_path, module, command):
    file = tmp_path / "a.yaml.packed"
    file.write_bytes(module.compress(b"name: x"))
    for read in (read_text, read_all, read_path):
        with pytest.raises(InputError, match=f"it is compressed; unpack it: {command} a.yaml.packed"):
            read(file)


@pytest.mark.parametrize("name", TEXTS, ids=lambda name: repr(name[:12]))
def test_any_file_name_is_refused_or_lies_in_the_folder(tmp_path, name):
    (tmp_path / "home").mkdir()
    try:
        found = file_beside(tmp_path / "home/map.yaml", name)
    except InputError as error:
        assert error.file == tmp_path / "home/map.yaml"
        return
    assert found.resolve().is_relative_to(tmp_path / "home")


@pytest.mark.parametrize("name", ["http://x/a.png", "file:///etc/passwd", "/etc/passwd", "../a.png", "link/passwd", ""])
def test_a_name_that_leaves_the_folder_is_refused(tmp_path, name):
    (tmp_path / "link").symlink_to("/etc")
    with pytest.raises(InputError):
        file_beside(tmp_path / "map.yaml", name)


def test_a_file_in_a_folder_above_is_read_where_the_home_is_above(tmp_path):
    (tmp_path / "map").mkdir()
    assert file_beside(tmp_path / "map/m.yaml", "../a.png", home=tmp_path).resolve() == tmp_path / "a.png"


def test_utf_16_text_is_refused_by_name(tmp_path):
    (tmp_path / "a").write_text("a: 1", encoding="utf-16")
    with pytest.raises(InputError, match="UTF-16"):
        read_text(tmp_path / "a")


@pytest.mark.parametrize("name", ["", "a\0b", "x" * 300, "x" * 5_000, "none"])
def test_impossible_file_names_do_not_exist(tmp_path, name):
    assert not is_file(tmp_path / name)
    assert is_there(tmp_path / name) == is_folder(tmp_path / name) == (name == "")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a" * (LONGEST_TEXT + 1), "the answer has 2001 letters; 2000 letters at most"),
        ("\ud800", r"half of a character \(U\+D800\)"),
        ("go\x1b[31m", r"'go\?\[31m' holds a control character \(U\+001B\)"),
        ("\x00", "control character"),
    ],
)
def test_a_text_that_cannot_be_shown_is_refused_with_its_reason(text, words):
    with pytest.raises(InputError, match=words):
        plain_text(text, what="the answer")


@pytest.mark.parametrize("text", TEXTS)
def test_any_text_is_writable_or_refused(text):
    try:
        taken = plain_text(text, what="the text")
    except InputError as error:
        assert str(error).encode()
    else:
        assert taken.encode() is not None and len(taken) <= LONGEST_TEXT


def test_blanks_around_a_text_are_stripped():
    assert plain_text(" the coke\r\n", what="the answer") == "the coke"


def test_an_empty_text_is_an_empty_object():
    assert json_object(b" ", what="the values", hint="") == {}


@pytest.mark.parametrize(
    "content",
    [b"[" * 15_000, b"[]", b"{", b"\xff", b'{"a": ' * 15_000, b'{"a": "\\ud800"}', b'{"a": ' + b"9" * 5000 + b"}"],
)
def test_anything_but_a_json_object_is_refused(content):
    with pytest.raises(InputError, match="the values are no JSON object; give one"):
        json_object(content, what="the values", hint="give one")


@pytest.mark.parametrize("value", [each for each in DATA if not isinstance(each, bytes)])
def test_any_json_is_an_object_or_refused(value):
    content = json.dumps({"a": value}).encode()
    try:
        assert set(json_object(content, what="the values", hint="")) == {"a"}
    except InputError as error:
        assert "no JSON object" in str(error)
