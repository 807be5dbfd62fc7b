"""What a training is told. Needs no torch."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from skills.detect.training.schedule import Budget, Schedule

__all__ = ["RefineOptions", "TrainOptions"]


@dataclass(frozen=True)
class TrainOptions:
    """What to learn from, where to write, how long, and with how many processes of one thread.

    `start` names a checkpoint or a detector's ONNX file of which the weights are taken over. `keep_early` leaves the
    first layers as they are. With `resume`, learning goes on where `out` stands.
    """

    data: Path
    out: Path
    budget: Budget
    seed: int = 1
    processes: int = 1
    resume: bool = False
    start: Path | None = None
    keep_early: bool = False
    examined: int = 320
    schedule: Schedule = field(default_factory=Schedule)


@dataclass(frozen=True)
class RefineOptions:
    """The same for the second network, which belongs to the first one's file `model`; or for the `third`, beside both.

    `start` names a checkpoint of such a training, or such a network's ONNX file, of which the weights are taken over.
    """

    data: Path
    model: Path
    out: Path
    budget: Budget
    third: bool = False
    seed: int = 1
    processes: int = 1
    resume: bool = False
    start: Path | None = None
    examined: int = 320
    batch: int = 64
    schedule: Schedule = field(default_factory=Schedule)
