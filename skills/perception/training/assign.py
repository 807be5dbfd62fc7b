"""Which cells of the network answer for which object.

Task-aligned assignment after Feng et al., "TOOD: Task-aligned One-stage Object Detection" (2021): of the cells whose
middles lie in an object's box, those answer for it that score its class high and overlap its box well already.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from skills.perception.training.overlaps import overlap

_TINY = 1e-9


@dataclass(frozen=True)
class AssignOptions:
    """How many cells answer for an object at most, the weights of score and overlap, and how small a box is at least
    taken to be (in pixels) when asking which cells lie in it."""

    most_cells: int = 10
    score_power: float = 0.5
    overlap_power: float = 6.0
    least_side_px: float = 16.0


@dataclass(frozen=True)
class Assigned:
    """For each cell of each picture (N, A): the row of its object or -1; how well it does, from 0 to 1; whether to be
    left out of the loss."""

    objects: Tensor
    quality: Tensor
    left_out: Tensor


@torch.no_grad()
def assign(
    scores: Tensor,
    boxes: Tensor,
    middles: Tensor,
    *,
    truth: Tensor,
    classes: Tensor,
    ignored: Tensor,
    present: Tensor,
    options: AssignOptions,
) -> Assigned:
    """Assign the cells of N pictures to at most G objects each.

    scores (N, A, K) from 0 to 1, boxes (N, A, 4), middles (A, 2); truth (N, G, 4), classes (N, G), ignored (N, G) and
    present (N, G), which is false for rows that only fill up.
    """
    inside = _inside(middles, truth, options.least_side_px) & present[..., None]
    overlaps = overlap(truth[:, :, None], boxes[:, None])
    asked = scores.gather(2, classes[:, None, :].expand(-1, scores.shape[1], -1)).transpose(1, 2)
    metric = asked.pow(options.score_power) * (overlaps + 1e-4).pow(options.overlap_power)
    metric = metric * (inside & ~ignored[..., None])
    chosen = _best(metric, options.most_cells) & (metric > 0)
    rival = torch.where(chosen, overlaps + _TINY, overlaps.new_tensor(-1.0))
    best, objects = rival.max(dim=1)
    mine = chosen & (objects[:, None, :] == torch.arange(truth.shape[1])[None, :, None].to(objects.device))
    quality = _quality(metric * mine, overlaps * mine)
    taken = best >= 0
    left_out = (inside & ignored[..., None]).any(dim=1) & ~taken
    return Assigned(torch.where(taken, objects, objects.new_tensor(-1)), quality * taken, left_out)


def _inside(middles: Tensor, truth: Tensor, least_side_px: float) -> Tensor:
    """Whether cells' middles lie in boxes (N, G, A), of which the sides are taken to be at least so long."""
    centre, half = (truth[..., :2] + truth[..., 2:]) / 2, (truth[..., 2:] - truth[..., :2]) / 2
    half = half.clamp(min=least_side_px / 2)
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
