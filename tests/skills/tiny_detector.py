"""Small networks in the detector's form, whose pictures tell them what to find."""

import hashlib
import json

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

CLASSES = ("beer", "coke", "hammer")
ANCHORS = 5
STEP_PX = 2.5
"""Boxes stand in the picture as bytes, in steps of so many pixels."""


def model_bytes(
    *, classes=CLASSES, form="errand-detector-1", names=None, output="scores", size=(480, 640), metadata=None
):
    """A network that reads its answer from the picture's first two rows (red): scores, then boxes."""
    nodes = [
        helper.make_node("Gather", ["images", "red"], ["plane"], axis=3),
        *_read_row("scores", "per_score", output),
        *_read_row("boxes", "step", "boxes"),
    ]
    constants = {
        "red": np.array(0, np.int64),
        "per_score": np.array(1 / 250, np.float32),
        "step": np.array(STEP_PX, np.float32),
        **_rows("scores", 0, ANCHORS * len(classes), [0, ANCHORS, len(classes)]),
        **_rows("boxes", 1, ANCHORS * 4, [0, ANCHORS, 4]),
    }
    graph = helper.make_graph(
        nodes,
        "tiny",
        [helper.make_tensor_value_info("images", TensorProto.UINT8, ["N", *size, 3])],
        [
            helper.make_tensor_value_info("boxes", TensorProto.FLOAT, ["N", ANCHORS, 4]),
            helper.make_tensor_value_info(output, TensorProto.FLOAT, ["N", ANCHORS, len(classes)]),
        ],
        [numpy_helper.from_array(value, name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    told = {"format": form, "class_names": json.dumps(list(classes)) if names is None else names}
    helper.set_model_props(model, told if metadata is None else metadata)
    onnx.checker.check_model(model)
    return model.SerializeToString()


def _read_row(name, factor, output):
    """Nodes that make an output of the first bytes of a row."""
    return [
        helper.make_node("Slice", ["plane", f"{name}_from", f"{name}_to", f"{name}_axes"], [f"{name}_bytes"]),
        helper.make_node("Cast", [f"{name}_bytes"], [f"{name}_float"], to=TensorProto.FLOAT),
        helper.make_node("Mul", [f"{name}_float", factor], [f"{name}_scaled"]),
        helper.make_node("Reshape", [f"{name}_scaled", f"{name}_shape"], [output]),
    ]


def _rows(name, row, length, shape):
    return {
        f"{name}_from": np.array([row, 0], np.int64),
        f"{name}_to": np.array([row + 1, length], np.int64),
        f"{name}_axes": np.array([1, 2], np.int64),
        f"{name}_shape": np.array(shape, np.int64),
    }


def write_model(file, **changes):
    """Such a network in a file."""
    file.write_bytes(model_bytes(**changes))
    return file


def picture_of(*things, size=(480, 640), classes=CLASSES):
    """A picture (480, 640, 3) in which that network sees things: (class, score, (u0, v0, u1, v1)).

    Scores come in steps of 1/250, boxes in steps of 2.5 pixels.
    """
    picture = np.zeros((*size, 3), dtype=np.uint8)
    for k, (name, score, box) in enumerate(things):
        picture[0, k * len(classes) + classes.index(name), 0] = round(score * 250)
        picture[1, 4 * k : 4 * k + 4, 0] = [round(value / STEP_PX) for value in box]
    return picture


def refinement_bytes(
    first, *, classes=CLASSES, form="errand-regions-1", key="first", told=None, size=128, left_only=False
):
    """A refinement network: boxes a tenth smaller than the regions; the first class's score is the share of red.

    It tells as `key` the digest of the file of the one before it.

    With `left_only` it looks at the left half of the crop alone.
    """
    rows = ["N", len(classes)]
    nodes = [
        helper.make_node("Slice", ["chips", "from", "to", "columns"], ["part"]),
        helper.make_node("Cast", ["part"], ["values"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMean", ["values"], ["means"], axes=[1, 2], keepdims=0),
        helper.make_node("MatMul", ["means", "red"], ["seen"]),
        helper.make_node("Mul", ["logits", "nothing"], ["unheard"]),
        helper.make_node("Add", ["seen", "unheard"], ["scores"]),
        helper.make_node("MatMul", ["regions", "smaller"], ["boxes"]),
    ]
    red = np.zeros((3, len(classes)), np.float32)
    red[0, 0] = 1 / 255
    keep, take = np.eye(4), np.eye(4)[[2, 3, 0, 1]]
    constants = {
        "from": np.array([0], np.int64),
        "to": np.array([size // 2 if left_only else size], np.int64),
        "columns": np.array([2], np.int64),
        "red": red,
        "nothing": np.array(0.0, np.float32),
        "smaller": (0.95 * keep + 0.05 * take).astype(np.float32),
    }
    graph = helper.make_graph(
        nodes,
        "tiny second",
        [
            helper.make_tensor_value_info("chips", TensorProto.UINT8, ["N", size, size, 3]),
            helper.make_tensor_value_info("regions", TensorProto.FLOAT, ["N", 4]),
            helper.make_tensor_value_info("logits", TensorProto.FLOAT, rows),
        ],
        [
            helper.make_tensor_value_info("boxes", TensorProto.FLOAT, ["N", 4]),
            helper.make_tensor_value_info("scores", TensorProto.FLOAT, rows),
        ],
        [numpy_helper.from_array(value, name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    belongs = hashlib.sha256(first).hexdigest() if told is None else told
    helper.set_model_props(model, {"format": form, "class_names": json.dumps(list(classes)), key: belongs})
    onnx.checker.check_model(model)
    return model.SerializeToString()


def write_pair(file, **changes):
    """Both networks, beside each other; `changes` are the refinement network's."""
    write_model(file)
    file.with_name(f"{file.stem}_refinement.onnx").write_bytes(refinement_bytes(file.read_bytes(), **changes))
    return file


def classifier_bytes(second, **changes):
    """A classifier network that sees and tells what such a second one does."""
    return refinement_bytes(second, **{"form": "errand-third-1", "key": "second", **changes})


def write_cascade(file, **changes):
    """All three networks, beside each other; `changes` are the classifier network's."""
    second = write_pair(file).with_name(f"{file.stem}_refinement.onnx")
    file.with_name(f"{file.stem}_classifier.onnx").write_bytes(classifier_bytes(second.read_bytes(), **changes))
    return file
