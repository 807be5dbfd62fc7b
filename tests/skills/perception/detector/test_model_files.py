"""Model files: loading, refusals and their messages."""

import pytest
from tiny_detector import (
    CLASSES,
    classifier_bytes,
    model_bytes,
    refinement_bytes,
    write_cascade,
    write_model,
    write_pair,
)

from skills.perception.detector.model_files import ModelFileError, load_model, seal


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
    file.write_bytes(seal(model_bytes()))
    model = load_model(file)
    assert model.class_names == CLASSES
    assert len(model.proposal.session.get_modelmeta().custom_metadata_map["sha256"]) == 64


def test_a_sealed_file_with_one_other_byte_is_damaged(tmp_path):
    content = bytearray(seal(model_bytes()))
    content[len(content) // 2] ^= 1
    (tmp_path / "model.onnx").write_bytes(content)
    assert "damaged" in refused(tmp_path / "model.onnx")


@pytest.mark.parametrize("content", [b"", b"hello\n", model_bytes()[:-200], bytes(1000), model_bytes()[200:]])
def test_anything_but_an_onnx_file_is_refused(tmp_path, content):
    (tmp_path / "model.onnx").write_bytes(content)
    assert "damaged or no ONNX file" in refused(tmp_path / "model.onnx")


def test_a_missing_file_is_named(tmp_path):
    assert refused(tmp_path / "model.onnx") == "there is no such model of the detector"


def test_a_folder_is_refused(tmp_path):
    assert "it is a folder" in refused(tmp_path)


def test_a_file_of_another_format_is_refused_with_both_formats(tmp_path):
    told = refused(write_model(tmp_path / "model.onnx", form="errand-detector-9"))
    assert "format 'errand-detector-9'" in told
    assert "reads 'errand-detector-1'" in told


def test_a_foreign_model_is_refused(tmp_path):
    assert "no model of this detector" in refused(write_model(tmp_path / "model.onnx", metadata={"by": "others"}))


@pytest.mark.parametrize("names", ["", "[", "[]", '"beer"', "[1, 2, 3]", '["beer", ""]'])
def test_a_model_without_class_names_is_refused(tmp_path, names):
    assert "no list of class names" in refused(write_model(tmp_path / "model.onnx", names=names))


@pytest.mark.parametrize("changes", [{"output": "logits"}, {"size": (640, 640)}, {"names": '["beer"]'}])
def test_other_inputs_or_outputs_are_refused(tmp_path, changes):
    assert "other inputs or outputs" in refused(write_model(tmp_path / "model.onnx", **changes))


def refinement_refused(file):
    with pytest.raises(ModelFileError) as error:
        load_model(file)
    assert str(error.value).startswith(f"{file.with_name('model_refinement.onnx')}: ")
    assert "errand dataset refine --data DIR --out DIR" in str(error.value)
    return error.value.message


def test_a_refinement_network_beside_the_first_is_loaded_unless_it_is_unwanted(tmp_path):
    file = write_pair(tmp_path / "model.onnx")
    assert load_model(file).refinement is not None
    assert load_model(file, networks=1).refinement is None
    assert load_model(write_model(tmp_path / "alone.onnx")).refinement is None


def test_a_refinement_network_of_another_first_one_is_refused(tmp_path):
    assert "belongs to another network than model.onnx" in refinement_refused(
        write_pair(tmp_path / "model.onnx", told="0" * 64)
    )


def test_a_refinement_network_of_other_classes_is_refused(tmp_path):
    assert "belongs to another" in refinement_refused(
        write_pair(tmp_path / "model.onnx", classes=("beer", "coke", "cube"))
    )


@pytest.mark.parametrize(
    ("changes", "told"), [({"form": "errand-regions-9"}, "errand-regions-9"), ({"size": 64}, "other inputs or outputs")]
)
def test_a_refinement_network_of_another_form_is_refused(tmp_path, changes, told):
    assert told in refinement_refused(write_pair(tmp_path / "model.onnx", **changes))


def test_a_damaged_refinement_network_is_named(tmp_path):
    file = write_model(tmp_path / "model.onnx")
    (tmp_path / "model_refinement.onnx").write_bytes(refinement_bytes(file.read_bytes())[:-100])
    assert "damaged" in refinement_refused(file)


def classifier_refused(file):
    with pytest.raises(ModelFileError) as error:
        load_model(file)
    assert str(error.value).startswith(f"{file.with_name('model_classifier.onnx')}: ")
    assert "errand dataset refine --classifier --data DIR --out DIR" in str(error.value)
    return error.value.message


# networks wanted   loaded
# 3                 all
# 2                 the first and the second
@pytest.mark.parametrize(("networks", "third"), [(3, True), (2, False)])
def test_a_classifier_network_beside_both_is_loaded_unless_it_is_unwanted(tmp_path, networks, third):
    model = load_model(write_cascade(tmp_path / "model.onnx"), networks=networks)
    assert model.refinement is not None
    assert (model.classifier is not None) is third


def test_a_classifier_network_without_a_second_one_is_left_alone(tmp_path):
    file = write_cascade(tmp_path / "model.onnx")
    (tmp_path / "model_refinement.onnx").unlink()
    assert load_model(file).classifier is None


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"told": "0" * 64}, "belongs to another network than model_refinement.onnx"),
        ({"classes": ("beer", "coke", "cube")}, "belongs to another network"),
        ({"form": "errand-third-9"}, "errand-third-9"),
        ({"size": 64}, "other inputs or outputs"),
    ],
)
def test_a_classifier_network_that_does_not_fit_is_refused(tmp_path, changes, told):
    assert told in classifier_refused(write_cascade(tmp_path / "model.onnx", **changes))


def test_a_damaged_classifier_network_is_named(tmp_path):
    file = write_pair(tmp_path / "model.onnx")
    second = (tmp_path / "model_refinement.onnx").read_bytes()
    (tmp_path / "model_classifier.onnx").write_bytes(classifier_bytes(second)[:-100])
    assert "damaged" in classifier_refused(file)
