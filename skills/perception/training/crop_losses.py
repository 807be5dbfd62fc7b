"""The losses of crop networks: scores as high as their boxes are good, and boxes that overlap."""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor

from skills.perception.training.losses import Losses, complete_overlap
from skills.perception.training.overlaps import overlap

__all__ = ["crop_losses"]

_BOX_WEIGHT: Final = 2.0


def crop_losses(logits: Tensor, boxes: Tensor, wanted: Tensor, classes: Tensor) -> Losses:
    """The losses of logits (N, K) and boxes (N, 4), by boxes `wanted` (N, 4) and `classes` (N,), -1 for none."""
    logits, boxes = logits.float(), boxes.float()
    near = classes >= 0
    scores = torch.zeros_like(logits)
    found, right = boxes[near], wanted[near]
    scores[near, classes[near]] = overlap(found.detach(), right)
    each = torch.nn.functional.binary_cross_entropy_with_logits(logits, scores, reduction="none").sum(dim=1)
    apart = (1.0 - complete_overlap(found, right)).sum() / near.sum().clamp(min=1)
    return Losses(each.mean(), _BOX_WEIGHT * apart)
