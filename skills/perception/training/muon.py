"""Steps of which all directions are equally long: the momentum's matrix is made orthogonal.

After Jordan et al., "Muon: An optimizer for hidden layers in neural networks" (2024), with the step length of Liu et
al., "Muon is scalable for LLM training" (2025), which is that of AdamW. What has one dimension only is left to AdamW.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

import torch
from torch import Tensor, nn

__all__ = ["Muon", "orthogonal"]

_COEFFICIENTS: Final = (3.4445, -4.7750, 2.0315)
_STEP_LENGTH: Final = 0.2


class Muon(torch.optim.Optimizer):
    """For the weights of convolutions (out, in, k, k), taken as matrices (out, in k k)."""

    def __init__(self, weights: Iterable[nn.Parameter], lr: float, momentum: float = 0.95, decay: float = 0.03) -> None:
        super().__init__(list(weights), {"lr": lr, "momentum": momentum, "decay": decay})

    @torch.no_grad()
    def step(self, closure: Any = None) -> None:
        """One step along the gradients."""
        for group in self.param_groups:
            for weight in group["params"]:
                if weight.grad is not None:
                    self._move(weight, group)

    def _move(self, weight: Tensor, group: dict[str, Any]) -> None:
        assert weight.grad is not None
        kept = self.state[weight].setdefault("momentum", torch.zeros_like(weight))
        kept.lerp_(weight.grad, 1.0 - group["momentum"])
        ahead = weight.grad.lerp(kept, group["momentum"])
        matrix = orthogonal(ahead.reshape(len(ahead), -1))
        length = _STEP_LENGTH * max(matrix.shape) ** 0.5
        weight.mul_(1.0 - group["lr"] * group["decay"])
        weight.add_(matrix.reshape(weight.shape), alpha=-group["lr"] * length)


def orthogonal(matrix: Tensor, rounds: int = 5) -> Tensor:
    """Nearly the orthogonal matrix next to a matrix (M, N): singular values about 1, by Newton-Schulz iteration.

    The rounds are taken on the products of its shorter side's rows, which are all that they depend on.
    """
    a, b, c = _COEFFICIENTS
    tall = matrix.shape[0] > matrix.shape[1]
    x = (matrix.T if tall else matrix) / (matrix.norm() + 1e-7)
    gram = x @ x.T
    factor = torch.eye(len(gram), dtype=x.dtype, device=x.device)
    for _ in range(rounds):
        turn = torch.addmm(gram, gram, gram, beta=b, alpha=c)
        turn.diagonal().add_(a)
        factor = turn @ factor
        gram = turn @ gram @ turn
    x = factor @ x
    return x.T if tall else x
