"""Texts from outside: what is taken, and what is refused with its reason."""

import json

import pytest

from skills.files.errors import InputError
from skills.files.texts import LONGEST_TEXT, json_object, plain_text
from tests.hostile_values import DATA, TEXTS


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
def test_any_text_is_taken_as_one_that_can_be_written_or_is_refused(text):
    try:
        taken = plain_text(text, what="the text")
    except InputError as error:
        assert str(error).encode()
    else:
        assert taken.encode() is not None and len(taken) <= LONGEST_TEXT


def test_the_blanks_around_a_text_are_left_out():
    assert plain_text(" the coke\r\n", what="the answer") == "the coke"


@pytest.mark.parametrize(
    "content",
    [b"[" * 15_000, b"[]", b"{", b"\xff", b'{"a": ' * 15_000, b'{"a": "\\ud800"}', b'{"a": ' + b"9" * 5000 + b"}"],
)
def test_what_is_no_json_object_is_refused(content):
    with pytest.raises(InputError, match="the values are no JSON object; give one"):
        json_object(content, what="the values", hint="give one")


@pytest.mark.parametrize("value", DATA)
def test_any_json_is_an_object_or_refused(value):
    try:
        content = json.dumps({"a": value}).encode()
    except (TypeError, ValueError):
        pytest.skip("no JSON")
    try:
        assert set(json_object(content, what="the values", hint="")) == {"a"}
    except InputError as error:
        assert "no JSON object" in str(error)


def test_an_empty_text_is_an_empty_object():
    assert json_object(b" ", what="the values", hint="") == {}
