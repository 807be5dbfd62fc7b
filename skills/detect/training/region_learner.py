"""The state of learning of the second network, and one step of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from skills.detect.training.averaging import WeightAverage
from skills.detect.training.learner import ONNX, LearningState, optimisers_of, without_learning_early
from skills.detect.training.losses import Losses
from skills.detect.training.network import Backbone, DetectorNetwork
from skills.detect.training.onnx_weights import settle, take_over, take_over_regions
from skills.detect.training.peers import Peers
from skills.detect.training.region_chips import RegionBatch
from skills.detect.training.region_losses import region_losses
from skills.detect.training.region_network import RegionNetwork

__all__ = ["RegionLearner"]


@dataclass
class RegionLearner(LearningState[RegionNetwork]):
    """All that changes while the second network learns.

    `early` makes the features at stride 8. It is the first network's, is not learnt, and needs no normalisation.
    """

    early: Backbone | None = None

    @staticmethod
    def new(classes: int, seed: int, device: torch.device) -> RegionLearner:
        """A network that has learnt nothing yet."""
        torch.manual_seed(seed)
        network = RegionNetwork(classes).to(device, memory_format=torch.channels_last)
        last = [network.place, *(layer for head in network.detector.heads for layer in (head.scores, head.sides))]
        return RegionLearner(network, WeightAverage(network), optimisers_of(network, last), device)

    def begin_with_first(self, first: Path, batches: Iterable[RegionBatch]) -> None:
        """Take over the weights of the first network's ONNX file, with statistics of batches.

        What the first network has not, stays as it is. Raises TrainingDataError.
        """
        detector = DetectorNetwork(self.network.classes)
        take_over(detector, first)
        settle(detector, ((batch.chips,) for batch in batches))
        self.network.detector.load_state_dict(detector.state_dict(), strict=False)
        self.average.network.load_state_dict(self.network.state_dict())

    def start_from(self, file: Path, batches: Iterable[RegionBatch]) -> None:
        """Take over the weights of a second network's ONNX file, with statistics of batches, or a checkpoint's.

        Raises TrainingDataError.
        """
        if file.suffix != ONNX:
            self.start_from_checkpoint(file)
            return
        take_over_regions(self.network, file)
        settle(self.network, (_moved((batch.chips, batch.boxes, batch.logits), self.device) for batch in batches))
        self.average.network.load_state_dict(self.network.state_dict())

    def keep_early(self) -> None:
        """Learn no longer what makes the features at stride 8: two fifths of the time of each step."""
        mine, average = self.network.detector.backbone, self.average.network.detector.backbone
        self.early = without_learning_early(mine, average, self.device)

    def step(self, batch: RegionBatch, rate: float, peers: Peers, clock: float) -> tuple[float, float, float]:
        """Learn from one batch: score loss, box loss, and the first process's clock."""
        return self.take_step(lambda: self._losses(batch), rate, peers, clock)

    def _losses(self, batch: RegionBatch) -> Losses:
        chips, regions, first, wanted, classes = _moved(
            (batch.chips, batch.boxes, batch.logits, batch.wanted, batch.classes), self.device
        )
        with self.quick():
            logits, boxes = self._answers(chips, regions, first)
        return region_losses(logits, boxes, wanted, classes)

    def _answers(self, chips: Tensor, regions: Tensor, first: Tensor) -> tuple[Tensor, Tensor]:
        if self.early is None:
            logits, boxes = self.network(chips, regions, first)
            return logits, boxes
        with torch.no_grad():
            at8 = self.early.early(chips)
        return self.network.from_early(at8, regions, first)


def _moved(parts: tuple[Tensor, ...], device: torch.device) -> tuple[Tensor, ...]:
    return tuple(part.to(device) for part in parts)
