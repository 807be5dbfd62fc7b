"""State of a training: network, weight average, optimiser and progress; and one step, for each kind of network."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel

from errand_train.detector.assign import TruthBatch
from errand_train.detector.batches import Batch
from errand_train.detector.classifier_network import ClassifierNetwork
from errand_train.detector.crop_batches import CropBatch
from errand_train.detector.crop_network import CropNetwork
from errand_train.detector.export import fuse
from errand_train.detector.labels import TrainingDataError
from errand_train.detector.losses import Losses, crop_losses, losses
from errand_train.detector.network import CascadeNetwork, DetectorNetwork, EarlyLayers, cells
from errand_train.detector.onnx_weights import settle, take_over
from errand_train.detector.refinement_network import RefinementNetwork

FORMAT = 2
ONNX = ".onnx"
_LONGEST_STEP = 10.0
_AVERAGED_OVER, _SETTLES_IN = 0.998, 10
_WITHOUT = "start again without it"
Network = TypeVar("Network", bound=CascadeNetwork)


@dataclass
class Progress:
    """Steps, pictures and seconds of training so far."""

    steps: int = 0
    taken: int = 0
    seconds: float = 0.0


@dataclass
class Learner(Generic[Network]):
    """State of the training of any network. The average of its weights is exported."""

    network: Network
    device: torch.device
    progress: Progress = field(default_factory=Progress)

    def __post_init__(self) -> None:
        self.network.to(self.device, memory_format=torch.channels_last)
        self._average = AveragedModel(self.network, avg_fn=_followed, use_buffers=True).eval()
        self._optimiser = torch.optim.AdamW(self.network.parameters(), lr=1e-3, betas=(0.9, 0.99), weight_decay=0.01)

    @property
    def average(self) -> Network:
        """The network with the running mean of its weights (Polyak and Juditsky, 1992)."""
        made: Network = self._average.module
        return made

    def take_step(self, losses_now: Callable[[], Losses], rate: float) -> tuple[float, float]:
        """Takes a step along the gradients of `losses_now`; returns score loss and box loss."""
        for group in self._optimiser.param_groups:
            group["lr"] = rate
        self.network.train()
        found = losses_now()
        self._optimiser.zero_grad()
        found.total.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), _LONGEST_STEP)
        self._optimiser.step()
        self._average.update_parameters(self.network)
        return float(found.scores.detach()), float(found.boxes.detach())

    def quick(self) -> torch.autocast:
        """Context in which the network computes in bfloat16, where that saves time."""
        return torch.autocast(self.device.type, torch.bfloat16, enabled=quick_in_bfloat16(self.device))

    def to_device(self, *parts: Tensor) -> tuple[Tensor, ...]:
        """Moves the parts of a batch to the network's device."""
        return tuple(part.to(self.device) for part in parts)

    def begin_average(self) -> None:
        """Starts the average at the present weights."""
        self.average.load_state_dict(self.network.state_dict())

    def save(self, file: Path) -> None:
        """Writes a checkpoint, whole or not at all."""
        state = {
            "format": FORMAT,
            "network": self.network.state_dict(),
            "average": self._average.state_dict(),
            "optimiser": self._optimiser.state_dict(),
            "progress": vars(self.progress),
        }
        fresh = file.with_name(f".{file.name}.new")
        torch.save(state, fresh)
        fresh.replace(file)

    def restore(self, file: Path) -> None:
        """Continues from a checkpoint. Raises TrainingDataError."""
        state = read_checkpoint(file)
        _take(self.network, state["network"], file)
        _take(self._average, state["average"], file)
        self._optimiser.load_state_dict(state["optimiser"])
        self.progress = Progress(**state["progress"])

    def start_from(self, file: Path, batches: Iterable[Batch | CropBatch]) -> None:
        """Loads the weights of an ONNX file, with statistics of batches, or the averaged ones of a checkpoint.

        Everything else starts at zero. Raises TrainingDataError.
        """
        if file.suffix == ONNX:
            take_over(self.network, file)
            settle(self.network, (self.to_device(*batch.inputs) for batch in batches))
            self.begin_average()
        else:
            self.start_from_checkpoint(file)

    def start_from_checkpoint(self, file: Path) -> None:
        """Loads the averaged weights of a checkpoint; all else starts at zero. Raises TrainingDataError."""
        _take(self._average, read_checkpoint(file)["average"], file)
        self._average.n_averaged.zero_()
        self.network.load_state_dict(self.average.state_dict())


