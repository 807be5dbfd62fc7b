"""What is put together for a run, and what is refused before it begins."""

import pytest
from tiny_detector import CLASSES, model_bytes, write_model

from executive.cli import assembly
from executive.cli.assembly import shared_detector
from executive.mission.errors import InputError


@pytest.fixture
def model_file(tmp_path, monkeypatch):
    monkeypatch.setattr(assembly, "MODEL_FILE", tmp_path / "model.onnx")
    shared_detector.cache_clear()
    yield tmp_path / "model.onnx"
    shared_detector.cache_clear()


def test_a_process_has_one_detector(model_file):
    write_model(model_file)
    assert shared_detector() is shared_detector()
    assert shared_detector().class_names == CLASSES


@pytest.mark.parametrize(("content", "part"), [(None, "there is no such model"), (model_bytes()[:-300], "damaged")])
def test_a_model_that_cannot_be_used_is_named_before_anything_moves(model_file, content, part):
    if content is not None:
        model_file.write_bytes(content)
    with pytest.raises(InputError, match=part) as error:
        shared_detector()
    assert error.value.file == model_file
    assert error.value.mend == "make a new one: errand dataset train --data DIR --out DIR"
