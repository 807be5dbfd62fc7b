"""Batches of augmented RoI crops: rotated, mirrored, shifted and with other light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from errand_train.detector.photometry import change_photometry
from errand_train.detector.placing import similarity_map
from errand_train.detector.proposal_table import ProposalTable
from errand_train.detector.schedule import shuffled_numbers
from errand_train.detector.store import PictureStore
from skills.perception.detector.model_files import CROP_PX
from skills.perception.detector.onnx_detector import crop_map, transform_boxes

Floats = NDArray[np.float32]
Picture = NDArray[np.uint8]
_ON_THINGS: Final = 0.5
_CHANGED: Final = 0.7
_RIGHT_ANGLE: Final = np.pi / 2
_TURNED: Final = 0.2
_SCALES: Final = (0.85, 1.18)
_SHIFT_PX: Final = 6.0
_BOX_SPREAD: Final = 0.04


@dataclass(frozen=True)
class CropBatch:
    """Crops (N, 3, 128, 128) from 0 to 1, with boxes (N, 4) in them, logits (N, K), and targets.

    `wanted` (N, 4) are the target boxes, `classes` (N,) their class indices, -1 for background.
    """

    crops: Tensor
    boxes: Tensor
    logits: Tensor
    wanted: Tensor
    classes: Tensor

    @property
    def inputs(self) -> tuple[Tensor, ...]:
        """Inputs of the network."""
        return (self.crops, self.boxes, self.logits)


@dataclass(frozen=True)
class CropFeed:
    """Endless sequence of crops, equal for equal seeds. Half of them show objects."""

    table: ProposalTable
    store: PictureStore
    seed: int

    def batch(self, taken: int, count: int) -> CropBatch:
        """Next batch after `taken` crops."""
        rows = self._rows(taken, count)
        made = [self._crop(int(row), np.random.default_rng([self.seed, taken + k])) for k, row in enumerate(rows)]
        pictures = torch.from_numpy(np.stack([picture for picture, _ in made])).permute(0, 3, 1, 2)
        boxes = torch.from_numpy(np.stack([both for _, both in made]))
        return CropBatch(
            pictures.float().mul_(1.0 / 255.0).contiguous(memory_format=torch.channels_last),
            boxes[:, 0],
            torch.from_numpy(self.table.logits[rows]),
            boxes[:, 1],
            torch.from_numpy(self.table.classes[rows]),
        )

    def _rows(self, first: int, count: int) -> NDArray[np.int64]:
        """Rows of the table: those on objects and the others by turns."""
        objects, others = np.flatnonzero(self.table.classes >= 0), np.flatnonzero(self.table.classes < 0)
        many = round(count * _ON_THINGS)
        number = first // count
        return np.concatenate(
            [
                objects[shuffled_numbers(self.seed, number * many, many, len(objects))],
                others[shuffled_numbers(self.seed + 1, number * (count - many), count - many, len(others))],
            ]
        )

    def _crop(self, row: int, random: np.random.Generator) -> tuple[Picture, Floats]:
        """A crop, and (2, 4) the region's box and the object's in it."""
        table = self.table
        affine, region = random_crop_map(table.boxes[row], random)
        crop = self.store.scales(int(table.pictures[row])).warp(affine.astype(np.float64), (CROP_PX, CROP_PX))
        if random.random() < _CHANGED:
            crop = change_photometry(crop, random)
        return crop, transform_boxes(np.stack([region, table.wanted[row]]), affine)


def random_crop_map(box: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Draws a box (4,) near another and a random map (2, 3) to its crop; returns map and box."""
    region = _spread(box, random)
    return _changed(crop_map(region), region, random), region


def _spread(box: Floats, random: np.random.Generator) -> Floats:
    """A box (4,) that fits a little otherwise."""
    size = np.tile(box[2:] - box[:2], 2)
    return (box + np.clip(random.normal(0.0, _BOX_SPREAD, 4), -0.1, 0.1) * size).astype(np.float32)


def _changed(affine: Floats, box: Floats, random: np.random.Generator) -> Floats:
    """A crop's map, larger or smaller, shifted, perhaps mirrored and turned by right angles."""
    scale = float(affine[0, 0]) * float(np.exp(random.uniform(*np.log(_SCALES))))
    angle = float(random.integers(1, 4)) * _RIGHT_ANGLE if random.random() < _TURNED else 0.0
    to = CROP_PX / 2 + random.uniform(-_SHIFT_PX, _SHIFT_PX, 2)
    flipped = bool(random.random() < 0.5)
    focus = ((box[:2] + box[2:]) / 2).astype(np.float32)
    return similarity_map(focus, to.astype(np.float32), angle_rad=angle, scale=scale, flipped=flipped)
