"""Start of a training from a network's ONNX file, in which normalisation is folded into the layers before it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from torch import Tensor, nn

from errand_train.detector.classifier_network import USED, ClassifierNetwork
from errand_train.detector.export import normalised_layers
from errand_train.detector.labels import TrainingDataError
from errand_train.detector.network import Backbone, CascadeNetwork
from errand_train.detector.onnx_files import offsets_in, trained_weights
from skills.perception.detector.model_files import ModelFileError, load_network

_BEFORE = "network."
_BYTES = 255.0
_HINT = "start again without it"


@torch.no_grad()
def take_over(network: CascadeNetwork, file: Path) -> None:
    """Loads the weights of an ONNX file into a network, whose output is then equal but for the score offsets.

    Until `settle`, every normalisation passes its input on and adds the file's bias. A crop network's file may belong
    to any network before it. Raises TrainingDataError.
    """
    try:
        source = load_network(file, network.kind)
    except ModelFileError as error:
        raise TrainingDataError(f"{file}: {error.message}", hint=_HINT) from error
    kept, left = _content(file), dict(network.named_parameters())
    offsets = offsets_in(source.metadata, len(source.class_names))
    try:
        for name, unit in normalised_layers(network):
            _fill(unit[0].weight, kept[f"{name}.0.weight"])
            _pass_on(unit[1], kept[f"{name}.0.bias"])
            for part in ("0.weight", "1.weight", "1.bias"):
                del left[f"{name}.{part}"]
        for name, weight in left.items():
            _fill(weight, kept[name])
        for bias in network.score_biases:
            bias.sub_(torch.tensor(offsets))
    except (KeyError, ValueError) as error:
        raise TrainingDataError(f"{file}: holds another network ({error})", hint=_HINT) from error
    if isinstance(network.early_layers, Backbone):  # it takes values from 0 to 1 again, instead of bytes
        network.early_layers.stem[0][0].weight.mul_(_BYTES)
    if isinstance(network, ClassifierNetwork):
        network.add(1.0 / USED)


def _content(file: Path) -> dict[str, Tensor]:
    """Weights by the names that they have in the network."""
    kept = trained_weights(onnx.load(file)).items()
    return {name.removeprefix(_BEFORE): torch.tensor(values.astype(np.float32)) for name, values in kept}


def _fill(weight: Tensor, value: Tensor) -> None:
    if weight.shape != value.shape:
        raise ValueError(f"{tuple(value.shape)} numbers where there should be {tuple(weight.shape)}")
    weight.copy_(value)


def _pass_on(normalisation: nn.BatchNorm1d | nn.BatchNorm2d, bias: Tensor) -> None:
    assert normalisation.running_mean is not None
    assert normalisation.running_var is not None
    normalisation.running_mean.zero_()
    normalisation.running_var.fill_(1.0 - normalisation.eps)
    normalisation.weight.fill_(1.0)
    _fill(normalisation.bias, bias)


@torch.no_grad()
def settle(network: nn.Module, batches: Iterable[tuple[Tensor, ...]]) -> None:
    """Gives each normalisation the statistics of batches of inputs, and each filter the length 1.

    Follows `take_over`, and does not change the network's output. Without it, training would begin by forgetting, since
    it normalises by the batch.
    """
    units = [unit for _, unit in normalised_layers(network)]
    sums = {unit: torch.zeros(3, unit[1].num_features, dtype=torch.float64) for unit in units}

    def note(layer: nn.Module, _given: Any, made: Tensor) -> None:
        values = made.double().flatten(2) if made.ndim > 2 else made.double()[..., None]
        count = torch.full((values.shape[1],), float(values.numel() // values.shape[1]), dtype=torch.float64)
        sums[of[layer]] += torch.stack([count, values.sum(dim=(0, 2)), values.square().sum(dim=(0, 2))])

    of = {unit[0]: unit for unit in units}
    handles = [unit[0].register_forward_hook(note) for unit in units]
    network.eval()
    for batch in batches:
        network(*batch)
    for handle in handles:
        handle.remove()
    for unit, (count, total, squares) in sums.items():
        mean = total / count
        _normalise(unit[0], unit[1], mean, squares / count - mean.square())


def _normalise(
    layer: nn.Conv2d | nn.Linear, normalisation: nn.BatchNorm1d | nn.BatchNorm2d, mean: Tensor, variance: Tensor
) -> None:
    """Statistics of a layer's output, and all else such that nothing changes: so far it added a bias only."""
    assert normalisation.running_mean is not None
    assert normalisation.running_var is not None
    lengths = layer.weight.flatten(1).norm(dim=1).clamp(min=1e-6)
    layer.weight.div_(lengths.reshape(-1, *[1] * (layer.weight.ndim - 1)))
    mean, variance = mean.float() / lengths, variance.float() / lengths.square()
    normalisation.running_mean.copy_(mean)
    normalisation.running_var.copy_(variance)
    normalisation.weight.copy_(lengths * torch.sqrt(variance + normalisation.eps))
    normalisation.bias.add_(lengths * mean)
