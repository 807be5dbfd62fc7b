"""Sound as samples, and what can be told of it without understanding it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

__all__ = ["RATE_HZ", "Loudness", "Samples", "joined", "level_db"]

Samples = npt.NDArray[np.float32]
"""Sound of one channel at RATE_HZ; full scale is -1 to 1."""

RATE_HZ: Final = 16_000
_CLIP_LEVEL: Final = 0.999
_CLIP_RUN: Final = 3
_MUCH_CLIPPED: Final = 0.002
_SILENT_LEVEL: Final = 1e-3


@dataclass(frozen=True)
class Loudness:
    """How loud a sound is: its length in samples, its greatest sample (1 is full scale), and how many are clipped.

    A sample counts as clipped when it stands among at least three neighbours at full scale.
    """

    count: int = 0
    peak: float = 0.0
    clipped: int = 0

    def with_block(self, block: Samples) -> Loudness:
        """The same for the sound so far and one more block of it, whatever its rate."""
        if not block.size:
            return self
        height = np.abs(block)
        return Loudness(
            self.count + block.size, max(self.peak, float(height.max())), self.clipped + _runs(height >= _CLIP_LEVEL)
        )

    @property
    def silent(self) -> bool:
        """Whether nothing in it is louder than 60 dB below full scale."""
        return self.peak < _SILENT_LEVEL

    @property
    def much_clipped(self) -> bool:
        """Whether so many samples (one in 500) were cut off that words may be lost."""
        return self.clipped > _MUCH_CLIPPED * self.count


def level_db(block: Samples) -> float:
    """The mean power of a block in decibels below full scale (0 is a full square wave), -100 at the least."""
    power = float(np.mean(np.square(block))) if block.size else 0.0
    return max(10.0 * float(np.log10(max(power, 1e-10))), -100.0)


def joined(blocks: Iterable[Samples]) -> Samples:
    """The blocks one after another."""
    return np.concatenate([np.zeros(0, np.float32), *blocks])


def _runs(flags: npt.NDArray[np.bool_]) -> int:
    """How many flags stand in runs of at least _CLIP_RUN."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    lengths = edges[1::2] - edges[::2]
    return int(lengths[lengths >= _CLIP_RUN].sum())
