"""Options and schedule of a training: length, learning rate and canvases over time. Needs no torch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from errand_train.detector.canvases import CanvasOptions

HIGHEST_RATE: Final = 3e-3
REFINING_RATE: Final = 8e-4
REFINEMENT_RATE: Final = 1e-3
_CROPS: Final = CanvasOptions(128, 128, mosaic=0.0, focused=0.85, scales=(0.4, 1.5), changed=0.8)
_WINDOWS: Final = CanvasOptions(256, 192, mosaic=0.3, scales=(0.4, 1.4), changed=0.7)
_LARGER: Final = CanvasOptions(384, 320, mosaic=0.25, focused=0.75, scales=(0.5, 1.3), changed=0.6)
_PICTURES: Final = CanvasOptions(640, 480, mosaic=0.0, scales=(0.8, 1.25), changed=0.5, whole=True)


@dataclass(frozen=True)
class Phase:
    """A phase: the share of the time at which it starts, its canvases, and its batch size per process."""

    begins: float
    canvas: CanvasOptions
    batch: int


@dataclass(frozen=True)
class Budget:
    """Length of a training, in pictures or in seconds."""

    pictures: int | None = None
    seconds: float | None = None

    def progress(self, pictures: int, seconds: float) -> float:
        """Completed share, from 0 to 1."""
        shares = [pictures / self.pictures] if self.pictures else []
        shares += [seconds / self.seconds] if self.seconds else []
        return min(1.0, max(shares, default=1.0))


@dataclass(frozen=True)
class Schedule:
    """Learning rates and phases: a warm-up, then half a cosine from the highest rate to the last.

    Crops of single objects come first, since they show most objects in the same time; then wider windows; whole
    pictures, as the detector sees them, last. Trained weights need no crops: see `refining`.
    """

    highest_rate: float = HIGHEST_RATE
    last_share: float = 0.02
    warm_up_steps: int = 100
    phases: Sequence[Phase] = field(
        default=(Phase(0.0, _CROPS, 64), Phase(0.4, _WINDOWS, 20), Phase(0.55, _LARGER, 8), Phase(0.82, _PICTURES, 4)),
    )

    @staticmethod
    def refining(highest_rate: float = REFINING_RATE) -> Schedule:
        """Schedule for trained weights: the larger windows, then whole pictures.

        A rate of 2e-3 lost a quarter of the mean average precision in seven minutes; 8e-4 lost little.
        """
        return Schedule(highest_rate, phases=(Phase(0.0, _LARGER, 8), Phase(0.6, _PICTURES, 4)))

    def rate(self, step: int, progress: float) -> float:
        """Learning rate of a step."""
        cosine = 0.5 + 0.5 * math.cos(math.pi * min(progress, 1.0))
        rate = self.highest_rate * (self.last_share + (1.0 - self.last_share) * cosine)
        return rate * min(1.0, (step + 1) / max(self.warm_up_steps, 1))

    def phase(self, progress: float) -> Phase:
        """Phase at a share of the time."""
        return [phase for phase in self.phases if phase.begins <= progress][-1]


@dataclass(frozen=True)
class TrainOptions:
    """Options of a training: data, output folder and length.

    `start` names a checkpoint or a detector's ONNX file with the initial weights. With `resume`, training continues
    from the checkpoint in `out`.
    """

    data: Path
    out: Path
    budget: Budget
    seed: int = 1
    resume: bool = False
    start: Path | None = None
    examined: int = 320
    schedule: Schedule = field(default_factory=Schedule)


@dataclass(frozen=True, kw_only=True)
class RefineOptions(TrainOptions):
    """Options of the refinement network after the proposal network of the file `model`, or of the `classifier` network.

    `start` names a checkpoint of such a training, or such a network's ONNX file, with the initial weights.
    """

    model: Path
    classifier: bool = False
    batch: int = 64


@dataclass(frozen=True)
class Report:
    """Progress of a training, with the `figures` on held-out pictures after a validation."""

    progress: float
    steps: int
    pictures_per_s: float
    losses: tuple[float, float]
    figures: dict[str, float] | None = None


def shuffled_numbers(seed: int, first: int, count: int, of: int) -> NDArray[np.int64]:
    """Numbers `first` to `first + count` of an endless shuffled sequence whose rounds hold each of `of` once."""
    numbers = np.arange(first, first + count)
    rounds = {int(k): np.random.default_rng([seed, int(k)]).permutation(of) for k in np.unique(numbers // of)}
    return np.array([rounds[int(n // of)][n % of] for n in numbers], dtype=np.int64)
