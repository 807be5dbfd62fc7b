"""The classifier network: judges the refinement network's boxes in crops, with a backbone pretrained on ImageNet.

It adds corrections to the refinement network's logits. In use it adds three quarters of them, since it is
overconfident on new pictures. (The effect is that of averaging weights before and after training, after Wortsman et
al., "Robust fine-tuning of zero-shot models", 2022, for the last layers alone.)
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from errand_train.detector.crop_network import MOST_LOGIT, CropNetwork, coverage, shift_boxes
from errand_train.detector.lite_backbone import AT_8, AT_16, AT_32, LiteBackbone
from errand_train.detector.network import ConvUnit
from skills.perception.detector.model_files import CLASSIFIER, CROP_PX

_CELLS_16, _CELLS_32 = CROP_PX // 16, CROP_PX // 32
_SQUEEZED_16, _SQUEEZED_32, _JOINED = 24, 96, 192
_SIDES_SCALE = 0.1
USED = 0.75
"""Share of its correction of the refinement network's logits that it adds in use."""


class ClassifierNetwork(CropNetwork):
    """Crop network whose untrained output is that of the network before it."""

    kind = CLASSIFIER

    def __init__(self, classes: int) -> None:
        known = _SQUEEZED_16 * _CELLS_16 * _CELLS_16 + _SQUEEZED_32 * _CELLS_32 * _CELLS_32 + classes + 4
        super().__init__(classes, known, _JOINED, AT_8)
        self.backbone = LiteBackbone()
        self.squeeze16 = ConvUnit(AT_16, _SQUEEZED_16)
        self.squeeze32 = ConvUnit(AT_32, _SQUEEZED_32)
        self.trust = nn.Parameter(torch.ones(classes))

    @property
    def early_layers(self) -> LiteBackbone:
        """Layers up to the features at stride 8."""
        return self.backbone

    def from_early(self, at8: Tensor, boxes: Tensor, logits: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (N, K) and boxes (N, 4) from the features of the early layers."""
        at16, at32 = self.backbone.late(at8 + self.place(coverage(boxes)))
        before = logits.clamp(-MOST_LOGIT, MOST_LOGIT)
        seen = [self.squeeze16(at16).flatten(1), self.squeeze32(at32).flatten(1), before, boxes / CROP_PX]
        known = self.join(torch.cat(seen, dim=1))
        return self.trust * before + self.scores(known), shift_boxes(boxes, _SIDES_SCALE * self.sides(known).float())

    def stop_learning(self) -> None:
        """Scales its corrections by `USED`."""
        self.add(USED)

    @torch.no_grad()
    def add(self, share: float) -> None:
        """Scales its corrections of logits and boxes by a factor."""
        self.trust.sub_(1.0).mul_(share).add_(1.0)
        for layer in (self.scores, self.sides):
            layer.weight.mul_(share)
            layer.bias.mul_(share)
