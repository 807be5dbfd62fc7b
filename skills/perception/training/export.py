"""Networks as ONNX files that take pictures or crops as bytes and give boxes and scores in their pixels."""

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

from skills.perception.detector.cascade_files import FORMAT
from skills.perception.detector.letterbox import HEIGHT_PX, WIDTH_PX
from skills.perception.detector.proposals import CROP_PX
from skills.perception.training.crop_network import CropNetwork
from skills.perception.training.network import DetectorNetwork
from skills.perception.training.onnx_files import write_sealed

_OPSET = 17
Network = TypeVar("Network", bound=nn.Module)


class Exportable(nn.Module):
    """Pictures (N, 480, 640, 3) of bytes to boxes (N, A, 4) and scores (N, A, K)."""

    def __init__(self, network: DetectorNetwork, score_offsets: Sequence[float] | None = None) -> None:
        super().__init__()
        self.network = fused(network)
        if score_offsets is not None:
            _shift(self.network, score_offsets)
        self.network.backbone.take_bytes()

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Boxes and scores. The first convolution takes values from 0 to 255, its weights being so much smaller."""
        logits, boxes = self.network(images.permute(0, 3, 1, 2).float())
        return boxes, logits.sigmoid()


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


class ExportableCrops(nn.Module):
    """Crops (N, 128, 128, 3) of bytes, regions (N, 4) in them and logits (N, K) to boxes (N, 4) and scores."""

    def __init__(self, network: CropNetwork, score_offsets: Sequence[float] | None = None) -> None:
        super().__init__()
        self.network = fused(network)
        self.network.stop_learning()
        self.network.take_bytes()
        if score_offsets is not None:
            with torch.no_grad():
                self.network.scores.bias.add_(torch.tensor(score_offsets))

    def forward(self, crops: Tensor, regions: Tensor, logits: Tensor) -> tuple[Tensor, Tensor]:
        """Boxes and scores."""
        found, boxes = self.network(crops.permute(0, 3, 1, 2).float(), regions, logits)
        return boxes, found.sigmoid()


def export_crops(
    network: CropNetwork,
    file: Path,
    *,
    form: str,
    class_names: Sequence[str],
    facts: Mapping[str, str],
    score_offsets: Sequence[float] | None = None,
) -> None:
    """Write the ONNX file of a crop network in a format; whole or not at all.

    `score_offsets` are added to the logits of each class. `facts` must hold the digest of the file of the network
    before it: as `first` that of the proposal network, as `second` that of the refinement network.
    """
    model = ExportableCrops(network, score_offsets).eval()
    example = {
        "chips": torch.zeros((2, CROP_PX, CROP_PX, 3), dtype=torch.uint8),
        "regions": torch.full((2, 4), float(CROP_PX)) * torch.tensor([0.2, 0.2, 0.8, 0.8]),
        "logits": torch.zeros((2, len(class_names))),
    }
    facts = {"format": form, "class_names": json.dumps(list(class_names)), **facts}
    write_onnx(model, example, file, facts)


def write_onnx(model: nn.Module, example: Mapping[str, Tensor], file: Path, facts: Mapping[str, str]) -> None:
    """Write the ONNX file of a model that makes boxes and scores, each of N rows, of inputs by name of N rows."""
    with torch.no_grad():
        shapes = [tuple(output.shape) for output in model(*example.values())]
    with tempfile.TemporaryDirectory() as folder:
        raw = Path(folder) / "raw.onnx"
        _trace(model, example, raw)
        traced = onnx.load(raw)
    _size_outputs(traced, shapes)
    traced.producer_name, traced.producer_version = "errand", ""
    onnx.checker.check_model(traced)
    write_sealed(traced, file, facts)


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
