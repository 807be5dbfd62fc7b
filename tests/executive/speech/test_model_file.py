"""The layout of `model.bin`, with a small file made here."""

import numpy as np
import pytest

from executive.speech.model_file import read_model_file
from skills.files.errors import InputError

VARIABLES = {
    "encoder/weight": np.arange(12, dtype="<f2").reshape(3, 4),
    "encoder/bias": np.array([0.5, -0.5, 2.0], "<f4"),
    "decoder/heads": np.array(8, "<i2"),
    "decoder/codes": np.array([[[1, -1]]], "<i1"),
}


def test_variables_are_read_by_name_with_shape_and_type(model_bin):
    read = read_model_file(model_bin(VARIABLES))
    assert read.names == tuple(VARIABLES)
    for name, value in VARIABLES.items():
        assert read[name].dtype == value.dtype
        np.testing.assert_array_equal(read[name], value)


def test_weights_change_where_they_stand_and_nothing_else_does(model_bin):
    content = bytearray(model_bin(VARIABLES))
    read_model_file(memoryview(content))["encoder/bias"][...] = 7.0
    assert bytes(content) == model_bin(VARIABLES | {"encoder/bias": np.full(3, 7.0, "<f4")})


def test_what_cannot_be_written_is_not_changed(model_bin):
    with pytest.raises(ValueError, match="read-only"):
        read_model_file(model_bin(VARIABLES))["encoder/bias"][...] = 7.0


#   what is read                                told
STRANGE = {
    "nothing": "damaged",
    "a file cut off": "damaged",
    "a file of another version": "version 5",
    "something else": "version",
}


@pytest.mark.parametrize(("what", "told"), STRANGE.items())
def test_another_file_is_refused(model_bin, what, told):
    content = {
        "nothing": b"",
        "a file cut off": model_bin(VARIABLES)[:90],
        "a file of another version": model_bin(VARIABLES, version=5),
        "something else": b"\xff" * 200,
    }[what]
    with pytest.raises(InputError, match=told) as refused:
        read_model_file(content)
    assert "spot-errand[speech]" in refused.value.hint
