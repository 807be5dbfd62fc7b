"""What is in networks' ONNX files, and how they are written. Needs no torch."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import onnx
from numpy.typing import NDArray

from skills.perception.detector.network_file import sealed

__all__ = [
    "OFFSETS",
    "QUANTISED",
    "compact",
    "facts_of",
    "in_full",
    "offsets_fact",
    "offsets_in",
    "shorten_names",
    "trained_weights",
    "with_float32_weights",
    "write_sealed",
]

QUANTISED: Final = "eight_bits"
"""What a file has among its metadata when its network is quantised."""
OFFSETS: Final = "score_offsets"
"""What it tells there of what was added to the logits of each class."""
_SEAL: Final = "sha256"
_TRAINED: Final = "network."
_SCALE: Final = "_scale"
_ZERO_POINT: Final = "_zero_point"
_QUANTISED: Final = "_quantized"
_LARGE: Final = 256
_SHORT: Final = ".short"


def write_sealed(model: onnx.ModelProto, file: Path, facts: Mapping[str, str]) -> None:
    """Write a model's file with facts as its metadata; whole or not at all."""
    del model.metadata_props[:]
    for key, value in facts.items():
        model.metadata_props.add(key=key, value=value)
    fresh = file.with_name(f".{file.name}.new")
    fresh.write_bytes(sealed(model.SerializeToString(deterministic=True)))
    fresh.replace(file)


def offsets_fact(offsets: Iterable[float]) -> dict[str, str]:
    """What a file tells of what was added to the logits of each class."""
    return {OFFSETS: json.dumps([round(float(value), 4) for value in offsets])}


def offsets_in(facts: Mapping[str, str], classes: int) -> list[float]:
    """What a file tells of it; zeros, where nothing was added."""
    return [float(value) for value in json.loads(facts[OFFSETS])] if OFFSETS in facts else [0.0] * classes


def facts_of(model: onnx.ModelProto) -> dict[str, str]:
    """What a model's file tells, but for what sealing adds."""
    return {entry.key: entry.value for entry in model.metadata_props if entry.key != _SEAL}


def trained_weights(model: onnx.ModelProto) -> dict[str, NDArray[np.floating]]:
    """What a network has trained, by the names that weights have in it; those of 8 bits as what they stand for."""
    kept = {in_full(one.name): onnx.numpy_helper.to_array(one) for one in model.graph.initializer}
    whole = {name.removesuffix(_QUANTISED): name for name in kept if name.endswith(_QUANTISED)}
    plain = (name for name in kept if not name.endswith((_SCALE, _ZERO_POINT, _QUANTISED)))
    trained = {name: kept[name] for name in plain} | {name: _dequantised(kept, name) for name in whole}
    return {name: values for name, values in trained.items() if name.startswith(_TRAINED)}


def _dequantised(kept: Mapping[str, NDArray[Any]], name: str) -> NDArray[np.floating]:
    """The weights (out, ...) of which each output's are whole numbers in steps of its own."""
    steps = kept[f"{name}{_QUANTISED}"].astype(np.float32)
    per_output = (-1, *[1] * (steps.ndim - 1))
    zero, scale = (kept[f"{name}{kind}"].astype(np.float32).reshape(per_output) for kind in (_ZERO_POINT, _SCALE))
    return np.asarray((steps - zero) * scale)


def in_full(name: str) -> str:
    """The name that a weight has in the network, of that which it has in a compact file."""
    return name.removesuffix(_SHORT)


def compact(graph: onnx.GraphProto) -> None:
    """Halve the numbers of all larger weights, each made whole again by a node before all others."""
    large = [one for one in graph.initializer if _is_compacted(one)]
    nodes = [onnx.helper.make_node("Cast", [_short(one)], [one.name], to=onnx.TensorProto.FLOAT) for one in large]
    for one in large:
        values = onnx.numpy_helper.to_array(one).astype(np.float16)
        one.CopyFrom(onnx.numpy_helper.from_array(values, _short(one)))
    nodes.extend(graph.node)
    _replace_nodes(graph, nodes)


def with_float32_weights(graph: onnx.GraphProto) -> None:
    """Make the weights of a compact graph whole, so that no node does."""
    halved = {one.name: one for one in graph.initializer if one.name.endswith(_SHORT)}
    whole = {node.output[0]: in_full(node.input[0]) for node in graph.node if node.input and node.input[0] in halved}
    for name, one in halved.items():
        values = onnx.numpy_helper.to_array(one).astype(np.float32)
        one.CopyFrom(onnx.numpy_helper.from_array(values, in_full(name)))
    _replace_nodes(graph, [node for node in graph.node if not (node.output and node.output[0] in whole)])
    for node in graph.node:
        node.input[:] = [whole.get(name, name) for name in node.input]


def shorten_names(graph: onnx.GraphProto) -> None:
    """Numbers in place of the long names of what is passed on within the network, and nodes without names."""
    kept = {port.name for port in graph.output}
    short: dict[str, str] = {}
    for node in graph.node:
        node.name = ""
        for name in (name for name in node.output if name not in kept):
            short[name] = f"v{len(short)}"
    for node in graph.node:
        for names in (node.input, node.output):
            names[:] = [short.get(name, name) for name in names]


def _replace_nodes(graph: onnx.GraphProto, nodes: list[onnx.NodeProto]) -> None:
    copies = [onnx.NodeProto.FromString(node.SerializeToString()) for node in nodes]
    del graph.node[:]
    graph.node.extend(copies)


def _is_compacted(weights: onnx.TensorProto) -> bool:
    of_floats = weights.data_type == onnx.TensorProto.FLOAT and not weights.name.endswith(_SCALE)
    return of_floats and math.prod(weights.dims) >= _LARGE


def _short(weights: onnx.TensorProto) -> str:
    return f"{weights.name}{_SHORT}"
