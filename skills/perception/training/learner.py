"""The state of learning: network, its running mean, optimiser, and how far it has come; and one step of it."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

import torch
from torch import nn

from skills.perception.training.averaging import WeightAverage
from skills.perception.training.batches import Batch
from skills.perception.training.export import fused
from skills.perception.training.labels import TrainingDataError
from skills.perception.training.losses import Losses, LossOptions, TruthBatch, losses
from skills.perception.training.muon import Muon
from skills.perception.training.network import DetectorNetwork, EarlyLayers, cells
from skills.perception.training.onnx_weights import take_over
from skills.perception.training.workers import Workers

__all__ = ["Learner", "LearningState", "Progress", "optimisers_of", "read_checkpoint", "without_learning_early"]

FORMAT = 1
ONNX = ".onnx"
_LONGEST_STEP = 10.0
_WITHOUT = "begin anew without it"
Network = TypeVar("Network", bound=nn.Module)
Early = TypeVar("Early", bound=EarlyLayers)


@dataclass
class Progress:
    """How many steps, canvases and seconds of learning there were."""

    steps: int = 0
    taken: int = 0
    seconds: float = 0.0


@dataclass
class LearningState(Generic[Network]):
    """All that changes while learning, whatever the network."""

    network: Network
    average: WeightAverage
    optimisers: tuple[torch.optim.Optimizer, ...]
    device: torch.device
    progress: Progress = field(default_factory=Progress)

    def take_step(
        self, losses_now: Callable[[], Losses], rate: float, workers: Workers, clock: float
    ) -> tuple[float, float, float]:
        """Learn from what `losses_now` says: score loss, box loss, and the first process's clock."""
        for optimiser in self.optimisers:
            for group in optimiser.param_groups:
                group["lr"] = rate
        self.network.train()
        found = losses_now()
        self.network.zero_grad(set_to_none=True)
        found.total.backward()
        clock = workers.mean_gradients(self.network, clock)
        nn.utils.clip_grad_norm_(self.network.parameters(), _LONGEST_STEP)
        for optimiser in self.optimisers:
            optimiser.step()
        self.average.follow(self.network)
        return float(found.scores.detach()), float(found.boxes.detach()), clock

    def quick(self) -> torch.autocast:
        """Within it the network computes in 16 bits, where that saves time."""
        return torch.autocast(self.device.type, torch.bfloat16, enabled=quick_in_bfloat16(self.device))

    def save(self, file: Path) -> None:
        """Write everything; whole or not at all."""
        state = {
            "format": FORMAT,
            "network": self.network.state_dict(),
            "average": self.average.state(),
            "optimisers": [optimiser.state_dict() for optimiser in self.optimisers],
            "progress": vars(self.progress),
        }
        fresh = file.with_name(f".{file.name}.new")
        torch.save(state, fresh)
        fresh.replace(file)

    def restore(self, file: Path) -> None:
        """Go on where a file left off. Raises TrainingDataError."""
        state = read_checkpoint(file)
        self._take(state["network"], file)
        self.average.restore(state["average"])
        for optimiser, kept in zip(self.optimisers, state["optimisers"], strict=True):
            optimiser.load_state_dict(kept)
        self.progress = Progress(**state["progress"])

    def start_from_checkpoint(self, file: Path) -> None:
        """Take over a checkpoint's averaged weights; all else begins anew. Raises TrainingDataError."""
        self._take(read_checkpoint(file)["average"]["network"], file)
        self.average.network.load_state_dict(self.network.state_dict())

    def _take(self, weights: Mapping[str, Any], file: Path) -> None:
        try:
            self.network.load_state_dict(weights)
        except RuntimeError as error:
            raise TrainingDataError(f"{file}: is a checkpoint of another network", mend=_WITHOUT) from error


@dataclass
class Learner(LearningState[DetectorNetwork]):
    """All that changes while the proposal network learns."""

    loss: LossOptions = field(default_factory=LossOptions)

    @staticmethod
    def new(classes: int, seed: int, device: torch.device) -> Learner:
        """A network that has learnt nothing yet."""
        torch.manual_seed(seed)
        network = DetectorNetwork(classes).to(device, memory_format=torch.channels_last)
        last = [layer for head in network.heads for layer in (head.scores, head.sides)]
        return Learner(network, WeightAverage(network), optimisers_of(network, last), device)

    def step(self, batch: Batch, rate: float, workers: Workers, clock: float) -> tuple[float, float, float]:
        """Learn from one batch: score loss, box loss, and the first process's clock."""
        return self.take_step(lambda: self._losses(batch), rate, workers, clock)

    def _losses(self, batch: Batch) -> Losses:
        with self.quick():
            logits, boxes = self.network(batch.pictures.to(self.device))
        middles = cells(batch.pictures.shape[2], batch.pictures.shape[3])[0].to(self.device)
        return losses(logits, boxes, middles, _moved(batch.truth, self.device), self.loss)

    def start_from(self, file: Path) -> None:
        """Take over the weights of an ONNX file, or a checkpoint's averaged ones; all else begins anew.

        Those of an ONNX file are still to be settled. Raises TrainingDataError.
        """
        if file.suffix == ONNX:
            take_over(self.network, file)
            self.average.network.load_state_dict(self.network.state_dict())
        else:
            self.start_from_checkpoint(file)


def without_learning_early(backbone: Early, average: Early, device: torch.device) -> Early:
    """Learn a backbone's layers up to stride 8 no longer; the averaged one, without normalisation, to use for them."""
    for part in (backbone.stem, backbone.stage8):
        part.requires_grad_(False)
    made: Early = fused(average).requires_grad_(False).to(device, memory_format=torch.channels_last)
    return made


def optimisers_of(network: nn.Module, last: Iterable[nn.Module]) -> tuple[torch.optim.Optimizer, ...]:
    """Muon for the weights of convolutions, AdamW (Loshchilov and Hutter, 2019) for the rest and the `last` layers."""
    left_out = {id(weight) for layer in last for weight in layer.parameters()}
    weights = [weight for weight in network.parameters() if weight.ndim == 4 and id(weight) not in left_out]
    chosen = {id(weight) for weight in weights}
    others = [weight for weight in network.parameters() if id(weight) not in chosen]
    return Muon(weights, lr=1e-3), torch.optim.AdamW(others, lr=1e-3, betas=(0.9, 0.99), weight_decay=0.0)


def quick_in_bfloat16(device: torch.device) -> bool:
    """Whether bfloat16 saves time: on processors without it, it costs twice as much."""
    capabilities = torch.cpu.get_capabilities()
    return device.type != "cpu" or any(capabilities.get(name, False) for name in ("amx_bf16", "avx512_bf16"))


def _moved(truth: TruthBatch, device: torch.device) -> TruthBatch:
    return TruthBatch(*(part.to(device) for part in (truth.boxes, truth.classes, truth.ignored, truth.present)))


def read_checkpoint(file: Path) -> dict[str, Any]:
    """The state in a file. Raises TrainingDataError."""
    mend = _WITHOUT
    try:
        state = torch.load(file, map_location="cpu", weights_only=True)
    except (OSError, RuntimeError, ValueError, EOFError, pickle.UnpicklingError) as error:
        reason = (str(error).splitlines() or ["empty"])[0]
        raise TrainingDataError(f"{file}: is no checkpoint that can be read ({reason})", mend=mend) from error
    if not isinstance(state, dict) or state.get("format") != FORMAT:
        raise TrainingDataError(f"{file}: is a checkpoint of another version", mend=mend)
    return state
