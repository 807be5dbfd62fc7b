"""Networks that are quantised."""

import hashlib
import json

import cv2
import numpy as np
import pytest

from tests.skills.tiny_detector import CLASSES, classifier_bytes, refinement_bytes, write_model

onnx = pytest.importorskip("onnx")

from onnx import TensorProto, helper, numpy_helper  # noqa: E402
from onnxruntime import InferenceSession  # noqa: E402

from errand_train.detector.labels import TrainingDataError  # noqa: E402
from errand_train.detector.onnx_files import trained_weights  # noqa: E402
from errand_train.detector.quantisation import main, quantise, quantise_detector  # noqa: E402
from skills.perception.detector.model_files import classifier_file, load_model, refinement_file  # noqa: E402


def convolutions(*, separable=False):
    """A proposal network of three convolutions, to a box and scores at each cell of 32 pixels.

    One that is `separable` has two more after the first: of each channel by itself, and of all.
    """
    random, classes = np.random.default_rng(5), len(CLASSES)
    sizes = {"first": (16, 3, 32), "second": (24, 16, 3), "last": (4 + classes, 24, 1)}
    sizes |= {"alone": (16, 1, 3), "joined": (16, 16, 1)} if separable else {}
    constants = {
        f"network.{name}.weight": random.normal(0, 1 / np.sqrt(inputs * size * size), (outputs, inputs, size, size))
        for name, (outputs, inputs, size) in sizes.items()
    }
    constants["network.first.weight"] /= 100.0
    constants |= {f"network.{name}.bias": random.normal(0, 0.1, outputs) for name, (outputs, _, _) in sizes.items()}
    constants["network.last.bias"] += 2.0
    whole = {
        "ends": np.array([4, classes]),
        "cells": np.array([0, -1, 4 + classes]),
        "far": np.array([20.0, 20.0, 40.0, 40.0], np.float32),
    }
    nodes = [
        helper.make_node("Cast", ["images"], ["values"], to=TensorProto.FLOAT),
        helper.make_node("Transpose", ["values"], ["planes"], perm=[0, 3, 1, 2]),
        convolution("first", "planes", strides=[32, 32]),
        helper.make_node("Relu", ["first"], ["opened" if separable else "one"]),
        *(_separable("opened", "one") if separable else []),
        convolution("second", "one", pads=[1, 1, 1, 1]),
        helper.make_node("Relu", ["second"], ["two"]),
        convolution("last", "two"),
        helper.make_node("Transpose", ["last"], ["rows"], perm=[0, 2, 3, 1]),
        helper.make_node("Reshape", ["rows", "cells"], ["all"]),
        helper.make_node("Split", ["all", "ends"], ["corners", "logits"], axis=2),
        helper.make_node("Add", ["corners", "far"], ["boxes"]),
        helper.make_node("Sigmoid", ["logits"], ["scores"]),
    ]
    ports = [
        [helper.make_tensor_value_info("images", TensorProto.UINT8, ["N", 480, 640, 3])],
        [
            helper.make_tensor_value_info("boxes", TensorProto.FLOAT, ["N", "A", 4]),
            helper.make_tensor_value_info("scores", TensorProto.FLOAT, ["N", "A", classes]),
        ],
    ]
    kept = [numpy_helper.from_array(value.astype(np.float32), name) for name, value in constants.items()]
    kept += [numpy_helper.from_array(value, name) for name, value in whole.items()]
    graph = helper.make_graph(nodes, "three", *ports, kept)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    helper.set_model_props(model, {"format": "errand-detector-1", "class_names": json.dumps(list(CLASSES))})
    onnx.checker.check_model(model)
    return model


def _separable(given, output):
    return [
        convolution("alone", given, pads=[1, 1, 1, 1], group=16),
        helper.make_node("Relu", ["alone"], ["alone_on"]),
        convolution("joined", "alone_on"),
        helper.make_node("Relu", ["joined"], [output]),
    ]


def convolution(name, given, **told):
    return helper.make_node("Conv", [given, f"network.{name}.weight", f"network.{name}.bias"], [name], **told)


def noise(seed):
    return np.random.default_rng(seed).integers(0, 256, (480, 640, 3), dtype=np.uint8)


@pytest.fixture(scope="module")
def plain():
    return convolutions()


@pytest.fixture(scope="module")
def made(plain):
    return quantise(plain, [{"images": noise(k)[None]} for k in range(10)])


@pytest.fixture
def data(tmp_path):
    """A data set of three pictures."""
    folder = tmp_path / "data"
    folder.mkdir()
    images = [{"id": k, "file_name": f"{k}.png", "width": 640, "height": 480} for k in range(3)]
    for k, image in enumerate(images):
        cv2.imwrite(str(folder / str(image["file_name"])), noise(k))
    categories = [{"id": k, "name": name} for k, name in enumerate(CLASSES)]
    (folder / "train.json").write_text(json.dumps({"images": images, "annotations": [], "categories": categories}))
    return folder


