"""Convolutions of each channel by itself, with gradients of their own.

The library's gradients of their weights, and those of the input with stride 2, would take most of the time of learning
on processor cores.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from skills.estimate.compiled import compiled

__all__ = ["before_first", "filtered", "padded"]

_LARGE: Final = 5


def padded(x: Tensor, kernel: int, stride: int) -> Tensor:
    """Rows and columns of zeros around (N, C, H, W); with stride 2 one more below, and at the right, than above."""
    before = before_first(kernel, stride)
    after = kernel - stride - before
    return nn.functional.pad(x, (before, after, before, after))


def before_first(kernel: int, stride: int) -> int:
    """How many rows of zeros there are above the first."""
    return (kernel - stride) // 2


def filtered(x: Tensor, weight: Tensor, stride: int) -> Tensor:
    """Each channel of (N, C, H, W) under its weights (C, 1, k, k), k 3 or 5; as large, or half with stride 2."""
    if x.device.type != "cpu":
        return nn.functional.conv2d(padded(x, weight.shape[-1], stride), weight, None, stride, 0, 1, len(weight))
    made: Tensor = _Filtering.apply(x, weight, stride)
    return made


class _Filtering(torch.autograd.Function):
    """The library's convolution, with gradients of the input by a convolution of stride 1, and of weights by a loop."""

    @staticmethod
    def forward(context: Any, x: Tensor, weight: Tensor, stride: int) -> Tensor:
        weight = weight.to(x.dtype)
        around = padded(x, weight.shape[-1], stride)
        context.save_for_backward(around, weight)
        context.stride, context.size = stride, x.shape[2:]
        return nn.functional.conv2d(around, weight, None, stride, 0, 1, len(weight))

    @staticmethod
    def backward(context: Any, *gradients: Tensor) -> tuple[Tensor | None, Tensor | None, None]:
        (around, weight), (gradient,) = context.saved_tensors, gradients
        of_input, of_weight, _ = context.needs_input_grad
        return (
            _of_input(gradient, weight, context.stride, context.size) if of_input else None,
            _of_weight(around, gradient, weight.shape[-1], context.stride) if of_weight else None,
            None,
        )


def _of_input(gradient: Tensor, weight: Tensor, stride: int, size: torch.Size) -> Tensor:
    kernel = weight.shape[-1]
    before = before_first(kernel, stride)
    if stride == 2:
        count, channels, height, width = gradient.shape
        apart = gradient.new_zeros((count, channels, 2 * height - 1, 2 * width - 1))
        apart = apart.contiguous(memory_format=torch.channels_last)
        apart[:, :, ::2, ::2] = gradient
        gradient = apart
    found = nn.functional.conv2d(gradient, weight.flip(2, 3), None, 1, kernel - 1 - before, 1, len(weight))
    height, width = size
    return found[:, :, :height, :width]


def _of_weight(around: Tensor, gradient: Tensor, kernel: int, stride: int) -> Tensor:
    given, wanted = _channels_last(around), _channels_last(gradient)
    found = np.zeros((kernel, kernel, given.shape[-1]), dtype=given.dtype)
    _add_products(given, wanted, stride, found)
    return torch.from_numpy(found).permute(2, 0, 1).unsqueeze(1)


def _channels_last(x: Tensor) -> NDArray[Any]:
    """(N, C, H, W) as an array (N, H, W, C), of 32 bits at least."""
    moved = x.detach().permute(0, 2, 3, 1)
    found: NDArray[Any] = (moved if moved.dtype == torch.float64 else moved.float()).contiguous().numpy()
    return found


@compiled
def _add_products(x: NDArray[Any], gradient: NDArray[Any], stride: int, sums: NDArray[Any]) -> None:
    """Add to sums (k, k, C) the products of gradients (N, h, w, C) with the inputs (N, H, W, C) that they are of."""
    count, height, width, channels = gradient.shape
    kernel = sums.shape[0]
    for n in range(count):
        for i in range(height):
            for a in range(kernel):
                row = i * stride + a
                for j in range(width):
                    column = j * stride
                    for c in range(channels):
                        by = gradient[n, i, j, c]
                        sums[a, 0, c] += x[n, row, column, c] * by
                        sums[a, 1, c] += x[n, row, column + 1, c] * by
                        sums[a, 2, c] += x[n, row, column + 2, c] * by
                        if kernel == _LARGE:
                            sums[a, 3, c] += x[n, row, column + 3, c] * by
                            sums[a, 4, c] += x[n, row, column + 4, c] * by
