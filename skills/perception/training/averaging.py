"""The running mean of a network's weights, which is better than the last ones (Polyak and Juditsky, 1992)."""

from __future__ import annotations

import copy
from typing import Any

import torch
from torch import Tensor, nn

__all__ = ["WeightAverage"]


class WeightAverage:
    """Follows a network; slowly later, fast at first."""

    def __init__(self, network: nn.Module, decay: float = 0.998, settle_steps: float = 10.0) -> None:
        self.network = copy.deepcopy(network).eval().requires_grad_(False)
        self.decay = decay
        self.settle_steps = settle_steps
        self.steps = 0

    @torch.no_grad()
    def follow(self, network: nn.Module) -> None:
        """Take in the weights after a step."""
        self.steps += 1
        keep = min(self.decay, self.steps / (self.steps + self.settle_steps))
        for mine, theirs in zip(self.network.state_dict().values(), network.state_dict().values(), strict=True):
            self._mix(mine, theirs, keep)

    @staticmethod
    def _mix(mine: Tensor, theirs: Tensor, keep: float) -> None:
        if mine.is_floating_point():
            mine.lerp_(theirs.to(mine.dtype), 1.0 - keep)
        else:
            mine.copy_(theirs)

    def state(self) -> dict[str, Any]:
        """What `restore` takes."""
        return {"network": self.network.state_dict(), "steps": self.steps}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a state."""
        self.network.load_state_dict(state["network"])
        self.steps = int(state["steps"])
