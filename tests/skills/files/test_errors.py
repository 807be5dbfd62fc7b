"""The error that bad input gives, as a user reads it."""

from skills.files.errors import MOST_LETTERS, InputError


def test_a_message_that_repeats_an_endless_name_is_cut_off():
    error = InputError(f"unknown place '{'x' * 5000}'", hint="known are kitchen", file="m.yaml", line=3)
    assert len(error.message) == MOST_LETTERS + 3
    assert str(error).startswith("m.yaml:3: unknown place 'xxx")
    assert str(error).endswith("...; known are kitchen")


def test_a_message_escapes_control_characters():
    assert str(InputError("no 'a\x1b[31m\u202eb\nc\udcff'", hint="x\x07")) == r"no 'a\x1b[31m\u202eb c\udcff'; x\x07"
