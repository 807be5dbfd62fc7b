"""What is put together for a run, and what is refused before it begins."""

from dataclasses import replace

import pytest
from tiny_detector import CLASSES, model_bytes, write_model

from executive.cli.assembly import shared_detector
from executive.mission.errors import InputError
from skills.perception.cascade import Cascade
from skills.stack import default_stack


def with_detector(file):
    return replace(default_stack(), detector=Cascade(str(file)))


def test_a_process_has_one_detector_of_a_stack(tmp_path):
    write_model(tmp_path / "model.onnx")
    stack = with_detector(tmp_path / "model.onnx")
    assert shared_detector(stack) is shared_detector(stack)
    assert shared_detector(stack).class_names == CLASSES


@pytest.mark.parametrize(("content", "part"), [(None, "there is no such model"), (model_bytes()[:-300], "damaged")])
def test_a_model_that_cannot_be_used_is_named_before_anything_moves(tmp_path, content, part):
    file = tmp_path / "model.onnx"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InputError, match=part) as error:
        shared_detector(with_detector(file))
    assert error.value.file == file
    assert error.value.hint == "make a new one: errand dataset train --data DIR --out DIR"
