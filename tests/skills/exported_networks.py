"""Small ONNX files in the layouts that other tools export; their outputs are constants or read from the picture."""

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

_TYPES = {"float32": TensorProto.FLOAT, "float16": TensorProto.FLOAT16, "uint8": TensorProto.UINT8}


def export(file, outputs, *, shape=(1, 3, 64, 64), dtype="float32", metadata=None, sizes=None):
    """A network that gives constants `outputs` by name, whatever picture of this shape it gets.

    `sizes`: name of a second input, by which the output `boxes` is multiplied.
    """
    inputs, nodes, infos = [helper.make_tensor_value_info("images", _TYPES[dtype], shape)], [], []
    if sizes is not None:
        inputs.append(helper.make_tensor_value_info(sizes, TensorProto.INT64, [shape[0], 2]))
        nodes.append(helper.make_node("Cast", [sizes], ["sides"], to=TensorProto.FLOAT))
        nodes.append(helper.make_node("Concat", ["sides", "sides"], ["twice"], axis=1))
    for name, value in outputs.items():
        scaled = sizes is not None and name == "boxes"
        nodes.append(
            helper.make_node(*(("Mul", ["_boxes", "twice"]) if scaled else ("Identity", [f"_{name}"])), [name])
        )
        infos.append(helper.make_tensor_value_info(name, helper.np_dtype_to_tensor_dtype(value.dtype), value.shape))
    constants = [numpy_helper.from_array(value, f"_{name}") for name, value in outputs.items()]
    return save(file, helper.make_graph(nodes, "constant", inputs, infos, constants), metadata)


def save(file, graph, metadata=None):
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    helper.set_model_props(model, metadata or {})
    onnx.checker.check_model(model)
    file.write_bytes(model.SerializeToString())
    return file


def mean_colour(file, *, size=64, metadata=None):
    """A network in YOLO's layout whose three scores of one box are the means of the input's channels."""
    nodes = [
        helper.make_node("ReduceMean", ["images"], ["means"], axes=[2, 3], keepdims=0),
        helper.make_node("Reshape", ["means", "column"], ["scores"]),
        helper.make_node("Concat", ["box", "scores"], ["output0"], axis=1),
    ]
    constants = {"box": np.array([[[32], [32], [20], [20]]], np.float32), "column": np.array([1, 3, 1], np.int64)}
    graph = helper.make_graph(
        nodes,
        "mean colour",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, size, size])],
        [helper.make_tensor_value_info("output0", TensorProto.FLOAT, [1, 7, 1])],
        [numpy_helper.from_array(value, name) for name, value in constants.items()],
    )
    return save(file, graph, metadata or {"names": "{0: 'red', 1: 'green', 2: 'blue'}"})


def coloured_patch(file, colour, *, tolerance=0.02, size=640, names="{0: 'can'}"):
    """A network in the layout of YOLO26, which finds the bounding box of all pixels of a colour.

    `tolerance`: greatest difference of a channel, from 0 to 1.
    """
    steps = [
        ("Sub", ["images", "colour"], "difference", {}),
        ("Abs", ["difference"], "distance", {}),
        ("ReduceMax", ["distance"], "farthest", {"axes": [1], "keepdims": 0}),
        ("Less", ["farthest", "tolerance"], "alike", {}),
        ("Cast", ["alike"], "mask", {"to": TensorProto.FLOAT}),
    ]
    for name, axis in (("u", 1), ("v", 2)):
        steps += [
            ("ReduceMax", ["mask"], f"{name}_any", {"axes": [axis], "keepdims": 0}),
            ("Mul", [f"{name}_any", "ends"], f"{name}_ends", {}),
            ("ReduceMax", [f"{name}_ends"], f"{name}1", {"axes": [1]}),
            ("Mul", [f"{name}_any", "backwards"], f"{name}_begins", {}),
            ("ReduceMax", [f"{name}_begins"], f"{name}_most", {"axes": [1]}),
            ("Sub", ["size", f"{name}_most"], f"{name}0", {}),
        ]
    steps += [
        ("ReduceMax", ["u_any"], "found", {"axes": [1]}),
        ("Mul", ["found", "sure"], "score", {}),
        ("Concat", ["u0", "v0", "u1", "v1", "score", "label"], "row", {"axis": 1}),
        ("Reshape", ["row", "shape"], "output0", {}),
    ]
    constants = {
        "colour": np.array(colour, np.float32).reshape(1, 3, 1, 1) / 255,
        "tolerance": np.float32(tolerance),
        "ends": np.arange(1, size + 1, dtype=np.float32)[None],
        "backwards": np.arange(size, 0, -1, dtype=np.float32)[None],
        "size": np.float32([[size]]),
        "sure": np.float32(0.9),
        "label": np.zeros((1, 1), np.float32),
        "shape": np.array([1, 1, 6], np.int64),
    }
    graph = helper.make_graph(
        [helper.make_node(kind, inputs, [output], **options) for kind, inputs, output, options in steps],
        "patch",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, size, size])],
        [helper.make_tensor_value_info("output0", TensorProto.FLOAT, [1, 1, 6])],
        [numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()],
    )
    return save(file, graph, {"names": names, "task": "detect"})
