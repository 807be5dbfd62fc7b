"""The state of training the refinement or the classifier network, and one step of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from skills.perception.training.classifier_network import ClassifierNetwork
from skills.perception.training.crop_batches import CropBatch
from skills.perception.training.crop_network import CropNetwork
from skills.perception.training.export import fused
from skills.perception.training.learner import ONNX, Learner
from skills.perception.training.lite_backbone import LiteBackbone
from skills.perception.training.losses import Losses, crop_losses
from skills.perception.training.network import DetectorNetwork, EarlyLayers
from skills.perception.training.onnx_weights import settle, take_over, take_over_classifier, take_over_refinement
from skills.perception.training.refinement_network import RefinementNetwork


@dataclass
class CropLearner(Learner[CropNetwork]):
    """All that changes while a network is trained on crops.

    `early` makes the features at stride 8 when they are no longer trained. It needs no normalisation.
    """

    early: EarlyLayers | None = None

    @staticmethod
    def new(classes: int, seed: int, device: torch.device, *, classifier: bool) -> CropLearner:
        """An untrained refinement or classifier network."""
        torch.manual_seed(seed)
        return CropLearner(ClassifierNetwork(classes) if classifier else RefinementNetwork(classes), device)

    def begin(self, first: Path, batches: Iterable[CropBatch]) -> None:
        """Take over the weights to begin with; what has none there stays as it is. Raises TrainingDataError.

        The refinement network begins with the proposal network's ONNX file and statistics of batches, the classifier
        with ImageNet's weights.
        """
        if isinstance(self.network, ClassifierNetwork):
            backbone = LiteBackbone()
            backbone.begin_with_imagenet()
            self.network.backbone.load_state_dict(backbone.state_dict())
        elif isinstance(self.network, RefinementNetwork):
            detector = DetectorNetwork(self.network.classes)
            take_over(detector, first)
            settle(detector, ((batch.crops,) for batch in batches))
            self.network.detector.load_state_dict(detector.state_dict(), strict=False)
        self.begin_average()

    def start_from(self, file: Path, batches: Iterable[CropBatch]) -> None:
        """Take over the weights of such a network's ONNX file, with statistics of batches, or a checkpoint's.

        Raises TrainingDataError.
        """
        if file.suffix != ONNX:
            self.start_from_checkpoint(file)
            return
        if isinstance(self.network, ClassifierNetwork):
            take_over_classifier(self.network, file)
        elif isinstance(self.network, RefinementNetwork):
            take_over_refinement(self.network, file)
        settle(self.network, (self._moved(batch.crops, batch.boxes, batch.logits) for batch in batches))
        self.begin_average()

    def keep_early(self) -> None:
        """Train no longer what makes the features at stride 8: two fifths of the time of each step."""
        early = self.network.early_layers
        for part in (early.stem, early.stage8):
            part.requires_grad_(False)
        made = fused(self.average.early_layers).requires_grad_(False)
        self.early = made.to(self.device, memory_format=torch.channels_last)

    def step(self, batch: CropBatch, rate: float) -> tuple[float, float]:
        """Train on one batch; returns score loss and box loss."""
        return self.take_step(lambda: self._losses(batch), rate)

    def _losses(self, batch: CropBatch) -> Losses:
        crops, regions, before, wanted, classes = self._moved(*vars(batch).values())
        with self.quick():
            if self.early is None:
                logits, boxes = self.network(crops, regions, before)
            else:
                with torch.no_grad():
                    at8 = self.early.early(crops)
                logits, boxes = self.network.from_early(at8, regions, before)
        return crop_losses(logits, boxes, wanted, classes)

    def _moved(self, *parts: Tensor) -> tuple[Tensor, ...]:
        return tuple(part.to(self.device) for part in parts)
