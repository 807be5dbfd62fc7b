"""Learning goes on from a detector's ONNX file, in which normalisation is part of the convolutions already."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from torch import Tensor, nn

from skills.detect.detector_file import load_model
from skills.detect.network_file import ModelFileError
from skills.detect.training.labels import TrainingDataError
from skills.detect.training.network import DetectorNetwork

__all__ = ["settle", "take_over"]

_BEFORE = "network."
_BYTES = 255.0


@torch.no_grad()
def take_over(network: DetectorNetwork, file: Path) -> None:
    """Give a network the weights of an ONNX file; it says the same then, but for the shift of the scores.

    Every normalisation passes on what it gets and adds the file's bias, until `settle`. Raises TrainingDataError.
    """
    kept, offsets = _content(file)
    try:
        for name, module in network.named_modules():
            if isinstance(module, nn.Sequential) and _normalised(module):
                _fill(module[0].weight, kept[f"{name}.0.weight"])
                _pass_on(module[1], torch.from_numpy(kept[f"{name}.0.bias"]))
            elif isinstance(module, nn.Conv2d) and module.bias is not None:
                _fill(module.weight, kept[f"{name}.weight"])
                _fill(module.bias, kept[f"{name}.bias"])
        for head in network.heads:
            head.scores.bias.sub_(torch.tensor(offsets))
    except (KeyError, ValueError) as error:
        raise TrainingDataError(f"{file}: holds another network ({error})", mend="begin anew without it") from error
    network.backbone.stem[0][0].weight.mul_(_BYTES)


def _content(file: Path) -> tuple[dict[str, Any], list[float]]:
    """Arrays by the names that they have in the network, and by how much each class's score was shifted."""
    try:
        classes = len(load_model(file, second=False).class_names)
    except ModelFileError as error:
        raise TrainingDataError(f"{file}: {error.message}", mend="begin anew without it") from error
    model = onnx.load(file)
    arrays = {
        one.name.removeprefix(_BEFORE): np.array(onnx.numpy_helper.to_array(one)) for one in model.graph.initializer
    }
    told = {entry.key: entry.value for entry in model.metadata_props}
    return arrays, json.loads(told.get("score_offsets", json.dumps([0.0] * classes)))


def _fill(weight: Tensor, value: Any) -> None:
    if tuple(weight.shape) != value.shape:
        raise ValueError(f"{tuple(value.shape)} numbers where there should be {tuple(weight.shape)}")
    weight.copy_(torch.from_numpy(value))


def _pass_on(normalisation: nn.BatchNorm2d, bias: Tensor) -> None:
    normalisation.running_mean.zero_()
    normalisation.running_var.fill_(1.0 - normalisation.eps)
    normalisation.weight.fill_(1.0)
    normalisation.bias.copy_(bias)


@torch.no_grad()
def settle(network: DetectorNetwork, batches: Iterable[Tensor]) -> None:
    """Give each normalisation the statistics of batches (N, 3, H, W) and each filter the length 1, after `take_over`.

    What the network says stays the same. Without it, learning would begin by forgetting: it normalises by the batch.
    """
    units = [one for one in network.modules() if isinstance(one, nn.Sequential) and _normalised(one)]
    sums = {unit: torch.zeros(3, unit[1].num_features, dtype=torch.float64) for unit in units}

    def note(convolution: nn.Module, _given: Any, made: Tensor) -> None:
        values = made.double()
        count = torch.full((values.shape[1],), float(values.numel() // values.shape[1]), dtype=torch.float64)
        sums[of[convolution]] += torch.stack([count, values.sum(dim=(0, 2, 3)), values.square().sum(dim=(0, 2, 3))])

    of = {unit[0]: unit for unit in units}
    handles = [unit[0].register_forward_hook(note) for unit in units]
    network.eval()
    for batch in batches:
        network(batch)
    for handle in handles:
        handle.remove()
    for unit, (count, total, squares) in sums.items():
        mean = total / count
        _normalise(unit[0], unit[1], mean, squares / count - mean.square())


def _normalised(unit: nn.Sequential) -> bool:
    return len(unit) >= 2 and isinstance(unit[1], nn.BatchNorm2d)


def _normalise(convolution: nn.Conv2d, normalisation: nn.BatchNorm2d, mean: Tensor, variance: Tensor) -> None:
    """Statistics of a convolution's output, and all else such that nothing changes: so far it added a bias only."""
    lengths = convolution.weight.flatten(1).norm(dim=1).clamp(min=1e-6)
    convolution.weight.div_(lengths[:, None, None, None])
    mean, variance = mean.float() / lengths, variance.float() / lengths.square()
    normalisation.running_mean.copy_(mean)
    normalisation.running_var.copy_(variance)
    normalisation.weight.copy_(lengths * torch.sqrt(variance + normalisation.eps))
    normalisation.bias.add_(lengths * mean)
