"""Batches of training canvases as tensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from errand_train.detector.assign import TruthBatch
from errand_train.detector.canvases import Canvas, CanvasMaker
from errand_train.detector.placing import Targets
from errand_train.detector.schedule import Phase, shuffled_numbers


@dataclass(frozen=True)
class Batch:
    """Pictures (N, 3, H, W) from 0 to 1 and their targets."""

    pictures: Tensor
    truth: TruthBatch

    @property
    def inputs(self) -> tuple[Tensor, ...]:
        """Inputs of the network."""
        return (self.pictures,)


@dataclass(frozen=True)
class Feed:
    """Endless sequence of canvases, equal for equal seeds."""

    maker: CanvasMaker
    seed: int

    def batch(self, taken: int, phase: Phase) -> Batch:
        """Next batch after `taken` canvases."""
        chosen = shuffled_numbers(self.seed, taken, phase.batch, len(self.maker.pictures))
        canvases = [
            self.maker.make(int(index), phase.canvas, np.random.default_rng([self.seed, taken + k]))
            for k, index in enumerate(chosen)
        ]
        return batch_of(canvases)


def batch_of(canvases: Sequence[Canvas]) -> Batch:
    """Joins canvases of one size to a batch."""
    pictures = torch.from_numpy(np.stack([canvas.picture for canvas in canvases]))
    scaled = pictures.permute(0, 3, 1, 2).float().mul_(1.0 / 255.0)
    return Batch(scaled.contiguous(memory_format=torch.channels_last), truth_of([c.targets for c in canvases]))


def truth_of(targets: Sequence[Targets]) -> TruthBatch:
    """Joins the targets of several canvases, padded to the same number of rows, at least one."""
    rows = max(1, max((len(one.boxes) for one in targets), default=1))
    boxes = torch.zeros((len(targets), rows, 4))
    classes = torch.zeros((len(targets), rows), dtype=torch.int64)
    ignored = torch.zeros((len(targets), rows), dtype=torch.bool)
    present = torch.zeros((len(targets), rows), dtype=torch.bool)
    for k, one in enumerate(targets):
        count = len(one.boxes)
        boxes[k, :count] = torch.from_numpy(one.boxes)
        classes[k, :count] = torch.from_numpy(one.classes)
        ignored[k, :count] = torch.from_numpy(one.ignored)
        present[k, :count] = True
    return TruthBatch(boxes, classes, ignored, present)
