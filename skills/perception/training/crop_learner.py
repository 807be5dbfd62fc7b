"""The state of learning of the refinement or the classifier network, and one step of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn

from skills.perception.training.averaging import WeightAverage
from skills.perception.training.classifier_network import ClassifierNetwork
from skills.perception.training.crop_batches import CropBatch
from skills.perception.training.crop_losses import crop_losses
from skills.perception.training.crop_network import CropNetwork
from skills.perception.training.learner import ONNX, LearningState, optimisers_of, without_learning_early
from skills.perception.training.lite_backbone import LiteBackbone
from skills.perception.training.losses import Losses
from skills.perception.training.network import DetectorNetwork, EarlyLayers
from skills.perception.training.onnx_weights import settle, take_over, take_over_classifier, take_over_refinement
from skills.perception.training.refinement_network import RefinementNetwork
from skills.perception.training.workers import Workers

__all__ = ["ClassifierLearner", "CropLearner", "RefinementLearner"]


@dataclass
class CropLearner(LearningState[CropNetwork]):
    """All that changes while a network learns from crops.

    `early` makes the features at stride 8 when they are no longer learnt. It needs no normalisation.
    """

    early: EarlyLayers | None = None

    @classmethod
    def new(cls, classes: int, seed: int, device: torch.device) -> CropLearner:
        """A network that has learnt nothing yet."""
        raise NotImplementedError

    def begin(self, first: Path, batches: Iterable[CropBatch]) -> None:
        """Take over weights to begin with, with statistics of batches. Raises TrainingDataError."""
        raise NotImplementedError

    def begin_with(self, part: nn.Module, name: str) -> None:
        """Take over the weights of a part of the network, which goes by some name in it."""
        begun = {f"{name}.{key}": weights for key, weights in part.state_dict().items()}
        self.network.load_state_dict(begun, strict=False)
        self.average.network.load_state_dict(self.network.state_dict())

    def start_from(self, file: Path, batches: Iterable[CropBatch]) -> None:
        """Take over the weights of such a network's ONNX file, with statistics of batches, or a checkpoint's.

        Raises TrainingDataError.
        """
        if file.suffix != ONNX:
            self.start_from_checkpoint(file)
            return
        self.take_over_file(file)
        settle(self.network, (_moved((batch.crops, batch.boxes, batch.logits), self.device) for batch in batches))
        self.average.network.load_state_dict(self.network.state_dict())

    def take_over_file(self, file: Path) -> None:
        """Take over the weights of such a network's ONNX file. Raises TrainingDataError."""
        raise NotImplementedError

    def keep_early(self) -> None:
        """Learn no longer what makes the features at stride 8: two fifths of the time of each step."""
        mine, average = self.network.early_layers, self.average.network.early_layers
        self.early = without_learning_early(mine, average, self.device)

    def step(self, batch: CropBatch, rate: float, workers: Workers, clock: float) -> tuple[float, float, float]:
        """Learn from one batch: score loss, box loss, and the first process's clock."""
        return self.take_step(lambda: self._losses(batch), rate, workers, clock)

    def _losses(self, batch: CropBatch) -> Losses:
        crops, regions, before, wanted, classes = _moved(
            (batch.crops, batch.boxes, batch.logits, batch.wanted, batch.classes), self.device
        )
        with self.quick():
            logits, boxes = self._answers(crops, regions, before)
        return crop_losses(logits, boxes, wanted, classes)

    def _answers(self, crops: Tensor, regions: Tensor, before: Tensor) -> tuple[Tensor, Tensor]:
        if self.early is None:
            logits, boxes = self.network(crops, regions, before)
            return logits, boxes
        with torch.no_grad():
            at8 = self.early.early(crops)
        return self.network.from_early(at8, regions, before)


@dataclass
class RefinementLearner(CropLearner):
    """The same of the refinement network, of which the early layers are the proposal network's."""

    @classmethod
    def new(cls, classes: int, seed: int, device: torch.device) -> RefinementLearner:
        """A network that has learnt nothing yet."""
        torch.manual_seed(seed)
        network = RefinementNetwork(classes).to(device, memory_format=torch.channels_last)
        last = [network.place, *(layer for head in network.detector.heads for layer in (head.scores, head.sides))]
        return cls(network, WeightAverage(network), optimisers_of(network, last), device)

    def begin(self, first: Path, batches: Iterable[CropBatch]) -> None:
        """Take over the weights of the proposal network's ONNX file, with statistics of batches.

        What the proposal network has not, stays as it is. Raises TrainingDataError.
        """
        detector = DetectorNetwork(self.network.classes)
        take_over(detector, first)
        settle(detector, ((batch.crops,) for batch in batches))
        self.begin_with(detector, "detector")

    def take_over_file(self, file: Path) -> None:
        """Take over the weights of a refinement network's ONNX file. Raises TrainingDataError."""
        take_over_refinement(self.network, file)


@dataclass
class ClassifierLearner(CropLearner):
    """The same of the classifier network, of which the early layers are those of ImageNet."""

    @classmethod
    def new(cls, classes: int, seed: int, device: torch.device) -> ClassifierLearner:
        """A network that has learnt nothing yet."""
        torch.manual_seed(seed)
        network = ClassifierNetwork(classes).to(device, memory_format=torch.channels_last)
        apart = [network.place, *(block.filter[0] for block in network.backbone.blocks())]
        return cls(network, WeightAverage(network), optimisers_of(network, apart), device)

    def begin(self, first: Path, batches: Iterable[CropBatch]) -> None:
        """Take over the backbone's weights of ImageNet. Raises TrainingDataError."""
        backbone = LiteBackbone()
        backbone.begin_with_imagenet()
        self.begin_with(backbone, "backbone")

    def take_over_file(self, file: Path) -> None:
        """Take over the weights of a classifier network's ONNX file. Raises TrainingDataError."""
        take_over_classifier(self.network, file)


def _moved(parts: tuple[Tensor, ...], device: torch.device) -> tuple[Tensor, ...]:
    return tuple(part.to(device) for part in parts)