def test_a_quantised_network_has_nearly_the_same_output(plain, made):
    given = {"images": noise(99)[None]}
    said, expected = (InferenceSession(one.SerializeToString()).run(None, given) for one in (made, plain))
    for mine, theirs in zip(said, expected, strict=True):
        apart = np.abs(mine - theirs).max()
        assert 0.0 < apart < 0.05 * np.ptp(theirs)


def test_the_convolutions_at_both_ends_stay_as_they_are(made):
    nodes = {output: node.op_type for node in made.graph.node for output in node.output}
    given = [nodes.get(node.input[1]) for node in made.graph.node if node.op_type == "Conv"]
    assert given == [None, "DequantizeLinear", None]


def test_a_separable_convolution_right_after_the_first_stays_as_it_is_too():
    made = quantise(convolutions(separable=True), [{"images": noise(k)[None]} for k in range(4)])
    kept = {one.name for one in made.graph.initializer if one.name.endswith("weight_quantized")}
    assert kept == {"network.second.weight_quantized"}


def test_quantised_weights_are_within_half_a_step_of_8_bits(plain, made):
    before, after = trained_weights(plain), trained_weights(made)
    assert set(before) == set(after)
    for name, values in before.items():
        largest = np.abs(values).max(axis=tuple(range(1, values.ndim)), keepdims=True)
        assert (np.abs(after[name] - values) <= 0.502 * largest / 127 + 1e-5).all()


def test_weights_between_convolutions_have_8_bits(made):
    kinds = {one.name: one.data_type for one in made.graph.initializer}
    assert kinds["network.second.weight_quantized"] == TensorProto.INT8
    assert kinds["network.first.weight"] == TensorProto.FLOAT


def test_the_others_come_too_and_belong_together(tmp_path, data, plain):
    first = tmp_path / "detector.onnx"
    first.write_bytes(plain.SerializeToString())
    second = refinement_file(first)
    second.write_bytes(refinement_bytes(first.read_bytes()))
    classifier_file(first).write_bytes(classifier_bytes(second.read_bytes()))
    file = quantise_detector(first, data, tmp_path / "out")
    model = load_model(file)
    assert model.refinement is not None
    assert model.classifier is not None
    assert model.classifier.metadata["second"] == hashlib.sha256(refinement_file(file).read_bytes()).hexdigest()
    assert model.refinement.metadata["first"] == hashlib.sha256(file.read_bytes()).hexdigest()
    assert {network.metadata["eight_bits"] for network in (model.proposal, model.refinement, model.classifier)} == {
        "yes"
    }


def test_a_proposal_network_in_8_bits_stays_as_it_is(tmp_path, data, plain):
    first = tmp_path / "detector.onnx"
    first.write_bytes(plain.SerializeToString())
    once = quantise_detector(first, data, tmp_path / "once")
    refinement_file(once).write_bytes(refinement_bytes(once.read_bytes()))
    twice = quantise_detector(once, data, tmp_path / "twice")
    assert twice.read_bytes() == once.read_bytes()


def test_an_already_quantised_network_is_refused(tmp_path, data):
    told = {"format": "errand-detector-1", "class_names": json.dumps(list(CLASSES)), "eight_bits": "yes"}
    file = write_model(tmp_path / "detector.onnx", metadata=told)
    with pytest.raises(TrainingDataError, match=r"detector\.onnx.*is quantised already"):
        quantise_detector(file, data, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_no_file_is_overwritten(tmp_path, data, plain):
    file = tmp_path / "detector.onnx"
    file.write_bytes(plain.SerializeToString())
    with pytest.raises(TrainingDataError, match=r"detector\.onnx.*written over"):
        quantise_detector(file, data, tmp_path)
    assert file.read_bytes() == plain.SerializeToString()


@pytest.mark.parametrize(
    ("detector", "pictures", "named"),
    [
        # what is missing       and so is named
        ("none.onnx", "data", "none.onnx"),
        ("detector.onnx", "none", "none"),
    ],
)
def test_a_missing_file_is_named_and_ends_with_2(tmp_path, data, plain, monkeypatch, capsys, detector, pictures, named):
    (tmp_path / "detector.onnx").write_bytes(plain.SerializeToString())
    out = tmp_path / "out"
    monkeypatch.setattr(
        "sys.argv", ["eight_bits", str(tmp_path / detector), "--data", str(tmp_path / pictures), "--out", str(out)]
    )
    assert main() == 2
    assert named in capsys.readouterr().err
    assert not out.exists()
