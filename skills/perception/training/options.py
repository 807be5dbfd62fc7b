"""What a training is told. Needs no torch."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from skills.perception.training.schedule import Budget, Schedule

__all__ = ["RefineOptions", "TrainOptions"]


@dataclass(frozen=True)
class TrainOptions:
    """What to learn from, where to write, how long, and with how many processes of one thread.

    `start` names a checkpoint or a detector's ONNX file of which the weights are taken over. With
    `resume`, learning goes on where `out` stands.
    """

    data: Path
    out: Path
    budget: Budget
    seed: int = 1
    processes: int = 1
    resume: bool = False
    start: Path | None = None
    examined: int = 320
    schedule: Schedule = field(default_factory=Schedule)


@dataclass(frozen=True)
class RefineOptions:
    """The same for the refinement network behind the proposal network's file `model`, or the `classifier` network.

    `start` names a checkpoint of such a training, or such a network's ONNX file, of which the weights are taken over.
    """

    data: Path
    model: Path
    out: Path
    budget: Budget
    classifier: bool = False
    seed: int = 1
    processes: int = 1
    resume: bool = False
    start: Path | None = None
    examined: int = 320
    batch: int = 64
    schedule: Schedule = field(default_factory=Schedule)
