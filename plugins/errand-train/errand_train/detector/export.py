"""Export of networks as ONNX files from pictures or crops in bytes to boxes and scores."""

from __future__ import annotations

import copy
import json
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import onnx
import torch
from torch import Tensor, nn

from errand_train.detector.network import CascadeNetwork
from errand_train.detector.onnx_files import write_sealed

_OPSET = 17
_KINDS = {"uint8": torch.uint8, "float": torch.float32}
Network = TypeVar("Network", bound=nn.Module)


class Exportable(nn.Module):
    """Network from pictures or crops (N, H, W, 3) in bytes, and its other inputs, to boxes and scores.

    `score_offsets` are added to the logits of each class.
    """

    def __init__(self, network: CascadeNetwork, score_offsets: Sequence[float] | None = None) -> None:
        super().__init__()
        self.network = fuse(network)
        self.network.stop_learning()
        self.network.early_layers.take_bytes()
        with torch.no_grad():
            for bias in self.network.score_biases if score_offsets is not None else ():
                bias.add_(torch.tensor(score_offsets))

    def forward(self, images: Tensor, *known: Tensor) -> tuple[Tensor, Tensor]:
        """Computes boxes and scores."""
        logits, boxes = self.network(images.permute(0, 3, 1, 2).float(), *known)
        return boxes, logits.sigmoid()


def fuse(network: Network) -> Network:
    """Copies a network for inference, with every normalisation folded into the layer before it."""
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
    network: CascadeNetwork,
    file: Path,
    *,
    class_names: Sequence[str],
    facts: Mapping[str, str],
    score_offsets: Sequence[float] | None = None,
) -> None:
    """Writes the ONNX file with its format, class names and other facts; whole or not at all.

    `facts` of a crop network must hold the digest of the file of the network before it: as `first` that of the proposal
    network, as `second` that of the refinement network. `score_offsets` are added to the logits of each class.
    """
    model = Exportable(network, score_offsets).eval()
    inputs = network.kind.inputs(len(class_names)).items()
    example = {name: torch.zeros((2, *shape), dtype=_KINDS[of]) for name, (of, shape) in inputs}
    with torch.no_grad():
        shapes = [tuple(output.shape) for output in model(*example.values())]
    with tempfile.TemporaryDirectory() as folder:
        raw = Path(folder) / "raw.onnx"
        _trace(model, example, raw)
        traced = onnx.load(raw)
    for port, sizes in zip(traced.graph.output, shapes, strict=True):
        for axis, size in enumerate(sizes[1:], start=1):
            port.type.tensor_type.shape.dim[axis].dim_value = size
    traced.producer_name, traced.producer_version = "errand", ""
    onnx.checker.check_model(traced)
    write_sealed(traced, file, {"format": network.kind.format, "class_names": json.dumps(list(class_names)), **facts})


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
