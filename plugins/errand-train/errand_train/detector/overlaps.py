"""Intersection over union of boxes as tensors."""

from __future__ import annotations

import torch
from torch import Tensor

_TINY = 1e-9
_LEAST_SIDE = 1e-7


def overlap(first: Tensor, second: Tensor) -> Tensor:
    """Intersection over union (...) of boxes (..., 4) of x0 y0 x1 y1 that broadcast."""
    low, high = torch.maximum(first[..., :2], second[..., :2]), torch.minimum(first[..., 2:], second[..., 2:])
    shared = (high - low).clamp(min=0.0).prod(dim=-1)
    areas = sizes(first).prod(dim=-1) + sizes(second).prod(dim=-1)
    return shared / (areas - shared + _TINY)


def sizes(boxes: Tensor) -> Tensor:
    """Widths and heights (..., 2) of boxes (..., 4), above 0."""
    return (boxes[..., 2:] - boxes[..., :2]).clamp(min=_LEAST_SIDE)