def _followed(average: Tensor, current: Tensor, steps: Tensor) -> Tensor:
    """The running mean: fast at first, slow later."""
    keep = min(_AVERAGED_OVER, float(steps) / (float(steps) + _SETTLES_IN))
    return average + (current - average) * (1.0 - keep)


def _take(network: nn.Module, weights: Mapping[str, Any], file: Path) -> None:
    try:
        network.load_state_dict(weights)
    except RuntimeError as error:
        raise TrainingDataError(f"{file}: is a checkpoint of another network", hint=_WITHOUT) from error


@dataclass
class ProposalLearner(Learner[DetectorNetwork]):
    """State of the training of the proposal network."""

    @staticmethod
    def new(classes: int, seed: int, device: torch.device) -> ProposalLearner:
        """Makes an untrained network."""
        torch.manual_seed(seed)
        return ProposalLearner(DetectorNetwork(classes), device)

    def step(self, batch: Batch, rate: float) -> tuple[float, float]:
        """Takes a step on one batch; returns score loss and box loss."""
        return self.take_step(lambda: self._losses(batch), rate)

    def _losses(self, batch: Batch) -> Losses:
        with self.quick():
            logits, boxes = self.network(batch.pictures.to(self.device))
        middles = cells(batch.pictures.shape[2], batch.pictures.shape[3])[0].to(self.device)
        truth = TruthBatch(*self.to_device(*vars(batch.truth).values()))
        return losses(logits, boxes, middles, truth)


@dataclass
class CropLearner(Learner[CropNetwork]):
    """State of the training of a network on crops.

    `early` computes the features at stride 8 when they are frozen. It needs no normalisation.
    """

    early: EarlyLayers | None = None

    @staticmethod
    def new(classes: int, seed: int, device: torch.device, *, classifier: bool) -> CropLearner:
        """Makes an untrained refinement or classifier network."""
        torch.manual_seed(seed)
        return CropLearner(ClassifierNetwork(classes) if classifier else RefinementNetwork(classes), device)

    def begin(self, first: Path, batches: Iterable[CropBatch]) -> None:
        """Loads the initial weights; layers without any stay unchanged. Raises TrainingDataError.

        The refinement network starts from the proposal network's ONNX file and statistics of batches, the classifier
        from ImageNet's weights.
        """
        if isinstance(self.network, ClassifierNetwork):
            self.network.backbone.begin_with_imagenet()
        elif isinstance(self.network, RefinementNetwork):
            detector = DetectorNetwork(self.network.classes)
            take_over(detector, first)
            settle(detector, ((batch.crops,) for batch in batches))
            self.network.detector.load_state_dict(detector.state_dict(), strict=False)
        self.begin_average()

    def keep_early(self) -> None:
        """Freezes the layers up to stride 8, which take two fifths of the time of each step."""
        early = self.network.early_layers
        for part in (early.stem, early.stage8):
            part.requires_grad_(False)
        made = fuse(self.average.early_layers).requires_grad_(False)
        self.early = made.to(self.device, memory_format=torch.channels_last)

    def step(self, batch: CropBatch, rate: float) -> tuple[float, float]:
        """Takes a step on one batch; returns score loss and box loss."""
        return self.take_step(lambda: self._losses(batch), rate)

    def _losses(self, batch: CropBatch) -> Losses:
        crops, regions, before, wanted, classes = self.to_device(*vars(batch).values())
        with self.quick():
            if self.early is None:
                logits, boxes = self.network(crops, regions, before)
            else:
                with torch.no_grad():
                    at8 = self.early.early(crops)
                logits, boxes = self.network.from_early(at8, regions, before)
        return crop_losses(logits, boxes, wanted, classes)


def quick_in_bfloat16(device: torch.device) -> bool:
    """Returns whether bfloat16 saves time: on processors without it, it costs twice as much."""
    capabilities = torch.cpu.get_capabilities()
    return device.type != "cpu" or any(capabilities.get(name, False) for name in ("amx_bf16", "avx512_bf16"))


def read_checkpoint(file: Path) -> dict[str, Any]:
    """Reads the state in a file. Raises TrainingDataError."""
    try:
        state = torch.load(file, map_location="cpu", weights_only=True)
    except (OSError, RuntimeError, ValueError, EOFError, pickle.UnpicklingError) as error:
        reason = (str(error).splitlines() or ["empty"])[0]
        raise TrainingDataError(f"{file}: is no checkpoint that can be read ({reason})", hint=_WITHOUT) from error
    if not isinstance(state, dict) or state.get("format") != FORMAT:
        raise TrainingDataError(f"{file}: is a checkpoint of another version", hint=_WITHOUT)
    return state
