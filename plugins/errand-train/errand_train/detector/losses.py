"""Losses of training: scores learn the quality of their boxes, and boxes the overlap."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from errand_train.detector.assign import Assigned, TruthBatch, assign
from errand_train.detector.overlaps import overlap, sizes

_TINY = 1e-7
_BOX_WEIGHT, _CROP_BOX_WEIGHT = 3.0, 2.0


@dataclass(frozen=True)
class Losses:
    """Score loss and weighted box loss, two scalars."""

    scores: Tensor
    boxes: Tensor

    @property
    def total(self) -> Tensor:
        """Sum that training minimises."""
        return self.scores + self.boxes


def losses(logits: Tensor, boxes: Tensor, middles: Tensor, truth: TruthBatch) -> Losses:
    """Losses of logits (N, A, K) and boxes (N, A, 4), per assigned cell, weighted by its quality."""
    logits, boxes = logits.float(), boxes.float()
    assigned = assign(logits.detach().sigmoid(), boxes.detach(), middles, truth)
    total = assigned.quality.sum().clamp(min=1.0)
    wanted = _wanted_scores(logits, truth, assigned)
    each = torch.nn.functional.binary_cross_entropy_with_logits(logits, wanted, reduction="none").sum(dim=2)
    score_loss = (each * ~assigned.left_out).sum() / total
    answering = assigned.objects >= 0
    targets = truth.boxes.gather(1, assigned.objects.clamp(min=0)[..., None].expand(-1, -1, 4))[answering]
    box_each = (1.0 - complete_overlap(boxes[answering], targets)) * assigned.quality[answering]
    return Losses(score_loss, _BOX_WEIGHT * box_each.sum() / total)


def crop_losses(logits: Tensor, boxes: Tensor, wanted: Tensor, classes: Tensor) -> Losses:
    """Losses of the logits (N, K) and boxes (N, 4) of crops, by `wanted` boxes (N, 4) and `classes` (N,), -1: none."""
    logits, boxes = logits.float(), boxes.float()
    near = classes >= 0
    scores = torch.zeros_like(logits)
    found, right = boxes[near], wanted[near]
    scores[near, classes[near]] = overlap(found.detach(), right)
    each = torch.nn.functional.binary_cross_entropy_with_logits(logits, scores, reduction="none").sum(dim=1)
    apart = (1.0 - complete_overlap(found, right)).sum() / near.sum().clamp(min=1)
    return Losses(each.mean(), _CROP_BOX_WEIGHT * apart)


def _wanted_scores(logits: Tensor, truth: TruthBatch, assigned: Assigned) -> Tensor:
    """Quality at the class of each answering cell, nought elsewhere."""
    classes = truth.classes.gather(1, assigned.objects.clamp(min=0))
    return torch.zeros_like(logits).scatter_(2, classes[..., None], assigned.quality[..., None])


def complete_overlap(first: Tensor, second: Tensor) -> Tensor:
    """Complete IoU (M,) of boxes (M, 4): overlap less penalties for distance and other proportions.

    After Zheng et al., "Distance-IoU Loss" (2020).
    """
    shared, size1, size2 = overlap(first, second), sizes(first), sizes(second)
    around = torch.maximum(first[:, 2:], second[:, 2:]) - torch.minimum(first[:, :2], second[:, :2])
    apart = (first[:, :2] + first[:, 2:] - second[:, :2] - second[:, 2:]).square().sum(dim=1) / 4
    away = apart / (around.square().sum(dim=1) + _TINY)
    angles = torch.atan(size2[:, 0] / size2[:, 1]) - torch.atan(size1[:, 0] / size1[:, 1])
    shape = 4 / math.pi**2 * angles.square()
    with torch.no_grad():
        weight = shape / (1.0 - shared + shape + _TINY)
    return shared - away - weight * shape
