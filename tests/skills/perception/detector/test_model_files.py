"""Model files: loading, refusals and their messages."""

from functools import partial

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


def refused(file, network="", command="train"):
    """Message of a model file that cannot be loaded, and asserts that it names file and command."""
    with pytest.raises(ModelFileError) as error:
        load_model(file)
    named = file.with_name(f"{file.stem}_{network}.onnx") if network else file
    assert str(error.value).startswith(f"{named}: ")
    assert f"errand dataset {command} --data DIR --out DIR" in str(error.value)
    return error.value.message


refinement_refused = partial(refused, network="refinement", command="refine")
classifier_refused = partial(refused, network="classifier", command="refine --classifier")


@pytest.fixture
def file(tmp_path):
    return tmp_path / "model.onnx"


def test_a_good_file_is_loaded(file):
    assert load_model(write_model(file)).class_names == CLASSES


def test_a_sealed_file_is_loaded(file):
    file.write_bytes(seal(model_bytes()))
    model = load_model(file)
    assert model.class_names == CLASSES
    assert len(model.proposal.session.get_modelmeta().custom_metadata_map["sha256"]) == 64


def test_a_sealed_file_with_one_other_byte_is_damaged(file):
    content = bytearray(seal(model_bytes()))
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    assert "damaged" in refused(file)


@pytest.mark.parametrize("content", [b"", b"hello\n", model_bytes()[:-200], bytes(1000), model_bytes()[200:]])
def test_anything_but_an_onnx_file_is_refused(file, content):
    file.write_bytes(content)
    assert "damaged or no ONNX file" in refused(file)


def test_a_missing_file_is_named(file):
    assert refused(file) == "there is no such model of the detector"


def test_a_folder_is_refused(file):
    assert "it is a folder" in refused(file.parent)


NO_NAMES, OTHER = "no list of class names", "other inputs or outputs"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"form": "errand-detector-9"}, "format 'errand-detector-9'"),
        ({"form": "errand-detector-9"}, "reads 'errand-detector-1'"),
        ({"metadata": {"by": "others"}}, "no model of this detector"),
        *(({"names": names}, NO_NAMES) for names in ("", "[", "[]", '"beer"', "[1, 2, 3]", '["beer", ""]')),
        *((changes, OTHER) for changes in ({"output": "logits"}, {"size": (640, 640)}, {"names": '["beer"]'})),
    ],
)
def test_a_model_that_does_not_fit_is_refused(file, changes, message):
    assert message in refused(write_model(file, **changes))


def test_a_refinement_network_beside_the_first_is_loaded_unless_it_is_unwanted(file):
    write_pair(file)
    assert load_model(file).refinement is not None
    assert load_model(file, networks=1).refinement is None
    assert load_model(write_model(file.with_name("alone.onnx"))).refinement is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"told": "0" * 64}, "belongs to another network than model.onnx"),
        ({"classes": ("beer", "coke", "cube")}, "belongs to another"),
        ({"form": "errand-regions-9"}, "errand-regions-9"),
        ({"size": 64}, "other inputs or outputs"),
    ],
)
def test_a_refinement_network_that_does_not_fit_is_refused(file, changes, message):
    assert message in refinement_refused(write_pair(file, **changes))


def test_a_damaged_refinement_network_is_named(file):
    whole = refinement_bytes(write_model(file).read_bytes())
    file.with_name("model_refinement.onnx").write_bytes(whole[:-100])
    assert "damaged" in refinement_refused(file)


def test_a_damaged_classifier_network_is_named(file):
    whole = refinement_bytes(write_model(file).read_bytes())
    file.with_name("model_refinement.onnx").write_bytes(whole)
    file.with_name("model_classifier.onnx").write_bytes(classifier_bytes(whole)[:-100])
    assert "damaged" in classifier_refused(file)


@pytest.mark.parametrize(("networks", "third"), [(3, True), (2, False)])
def test_a_classifier_network_beside_both_is_loaded_unless_it_is_unwanted(file, networks, third):
    model = load_model(write_cascade(file), networks=networks)
    assert model.refinement is not None
    assert (model.classifier is not None) is third


def test_a_classifier_network_without_a_second_one_is_left_alone(file):
    write_cascade(file).with_name("model_refinement.onnx").unlink()
    assert load_model(file).classifier is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"told": "0" * 64}, "belongs to another network than model_refinement.onnx"),
        ({"classes": ("beer", "coke", "cube")}, "belongs to another network"),
        ({"form": "errand-third-9"}, "errand-third-9"),
        ({"size": 64}, "other inputs or outputs"),
    ],
)
def test_a_classifier_network_that_does_not_fit_is_refused(file, changes, message):
    assert message in classifier_refused(write_cascade(file, **changes))
