"""The state of learning of the second network, and one step of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from skills.detect.training.averaging import WeightAverage
from skills.detect.training.learner import LearningState, optimisers_of
from skills.detect.training.losses import Losses
from skills.detect.training.network import DetectorNetwork
from skills.detect.training.onnx_weights import settle, take_over
from skills.detect.training.peers import Peers
from skills.detect.training.region_chips import RegionBatch
from skills.detect.training.region_losses import region_losses
from skills.detect.training.region_network import RegionNetwork

__all__ = ["RegionLearner"]


@dataclass
class RegionLearner(LearningState[RegionNetwork]):
    """All that changes while the second network learns."""

    @staticmethod
    def new(classes: int, seed: int, device: torch.device) -> RegionLearner:
        """A network that has learnt nothing yet, and adds nothing to what the first one says."""
        torch.manual_seed(seed)
        network = RegionNetwork(classes).to(device, memory_format=torch.channels_last)
        last = (network.place8, network.place16)
        return RegionLearner(network, WeightAverage(network), optimisers_of(network, last), device)

    def start_from(self, first: Path, chips: Iterable[Tensor]) -> None:
        """Take over the backbone of the first network's ONNX file, with statistics of chips (N, 3, 128, 128).

        Raises TrainingDataError.
        """
        detector = DetectorNetwork(self.network.classes)
        take_over(detector, first)
        settle(detector, chips)
        self.network.backbone.load_state_dict(detector.backbone.state_dict())
        self.average.network.load_state_dict(self.network.state_dict())

    def step(self, batch: RegionBatch, rate: float, peers: Peers, clock: float) -> tuple[float, float, float]:
        """Learn from one batch: score loss, box loss, and the first process's clock."""
        return self.take_step(lambda: self._losses(batch), rate, peers, clock)

    def _losses(self, batch: RegionBatch) -> Losses:
        chips, regions, first, wanted, classes = (
            part.to(self.device) for part in (batch.chips, batch.boxes, batch.logits, batch.wanted, batch.classes)
        )
        with self.quick():
            logits, boxes = self.network(chips, regions, first)
        return region_losses(logits, boxes, wanted, classes)
