"""Several processes of one thread each that learn together: faster on processor cores than threads within one step."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from pathlib import Path

import torch
import torch.distributed as distributed
from torch import Tensor, nn

__all__ = ["Workers", "joined_workers"]

_PATIENCE = datetime.timedelta(hours=2)


@dataclass(frozen=True)
class Workers:
    """This process among `count`. The first, number 0, has the clock, measures and writes."""

    rank: int
    count: int

    @property
    def first(self) -> bool:
        """Whether this is the one that measures and writes."""
        return self.rank == 0

    def mean_gradients(self, network: nn.Module, clock: float) -> float:
        """Replace all gradients by their mean over the processes; gives the first one's clock."""
        if self.count == 1:
            return clock
        gradients = [weight.grad for weight in network.parameters() if weight.grad is not None]
        told = torch.tensor([clock * self.count if self.first else 0.0], dtype=torch.float64)
        flat = torch.cat([gradient.reshape(-1) for gradient in gradients])
        distributed.all_reduce(flat)
        distributed.all_reduce(told)
        _spread(flat / self.count, gradients)
        return float(told) / self.count

    def mean_statistics(self, network: nn.Module) -> None:
        """Replace running statistics of normalisation by their mean over the processes."""
        if self.count == 1:
            return
        for buffer in network.buffers():
            if buffer.is_floating_point():
                distributed.all_reduce(buffer)
                buffer.div_(self.count)

    def wait(self) -> None:
        """Go on when all are here."""
        if self.count > 1:
            distributed.barrier()


def _spread(flat: Tensor, into: list[Tensor]) -> None:
    first = 0
    for gradient in into:
        gradient.copy_(flat[first : first + gradient.numel()].view_as(gradient))
        first += gradient.numel()


def joined_workers(rank: int, count: int, meeting: Path) -> Workers:
    """Join the others by a file that does not exist yet."""
    if count > 1:
        distributed.init_process_group(
            "gloo", init_method=meeting.absolute().as_uri(), rank=rank, world_size=count, timeout=_PATIENCE
        )
    return Workers(rank, count)
