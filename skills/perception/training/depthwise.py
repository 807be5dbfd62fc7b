"""Convolutions of each channel by itself, with gradients of their own.

The library's gradients of their weights, and those of the input with stride 2, would take most of the time of training
on processor cores.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

__all__ = ["before_first", "filtered", "padded"]


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
    """The library's convolution, with gradients of the input by a convolution of stride 1, and of weights by sums."""

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
    """Sums, in 32 bits, of the products of the gradient with the input, shifted by each of the kernel's places."""
    gradient = gradient if gradient.dtype == torch.float64 else gradient.float()
    height, width = gradient.shape[2:]
    sums = [
        (around[:, :, a : a + stride * height : stride, b : b + stride * width : stride] * gradient).sum((0, 2, 3))
        for a in range(kernel)
        for b in range(kernel)
    ]
    return torch.stack(sums, dim=1).reshape(-1, 1, kernel, kernel)
