"""Assignment of the network's cells to objects.

Task-aligned assignment after Feng et al., "TOOD: Task-aligned One-stage Object Detection" (2021): an object gets
those of the cells with their middles in its box that already score its class high and overlap its box well.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from errand_train.detector.overlaps import overlap

_TINY = 1e-9
_MOST_CELLS = 10
_SCORE_POWER, _OVERLAP_POWER = 0.5, 6.0
_LEAST_SIDE_PX = 16.0
"""Least size of a box in the test which cells lie in it."""


@dataclass(frozen=True)
class TruthBatch:
    """Objects of N pictures, padded to G rows: boxes (N, G, 4), classes, ignored and present (N, G)."""

    boxes: Tensor
    classes: Tensor
    ignored: Tensor
    present: Tensor


@dataclass(frozen=True)
class Assigned:
    """Assignment of each cell of each picture (N, A): row of its object or -1, quality from 0 to 1, and whether the
    loss leaves it out."""

    objects: Tensor
    quality: Tensor
    left_out: Tensor


@torch.no_grad()
def assign(
    scores: Tensor, boxes: Tensor, middles: Tensor, truth: TruthBatch, most_cells: int = _MOST_CELLS
) -> Assigned:
    """Assigns the cells of N pictures to at most G objects each, `most_cells` to each object.

    scores (N, A, K) from 0 to 1, boxes (N, A, 4), middles (A, 2).
    """
    inside = _inside(middles, truth.boxes) & truth.present[..., None]
    overlaps = overlap(truth.boxes[:, :, None], boxes[:, None])
    asked = scores.gather(2, truth.classes[:, None, :].expand(-1, scores.shape[1], -1)).transpose(1, 2)
    metric = asked.pow(_SCORE_POWER) * (overlaps + 1e-4).pow(_OVERLAP_POWER)
    metric = metric * (inside & ~truth.ignored[..., None])
    chosen = _best(metric, most_cells) & (metric > 0)
    candidates = torch.where(chosen, overlaps + _TINY, overlaps.new_tensor(-1.0))
    best, objects = candidates.max(dim=1)
    mine = chosen & (objects[:, None, :] == torch.arange(truth.boxes.shape[1])[None, :, None].to(objects.device))
    quality = _quality(metric * mine, overlaps * mine)
    taken = best >= 0
    left_out = (inside & truth.ignored[..., None]).any(dim=1) & ~taken
    return Assigned(torch.where(taken, objects, objects.new_tensor(-1)), quality * taken, left_out)


def _inside(middles: Tensor, truth: Tensor) -> Tensor:
    """Returns whether cells' middles lie in boxes (N, G, A), of which the sides are taken to be at least so long."""
    centre, half = (truth[..., :2] + truth[..., 2:]) / 2, (truth[..., 2:] - truth[..., :2]) / 2
    half = half.clamp(min=_LEAST_SIDE_PX / 2)
    away = (middles[None, None] - centre[:, :, None]).abs()
    return (away < half[:, :, None]).all(dim=-1)


def _best(metric: Tensor, count: int) -> Tensor:
    """True for the `count` highest cells of each object."""
    rows = metric.topk(min(count, metric.shape[2]), dim=2).indices
    return torch.zeros_like(metric, dtype=torch.bool).scatter_(2, rows, True)


def _quality(metric: Tensor, overlaps: Tensor) -> Tensor:
    """Each cell's metric, scaled so that an object's best cell has its best overlap, (N, A)."""
    highest = metric.amax(dim=2, keepdim=True)
    best = overlaps.amax(dim=2, keepdim=True)
    return (metric / (highest + _TINY) * best).amax(dim=1)
