"""The network's file: what is refused, and how it is told."""

import pytest
from tiny_detector import CLASSES, model_bytes, write_model

from skills.detect.detector_file import ModelFileError, load_model, sealed


def refused(file):
    with pytest.raises(ModelFileError) as error:
        load_model(file)
    assert str(error.value).startswith(f"{file}: ")
    assert str(error.value).endswith("make a new one: errand dataset train --data DIR --out DIR")
    return error.value.message


def test_a_good_file_is_loaded(tmp_path):
    assert load_model(write_model(tmp_path / "model.onnx")).class_names == CLASSES


def test_a_sealed_file_is_loaded(tmp_path):
    file = tmp_path / "model.onnx"
    file.write_bytes(sealed(model_bytes()))
    model = load_model(file)
    assert model.class_names == CLASSES
    assert len(model.session.get_modelmeta().custom_metadata_map["sha256"]) == 64


def test_a_sealed_file_with_one_other_byte_is_damaged(tmp_path):
    content = bytearray(sealed(model_bytes()))
    content[len(content) // 2] ^= 1
    (tmp_path / "model.onnx").write_bytes(content)
    assert "damaged" in refused(tmp_path / "model.onnx")


@pytest.mark.parametrize("content", [b"", b"hello\n", model_bytes()[:-200], bytes(1000), model_bytes()[200:]])
def test_what_is_no_onnx_file_is_refused(tmp_path, content):
    (tmp_path / "model.onnx").write_bytes(content)
    assert "damaged or no ONNX file" in refused(tmp_path / "model.onnx")


def test_a_missing_file_is_named(tmp_path):
    assert refused(tmp_path / "model.onnx") == "there is no such model of the detector"


def test_a_folder_is_no_file(tmp_path):
    assert "cannot read it" in refused(tmp_path)


def test_another_version_is_named(tmp_path):
    told = refused(write_model(tmp_path / "model.onnx", form="errand-detector-9"))
    assert "format 'errand-detector-9'" in told
    assert "reads 'errand-detector-1'" in told


def test_a_model_of_others_is_refused(tmp_path):
    assert "no model of this detector" in refused(write_model(tmp_path / "model.onnx", metadata={"by": "others"}))


@pytest.mark.parametrize("names", ["", "[", "[]", '"beer"', "[1, 2, 3]", '["beer", ""]'])
def test_class_names_must_be_told(tmp_path, names):
    assert "names of its classes" in refused(write_model(tmp_path / "model.onnx", names=names))


@pytest.mark.parametrize("changes", [{"output": "logits"}, {"size": (640, 640)}, {"names": '["beer"]'}])
def test_other_inputs_or_outputs_are_refused(tmp_path, changes):
    assert "other inputs or outputs" in refused(write_model(tmp_path / "model.onnx", **changes))
