"""The network as an ONNX file that takes pictures as bytes and gives boxes and scores in the letterbox's pixels."""

from __future__ import annotations

import copy
import json
import math
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np
import onnx
import torch
from torch import Tensor, nn

from skills.detect.detector_file import FORMAT
from skills.detect.letterbox import HEIGHT_PX, WIDTH_PX
from skills.detect.network_file import sealed
from skills.detect.training.network import Backbone, DetectorNetwork

__all__ = ["Exportable", "export", "fused", "in_full", "normalised_layers", "take_bytes", "write_onnx", "write_sealed"]

_OPSET = 17
_LARGE = 256
_SHORT = ".short"
Network = TypeVar("Network", bound=nn.Module)


class Exportable(nn.Module):
    """Pictures (N, 480, 640, 3) of bytes to boxes (N, A, 4) and scores (N, A, K)."""

    def __init__(self, network: DetectorNetwork, score_offsets: Sequence[float] | None = None) -> None:
        super().__init__()
        self.network = fused(network)
        if score_offsets is not None:
            _shift(self.network, score_offsets)
        take_bytes(self.network.backbone)

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Boxes and scores. The first convolution takes values from 0 to 255, its weights being so much smaller."""
        logits, boxes = self.network(images.permute(0, 3, 1, 2).float())
        return boxes, logits.sigmoid()


@torch.no_grad()
def take_bytes(backbone: Backbone) -> None:
    """Let the first convolution take values from 0 to 255."""
    backbone.stem[0][0].weight.mul_(1.0 / 255.0)


@torch.no_grad()
def _shift(network: DetectorNetwork, offsets: Sequence[float]) -> None:
    for head in network.heads:
        head.scores.bias.add_(torch.tensor(offsets))


def fused(network: Network) -> Network:
    """A copy for use only, with every normalisation taken into the layer before it."""
    made: Network = copy.deepcopy(network).cpu().float().eval()
    for _, unit in normalised_layers(made):
        layer, normalisation = unit[0], unit[1]
        if isinstance(layer, nn.Conv2d):
            unit[0] = nn.utils.fusion.fuse_conv_bn_eval(layer, normalisation)
        else:
            unit[0] = nn.utils.fusion.fuse_linear_bn_eval(layer, normalisation)
        unit[1] = nn.Identity()
    return made


def normalised_layers(network: nn.Module) -> list[tuple[str, nn.Sequential]]:
    """Names and units of a network that begin with a layer and its normalisation."""
    return [
        (name, unit)
        for name, unit in network.named_modules()
        if isinstance(unit, nn.Sequential)
        and len(unit) >= 2
        and isinstance(unit[0], nn.Conv2d | nn.Linear)
        and isinstance(unit[1], nn.BatchNorm1d | nn.BatchNorm2d)
    ]


def export(
    network: DetectorNetwork,
    file: Path,
    *,
    class_names: Sequence[str],
    facts: Mapping[str, str],
    score_offsets: Sequence[float] | None = None,
) -> None:
    """Write the ONNX file with its format, class names and other facts; whole or not at all.

    `score_offsets` are added to the logits of each class.
    """
    model = Exportable(network, score_offsets).eval()
    example = {"images": torch.zeros((1, HEIGHT_PX, WIDTH_PX, 3), dtype=torch.uint8)}
    write_onnx(model, example, file, {"format": FORMAT, "class_names": json.dumps(list(class_names)), **facts})


def write_onnx(
    model: nn.Module, example: Mapping[str, Tensor], file: Path, facts: Mapping[str, str], *, compact: bool = False
) -> None:
    """Write the ONNX file of a model that makes boxes and scores, each of N rows, of inputs by name of N rows.

    A `compact` one holds its weights in 16 bits each, which become 32 when it is loaded.
    """
    with torch.no_grad():
        shapes = [tuple(output.shape) for output in model(*example.values())]
    with tempfile.TemporaryDirectory() as folder:
        raw = Path(folder) / "raw.onnx"
        _trace(model, example, raw)
        traced = onnx.load(raw)
    if compact:
        _keep_in_16_bits(traced.graph)
    _size_outputs(traced, shapes)
    _shorten_names(traced.graph)
    traced.producer_name, traced.producer_version = "errand", ""
    onnx.checker.check_model(traced)
    write_sealed(traced, file, facts)


def write_sealed(model: onnx.ModelProto, file: Path, facts: Mapping[str, str]) -> None:
    """Write a model's file with facts as its metadata; whole or not at all."""
    del model.metadata_props[:]
    for key, value in facts.items():
        model.metadata_props.add(key=key, value=value)
    fresh = file.with_name(f".{file.name}.new")
    fresh.write_bytes(sealed(model.SerializeToString(deterministic=True)))
    fresh.replace(file)


def _trace(model: nn.Module, example: Mapping[str, Tensor], file: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.onnx.export(
            model,
            tuple(example.values()),
            str(file),
            dynamo=False,
            opset_version=_OPSET,
            input_names=list(example),
            output_names=["boxes", "scores"],
            dynamic_axes={name: {0: "N"} for name in (*example, "boxes", "scores")},
        )


def _size_outputs(model: onnx.ModelProto, shapes: Sequence[Sequence[int]]) -> None:
    """Let a model tell the sizes of its outputs."""
    for port, sizes in zip(model.graph.output, shapes, strict=True):
        for axis, size in enumerate(sizes[1:], start=1):
            port.type.tensor_type.shape.dim[axis].dim_value = size


def _keep_in_16_bits(graph: onnx.GraphProto) -> None:
    """Halve the numbers of all larger weights, each made whole again by a node before all others."""
    large = [one for one in graph.initializer if one.data_type == onnx.TensorProto.FLOAT and _size(one) >= _LARGE]
    nodes = [onnx.helper.make_node("Cast", [_short(one)], [one.name], to=onnx.TensorProto.FLOAT) for one in large]
    for one in large:
        values = onnx.numpy_helper.to_array(one).astype(np.float16)
        one.CopyFrom(onnx.numpy_helper.from_array(values, _short(one)))
    nodes.extend(graph.node)
    del graph.node[:]
    graph.node.extend(nodes)


def _size(weights: onnx.TensorProto) -> int:
    return math.prod(weights.dims)


def _short(weights: onnx.TensorProto) -> str:
    return f"{weights.name}{_SHORT}"


def in_full(name: str) -> str:
    """The name that a weight has in the network, of that which it has in a compact file."""
    return name.removesuffix(_SHORT)


def _shorten_names(graph: onnx.GraphProto) -> None:
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
